"""Scores of flights: tracking errors, passages of gates, saturation, and the outcome."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isfinite, isinf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value, in_notebooks, shown, validated
from aerobat.errors import OutOfRange, SpecError
from aerobat.evaluation.criteria import SampledPath, criteria_of
from aerobat.kernels.running_metrics import RunningMetrics
from aerobat.planning import Plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.flight import Flight
from aerobat.simulation.metrics import Criteria, metrics_of_log
from aerobat.simulation.outcome import Contact, FlightFailure, Outcome, counted, length
from aerobat.simulation.passages import (
    NearestObstacle,
    Passage,
    StageAttitude,
    WaypointPassage,
    nearest_in_log,
    passages,
    stage_attitudes,
    waypoint_passages,
)
from aerobat.simulation.passages.passage import PerFlight
from aerobat.vehicle import Vehicle, as_vehicle

# [m] median distance from the set-points that shows another path; clock differences make less
MAX_MEDIAN_DISTANCE = 0.5
COASTING = 0.1  # [s] without a pose from which a filter coasts: several periods of any motion capture
METRICS = (  # fields of a Score that are one number for each flight
    "max_position_error_m",
    "rms_position_error_m",
    "max_attitude_error_deg",
    "rms_attitude_error_deg",
    "saturated_fraction",
)
_CONTACT_OUTCOMES = {  # outcomes of contacts detected by the plant
    Contact.GROUND: Outcome.TOUCHED_GROUND,
    Contact.GATE: Outcome.TOUCHED_GATE,
    Contact.OBSTACLE: Outcome.HIT_OBSTACLE,
}


@dataclass(frozen=True)
class ObserverScore:
    """The errors of a state estimator, and its longest time without poses."""

    max_position_error_m: float
    rms_position_error_m: float
    max_attitude_error_deg: float
    rms_attitude_error_deg: float
    longest_without_pose_s: float
    until_s: float  # the end of that time

    @property
    def coasted(self) -> bool:
        """True if the estimator had to rely on the IMU alone for long."""
        return self.longest_without_pose_s > COASTING


@dataclass(frozen=True)
class LapTime:
    """A lap of a course as flown, up to the last of its gates and waypoints.

    A lap of a closed course ends later than that, by the planned time from the last passage to the seam.
    """

    lap: int  # numbered from 1
    end: float  # [s] end of the lap; NaN where a passage of the lap is missing
    duration: float  # [s] since the end of the previous lap, or the start


@in_notebooks
@by_value
class Score(PerFlight):
    """The score of one flight, or of a batch of flights: then the numbers are arrays (flights,)."""

    max_position_error_m: float
    rms_position_error_m: float
    max_attitude_error_deg: float
    rms_attitude_error_deg: float
    saturated_fraction: float  # fraction of control periods with a clipped rotor command
    passages: tuple[Passage, ...]  # one for each gate, in the order of the stages
    waypoints: tuple[WaypointPassage, ...]  # one for each ball, in the order of the stages
    places: tuple[WaypointPassage, ...]  # other stages that constrain the position, then the goal
    attitudes: tuple[StageAttitude, ...]  # other stages that constrain the attitude, in their order
    stop: float  # [s] time of divergence, NaN if none
    is_finite: bool  # false where it diverged with values that are not finite
    ground_time: float  # [s] first time below the ground, NaN if never
    off_path_time: float  # [s] first time off the path, NaN if never
    contact: Contact  # first contact, if the plant detects contacts
    contact_time: float  # [s] time of the first contact, NaN if none
    nearest: NearestObstacle | None = None  # None without obstacles, or for an unknown body
    path_radius_m: float = inf  # allowed distance from the path
    lap_begin_s: float = 0.0  # start of the first lap; before the flight for a closed course
    observer: ObserverScore | None = None  # errors of the state estimator, for a logged flight that had one

    @property
    def is_batch(self) -> bool:
        """True for a batch, false for one flight."""
        return bool(np.ndim(self.stop))

    def __len__(self) -> int:
        """Return the number of flights of a batch."""
        return np.size(self.stop)

    @validated
    def __getitem__(self, k: int) -> Score:
        """Return the score of one flight of a batch. Raise SpecError for the score of one flight."""
        if not self.is_batch:
            raise SpecError("this is the score of one flight, not of a batch: use it without an index")
        if not -len(self) <= k < len(self):
            raise OutOfRange(f"there are {len(self)} flights, no flight {shown(k)}; count from 0")
        return self.of_flight(k)

    def __iter__(self) -> Iterator[Score]:
        return (self[k] for k in range(len(self)))

    def __str__(self) -> str:
        """Return a one-line summary."""
        error = f"position error {length(float(np.max(self.max_position_error_m)))} at most"
        if self.is_batch:
            return f"{len(self)} flights: {counted(self.outcomes)}; {error}"
        turned = f"attitude error {self.rms_attitude_error_deg:.2f}° RMS"
        saturated = f"saturated {100 * self.saturated_fraction:.1f} % of the time"
        errors = [*([] if self.outcome.is_success else [error]), turned, saturated]
        return f"{self.sentence}; {', '.join(errors)}"

    @property
    def outcome(self) -> Outcome:
        """The first failure, else success. Raises SpecError for a batch."""
        return self._end[0]

    @property
    def sentence(self) -> str:
        """The outcome with its numbers. Raises SpecError for a batch."""
        return self._end[1]

    @cached_property
    def outcomes(self) -> tuple[Outcome, ...]:
        """The outcome of each flight."""
        return tuple(score.outcome for score in self) if self.is_batch else (self.outcome,)

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """True for flights without any failure, (flights,)."""
        return np.array([outcome.is_success for outcome in self.outcomes])

    @property
    def laps(self) -> tuple[LapTime, ...]:
        """The laps of a closed or repeated course; empty without gates or waypoints."""
        passed = [(gate.lap, gate.time) for gate in self.passages]
        passed += [(waypoint.lap, waypoint.time) for waypoint in self.waypoints]
        numbers = sorted({lap for lap, _ in passed})
        ends = [float(np.max([time for lap, time in passed if lap == number])) for number in numbers]
        has_laps = len(numbers) > 1 or self.lap_begin_s < 0.0
        ends = [end - self.lap_begin_s for end in ends]
        durations = np.diff([0.0, *ends]).tolist()
        return tuple(map(LapTime, numbers, ends, durations)) if has_laps else ()

    @cached_property
    def _end(self) -> tuple[Outcome, str]:
        """The outcome and its sentence: the first failure, else through all gates, else complete.

        Divergence, contacts and failures at gates and waypoints take precedence over violated tolerances.
        """
        if self.is_batch:
            raise SpecError("outcome is asked of one flight; of a batch, ask score[k].outcome or outcomes")
        passed = self.passages
        found = [*self._endings(), *_failures((*passed, *self.waypoints))] or [
            *_failures((*self.places, *self.attitudes)),
            *self._departure(),
        ]
        if found:
            first = min(found, key=lambda failure: failure.time)
            label = {"gate": "the gate"} if len(passed) == 1 else {}
            return first.outcome, first.sentence(**label)
        error = length(self.max_position_error_m)
        if not passed:
            allowed = "" if isinf(self.path_radius_m) else f", {length(self.path_radius_m)} allowed"
            return Outcome.COMPLETE, Outcome.COMPLETE.sentence(error=error) + allowed
        worst = max(passed, key=lambda passage: passage.miss)
        several = "both" if len(passed) == 2 else f"all {len(passed)}"
        gates = "the gate" if len(passed) == 1 else f"{several} gates, the worst"
        numbers = {"gate": gates, "speed": worst.speed, "miss": length(worst.miss), "error": error}
        return Outcome.THROUGH_GATES, Outcome.THROUGH_GATES.sentence(**numbers)

    def _endings(self) -> Iterator[FlightFailure]:
        """Yield the divergence of a flight and its contacts."""
        if isfinite(self.stop):
            yield FlightFailure(self.stop, Outcome.DIVERGED if self.is_finite else Outcome.STATE_NOT_FINITE)
        if isfinite(self.ground_time):
            yield FlightFailure(self.ground_time, Outcome.HIT_GROUND)
        if self.nearest is not None and self.nearest.failure is not None:
            yield self.nearest.failure
        if isfinite(self.contact_time):
            obstacle = self.nearest.obstacle if self.nearest else "an obstacle"
            yield FlightFailure(self.contact_time, _CONTACT_OUTCOMES[self.contact], {"obstacle": obstacle})

    def _departure(self) -> Iterator[FlightFailure]:
        """Yield the time at which a flight left its path, if it did."""
        if isfinite(self.off_path_time):
            error, allowed = length(self.max_position_error_m), length(self.path_radius_m)
            yield FlightFailure(self.off_path_time, Outcome.OFF_PATH, {"allowed": allowed, "error": error})


def _failures(judged: Iterable[Passage | WaypointPassage | StageAttitude]) -> Iterator[FlightFailure]:
    """Yield the failures at gates, waypoints and other stages."""
    yield from (each.failure for each in judged if each.failure is not None)


def _require_own_plan(times: Array, setpoints: Array, plan: Plan) -> None:
    """Raise SpecError for a plan whose path is not that of the set-points (T, 3) at these times [s]."""
    path = plan.trajectory.evaluate(np.clip(times, 0.0, plan.duration))
    off = float(np.median(np.linalg.norm(setpoints - path, axis=1)))
    if off > MAX_MEDIAN_DISTANCE:
        raise SpecError(
            f"goal: the plan's path lies {length(off)} from the flight's set-points half of the time; give "
            "the flight's own plan"
        )


@validated
def score(flight: Flight, goal: Problem | Plan | str, vehicle: Vehicle | str | None = None) -> Score:
    """Score one flight.

    The vehicle, by default the plan's, gives the size of the body for its clearance in gates. Errors are
    relative to the flight's set-points: position as a distance [m], attitude as the angle of the relative
    rotation [deg]. With a plan, gates are to be passed at the instants of its stages. With a problem only,
    the set-points' nearest approaches are used. SpecError is raised for a batch of flights, and for the plan
    of another flight.
    """
    if flight.is_batch:
        raise SpecError("score takes one flight at a time; of a batch, score flight[k]")
    goal = as_problem(goal) if isinstance(goal, str) else goal
    if vehicle is None and isinstance(goal, Plan):
        vehicle = goal.vehicle
    body = None if vehicle is None else as_vehicle(vehicle).bounding_ellipsoid
    setpoint = flight.setpoint
    if isinstance(goal, Plan):
        _require_own_plan(flight.times, setpoint.flat.position, goal)
    criteria = criteria_of(goal, SampledPath(flight.times, setpoint.flat.position, setpoint.q_world_body))
    contact, touched = flight.first_contact
    states, pieces = flight.states, flight.environment.pieces
    batch = score_of(metrics_of_log(flight, criteria, body), criteria)
    return replace(
        batch[0],
        contact=contact,
        contact_time=touched,
        nearest=nearest_in_log(pieces, flight.times, states.position, states.q_world_body, body),
        observer=_observer(flight),
    )


def _observer(flight: Flight) -> ObserverScore | None:
    """Return the errors of the estimator, or None for a flight without one."""
    if not flight.is_observed:
        return None
    off = np.linalg.norm(flight.observed_position - flight.states.position, axis=-1)
    angle = so3.angle_between(flight.observed_q_world_body, flight.states.q_world_body)
    latest = int(np.argmax(flight.since_pose))
    return ObserverScore(
        max_position_error_m=float(off.max()),
        rms_position_error_m=float(np.sqrt(np.mean(off**2))),
        max_attitude_error_deg=float(np.rad2deg(angle.max())),
        rms_attitude_error_deg=float(np.rad2deg(np.sqrt(np.mean(angle**2)))),
        longest_without_pose_s=float(flight.since_pose[latest]),
        until_s=float(flight.times[latest]),
    )


def score_of(metrics: RunningMetrics, criteria: Criteria, nearest: NearestObstacle | None = None) -> Score:
    """Return the score of flights from their last metrics, leaves (flights,), and the nearest obstacle."""
    ticks = np.maximum(metrics.ticks, 1.0)
    stop = np.where(metrics.flying < 0.5, metrics.stop, np.nan)
    targets = (*criteria.waypoints, *criteria.places)
    met = [waypoint_passages(*pair, stop) for pair in zip(targets, metrics.waypoints, strict=True)]
    numbers: dict[str, Any] = {
        "max_position_error_m": np.sqrt(metrics.max_square),
        "rms_position_error_m": np.sqrt(metrics.sum_square / ticks),
        "max_attitude_error_deg": np.rad2deg(metrics.max_angle),
        "rms_attitude_error_deg": np.rad2deg(np.sqrt(metrics.sum_square_angle / ticks)),
        "saturated_fraction": metrics.saturated / ticks,
        "stop": stop,
        "is_finite": metrics.is_finite > 0.5,
        "ground_time": _if_ever(metrics.ground_time),
        "off_path_time": _if_ever(metrics.off_path_time),
        "contact": np.full(stop.shape, int(Contact.NOTHING)),
        "contact_time": np.full(stop.shape, np.nan),
    }
    return Score(
        **numbers,
        passages=tuple(passages(*pair, stop) for pair in zip(criteria.gates, metrics.gates, strict=True)),
        waypoints=tuple(met[: len(criteria.waypoints)]),
        places=tuple(met[len(criteria.waypoints) :]),
        attitudes=tuple(
            stage_attitudes(*pair, stop) for pair in zip(criteria.attitudes, metrics.attitudes, strict=True)
        ),
        nearest=nearest,
        path_radius_m=criteria.path_radius,
        lap_begin_s=criteria.lap_begin,
    )


def _if_ever(times: Array) -> Array:
    """Return times with NaN in place of infinity (never)."""
    return np.where(np.isinf(times), np.nan, times)
