"""Facts of flights: outcome, errors and passages of a flight; the columns of flights and of scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import isinf, isnan
from typing import Any

import numpy as np

from aerobat.arrays import AXES, Array
from aerobat.estimation import Estimates
from aerobat.evaluation.criteria import GOAL
from aerobat.evaluation.score import METRICS, ObserverScore, Score
from aerobat.flatness import Reference
from aerobat.reporting.facts import NONE, REPORT, Columns, Fact, facts, fields_of, line, record
from aerobat.reporting.plans import rough_length
from aerobat.simulation import Flight
from aerobat.simulation.flight import setpoint_series
from aerobat.simulation.outcome import digits, length
from aerobat.simulation.passages import NearestObstacle, Passage, WaypointPassage, passage_names

COMPONENTS = {3: AXES, 4: "wxyz"}  # of vectors and quaternions
# fields of a score that only its sentence needs
EVENTS = ("stop", "is_finite", "ground_time", "off_path_time", "contact", "contact_time", "path_radius_m")


@facts.register
def _(score: Score) -> Iterator[Fact]:
    if score.is_batch:
        yield line("", str(score))
        yield Fact("flights", Columns(_flights_of(score)))
        return
    yield from (fact for fact in fields_of(score) if fact.key not in EVENTS)
    yield from record(outcome=score.outcome, sentence=score.sentence, laps=score.laps)
    yield from _report(score)
    for lap in score.laps:
        split = "not flown" if isnan(lap.duration) else f"{lap.duration:.3f} s, until {lap.end:.3f} s"
        yield line(f"lap {lap.lap}", split, level=REPORT)
    yield line("outcome", score.sentence)
    position = _pair(100 * score.max_position_error_m, 100 * score.rms_position_error_m, "cm")
    yield line("position error", position)
    attitude = _pair(score.max_attitude_error_deg, score.rms_attitude_error_deg, "°")
    yield line("attitude error", attitude)
    if score.observer is not None:
        yield line("observer", _observer(score.observer))
    several = bool(score.laps)
    for passage in score.passages:
        yield line(_of_lap(passage.gate, passage.lap, several), _passed(passage))
    for waypoint in score.waypoints:
        met = (
            f"{length(waypoint.miss)} from it, {length(waypoint.radius)} allowed, "
            f"at {waypoint.speed:.2f} m/s at {waypoint.time:.2f} s"
        )
        missed = "not reached" if isnan(waypoint.time) else met
        yield line(_of_lap(waypoint.waypoint, waypoint.lap, several), missed)
    if score.nearest is not None:
        yield line("nearest", _nearest(score.nearest))
    if score.places or score.attitudes:
        yield line("tolerance", _within_tolerance(score))
    yield line("saturated", f"{100 * score.saturated_fraction:.1f} % of the time")


@facts.register
def _(found: NearestObstacle) -> Iterator[Fact]:
    yield from record(obstacle=found.obstacle or None, clearance_m=found.clearance, time_s=found.time)


@facts.register
def _(passage: Passage) -> Iterator[Fact]:
    for fact in fields_of(passage):  # an edge that is not known is None, as are numbers
        yield Fact(fact.key, None if fact.value == "" else fact.value)


@facts.register
def _(flight: Flight) -> Iterator[Fact]:
    yield line("", str(flight))
    yield Fact("rows", Columns(_rows_of(flight)))


@facts.register
def _(found: Reference) -> Iterator[Fact]:
    thrusts = _components({"rotor_thrusts": found.rotor_thrusts}, is_in_space=False)
    setpoints = _components(setpoint_series(found.setpoint))
    yield Fact("rows", Columns({"time": found.times, **setpoints, **thrusts}))
    yield from fields_of(found)


@facts.register
def _(found: Estimates) -> Iterator[Fact]:
    arrays = {name: part for name, part in vars(found).items() if isinstance(part, np.ndarray)}
    series = {name: part for name, part in arrays.items() if part.ndim == 2}  # all others are of poses
    yield Fact("rows", Columns({"time": found.times, **_components(series)}))
    yield from fields_of(found)


def _report(score: Score) -> Iterator[Fact]:
    """Yield the lines of a report on a flight."""
    if not score.outcome.is_success:
        yield line("flight", score.sentence, level=REPORT, style="red")
        return
    gates = [passage for passage in score.passages if not isnan(passage.time)]
    if gates:
        name = gates[0].gate if len(gates) == 1 else f"{len(gates)} gates"
        speeds = _span([passage.speed for passage in gates], "m/s")
        clearances = [passage.clearance for passage in gates if not isnan(passage.clearance)]
        clear = f", {rough_length(min(clearances))} clear of the frame" if clearances else ""
        yield line(name, f"passed at {speeds}{clear}", level=REPORT)
    if score.waypoints:
        nearest = max(waypoint.miss for waypoint in score.waypoints)
        reached = f"{len(score.waypoints)} reached within {rough_length(nearest)}"
        yield line("waypoints", reached, level=REPORT)
    if score.nearest is not None:
        yield line("nearest", _nearest(score.nearest), level=REPORT)
    within = f"on its path within {rough_length(score.max_position_error_m)}"
    yield line("flight", within, level=REPORT)


def _span(values: Sequence[float], unit: str) -> str:
    """Return the least and the greatest of values as text, once if they are the same."""
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _within_tolerance(score: Score) -> str:
    """Return the largest distances of a flight from goal and stages, beside the problem's tolerance."""
    parts = []
    if score.places:
        miss, allowed = max((place.miss, place.radius) for place in score.places)
        parts.append(f"{length(miss)} of {length(allowed)} off {_names(score.places)}")
    if score.attitudes:
        angle, tolerance = max((each.angle_deg, each.tolerance_deg) for each in score.attitudes)
        parts.append(f"{angle:.2f}° of {tolerance:.3g}° off the attitudes of {len(score.attitudes)} stages")
    times = [place.time for place in score.places] + [attitude.time for attitude in score.attitudes]
    return "not all reached" if any(map(isnan, times)) else f"{', '.join(parts)}, at most"


def _names(places: Sequence[WaypointPassage]) -> str:
    """Name the places to reach besides gates and waypoints: stages, the goal, or both."""
    stages = len(places) - sum(place.waypoint == GOAL for place in places)
    return GOAL if not stages else f"{stages} stages" + (f" and {GOAL}" if len(places) > stages else "")


def _observer(found: ObserverScore) -> str:
    """Return the errors of the filter, and the time in which it had no poses."""
    errors = (
        f"{length(found.rms_position_error_m)} and {digits(found.rms_attitude_error_deg)}° RMS off the truth"
    )
    if not found.coasted:
        return errors
    begin = found.until_s - found.longest_without_pose_s
    return f"{errors}; no poses from {begin:.2f} to {found.until_s:.2f} s, the IMU alone"


def _of_lap(name: str, lap: int, several: bool) -> str:
    """Return the name of a gate or waypoint, with the lap if there are several laps."""
    return f"{name}, lap {lap}" if several else name


def _passed(passage: Passage) -> str:
    """Return the passage of a gate in words."""
    if isnan(passage.time):
        return "not passed"
    clearance = "" if isnan(passage.clearance) else f", {_clearance(passage)}"
    tolerance = passage.attitude_tolerance_deg
    attitude = "" if isinf(tolerance) else f"{passage.attitude_error_deg:.2f}° of {tolerance:.3g}° allowed, "
    return f"{length(passage.miss)} off, {attitude}at {passage.speed:.2f} m/s{clearance}"


def _clearance(passage: Passage) -> str:
    """Return the least clearance in words, with the nearest edge and the time."""
    centimetres = 100 * passage.clearance
    found = f"{-centimetres:.1f} cm into" if centimetres < 0.0 else f"{centimetres:.1f} cm clear of"
    return f"{found} the {passage.closest_edge} edge at {passage.closest_time:.2f} s"


def _nearest(found: NearestObstacle) -> str:
    """Return the nearest obstacle in words, with the clearance and the time."""
    if not found.obstacle:
        return NONE
    apart = "touched" if found.clearance < 0.0 else length(found.clearance)
    return f"'{found.obstacle}', {apart} at {found.time:.2f} s"


def _pair(largest: float, rms: float, unit: str) -> str:
    return f"{digits(largest)} {unit} at most, {digits(rms)} {unit} RMS"


def _rows_of(flight: Flight) -> dict[str, Any]:
    """Return the columns of a flight, or of a batch; none for a batch without flights."""
    if not flight.vehicles:
        return {}
    if not flight.is_batch:
        return _columns(flight)
    each = [_columns(flight[k]) for k in range(len(flight))]
    numbers = [np.full(len(columns["time"]), k) for k, columns in enumerate(each)]
    joined = {name: np.concatenate([columns[name] for columns in each]) for name in each[0]}
    return {"vehicle": np.concatenate(numbers), **joined}


def _columns(flight: Flight) -> dict[str, Array]:
    columns = {"time": flight.times}
    for one in flight.kinds:
        if one.over_time:
            columns |= _components({one.name: flight.series[one.name]}, min(one.shape, default=1) > 0)
    return columns


def _components(series: Mapping[str, Array], is_in_space: bool = True) -> dict[str, Array]:
    """Return a column for each component of series, named by its letter in space, else by its number."""
    columns = {}
    for name, values in series.items():
        if values.ndim == 1:
            columns[name] = values
            continue
        letters = COMPONENTS.get(values.shape[1]) if is_in_space else None
        for k, column in enumerate(values.T):
            columns[f"{name}_{letters[k] if letters else k}"] = column
    return columns


def _flights_of(scores: Score) -> dict[str, Any]:
    """Return the columns of the scores of many flights."""
    columns: dict[str, Any] = {name: getattr(scores, name) for name in METRICS}
    columns["outcome"] = [outcome.name.lower() for outcome in scores.outcomes]
    for begin, passage in zip(passage_names(scores.passages), scores.passages, strict=True):
        parts = {name: value for name, value in vars(passage).items() if name not in ("gate", "lap")}
        columns |= {f"{begin}_{name}": value for name, value in parts.items()}
    for waypoint in (*scores.waypoints, *scores.places):
        begin = f"{waypoint.waypoint}_lap_{waypoint.lap}"
        columns |= {f"{begin}_{name}": getattr(waypoint, name) for name in ("time", "miss", "speed")}
    if scores.nearest is not None:
        columns |= {f"nearest_{name}": value for name, value in vars(scores.nearest).items()}
    return columns
