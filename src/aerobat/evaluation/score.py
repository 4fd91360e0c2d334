"""Scores: tracking errors, the passage of each gate, saturation, and what a flight came to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from math import inf, isinf
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value, in_notebooks, short, shown, validated
from aerobat.engines.components import components
from aerobat.engines.numpy import ArrayOps
from aerobat.environment import Environment
from aerobat.errors import OutOfRange, SpecError
from aerobat.evaluation.passages import Asked, SampledPath, passages_asked
from aerobat.kernels.running_metrics import Ground, RunningMetrics, lowest_height
from aerobat.planning import Plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.contact import Contact
from aerobat.simulation.flight import Flight
from aerobat.simulation.outcome import LANDING_DEPTH, LANDING_SPEED, TOUCHDOWN, Outcome, counted, length
from aerobat.simulation.passages import (
    Passage,
    StageAttitude,
    WaypointPassage,
    flown_attitudes,
    flown_passages,
    flown_waypoints,
    passages,
    stage_attitudes,
    waypoint_passages,
)
from aerobat.vehicle import Vehicle, as_vehicle

Event: TypeAlias = tuple[float, Outcome, dict[str, object]]  # when [s], what, and its numbers
COASTING = 0.1  # [s] without a pose: several periods of any motion capture


@dataclass(frozen=True)
class ObserverScore:
    """A filter in numbers: its errors, and the longest time that it had to do without poses."""

    max_position_error_m: float
    rms_position_error_m: float
    max_attitude_error_deg: float
    rms_attitude_error_deg: float
    longest_without_pose_s: float
    until_s: float  # when that was over

    @property
    def coasted(self) -> bool:
        """True if it had to go by the IMU alone for long."""
        return self.longest_without_pose_s > COASTING


@dataclass(frozen=True)
class LapTime:
    """A lap of a course as it was flown, to the last of its gates and waypoints.

    One of a closed course goes all the way round: it ends as long after that as is planned to its seam.
    """

    lap: int  # counted from 1
    end: float  # [s] when it ended; NaN where one of the lap was not
    duration: float  # [s] since the lap before, or the start


@in_notebooks
@by_value
@dataclass(frozen=True, eq=False)
class Score:
    """A flight in numbers."""

    max_position_error_m: float
    rms_position_error_m: float
    max_attitude_error_deg: float
    rms_attitude_error_deg: float
    saturated_fraction: float  # of the control periods, any rotor's command clipped
    passages: tuple[Passage, ...]  # one for each gate, in the order of the stages
    outcome: Outcome  # the first thing that went wrong, if anything did
    sentence: str  # the outcome with its numbers
    observer: ObserverScore | None = None  # of a filter, where a logged flight had one
    waypoints: tuple[WaypointPassage, ...] = ()  # one for each ball, in the order of the stages
    lap_begin_s: float = 0.0  # when the first lap begins; a closed course's before the flight
    places: tuple[WaypointPassage, ...] = ()  # other stages that say where they are, then the goal
    attitudes: tuple[StageAttitude, ...] = ()  # of other stages, in their order

    @property
    def laps(self) -> tuple[LapTime, ...]:
        """The laps of a closed course or of one of several; none where it has no gates or waypoints."""
        passed = [(gate.lap, gate.time) for gate in self.passages]
        passed += [(waypoint.lap, waypoint.time) for waypoint in self.waypoints]
        numbers = sorted({lap for lap, _ in passed})
        ends = [float(np.max([time for lap, time in passed if lap == number])) for number in numbers]
        has_laps = len(numbers) > 1 or self.lap_begin_s < 0.0
        ends = [end - self.lap_begin_s for end in ends]
        durations = np.diff([0.0, *ends]).tolist()
        return tuple(map(LapTime, numbers, ends, durations)) if has_laps else ()

    def __str__(self) -> str:
        """One line for people."""
        error = (
            "" if self.outcome.is_success else f"position error {length(self.max_position_error_m)} at most, "
        )
        return (
            f"{self.sentence}; {error}attitude error {self.rms_attitude_error_deg:.2f}° RMS, "
            f"saturated {100 * self.saturated_fraction:.1f} % of the time"
        )


@short
@by_value
@dataclass(frozen=True, eq=False, repr=False)
class Scores:
    """The scores of many flights: arrays with one entry a flight; `scores[k]` is one flight's Score."""

    max_position_error_m: Array
    rms_position_error_m: Array
    max_attitude_error_deg: Array
    rms_attitude_error_deg: Array
    saturated_fraction: Array
    passages: tuple[Passage, ...]  # one for each gate, its fields arrays
    waypoints: tuple[WaypointPassage, ...]  # one for each ball, its fields arrays
    stop: Array  # [s] when a flight diverged, NaN if it did not
    is_finite: Array  # false where a flight diverged by what is not a number
    ground_time: Array  # [s] when a vehicle was below ground first, NaN if never
    contact: Array  # what it came to touch first, by the codes of Contact, where its plant felt that
    contact_time: Array  # [s] when, NaN if never
    off_path_time: Array  # [s] when a vehicle had left its path first, NaN if never
    path_radius_m: float = inf  # by which the path may be left
    lap_begin_s: float = 0.0  # when the first lap begins; a closed course's before the flight
    places: tuple[WaypointPassage, ...] = ()  # other stages that say where they are, then the goal
    attitudes: tuple[StageAttitude, ...] = ()  # of other stages, in their order

    def __post_init__(self) -> None:
        """Write-protect."""
        judged = (*self.passages, *self.waypoints, *self.places, *self.attitudes)
        parts = (part for one in judged for part in vars(one).values())
        for value in (*vars(self).values(), *parts):
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        return len(self.stop)

    @validated
    def __getitem__(self, k: int) -> Score:
        """The score of one flight."""
        if not -len(self) <= k < len(self):
            raise OutOfRange(f"there are {len(self)} flights, no flight {shown(k)}; count from 0")
        found = Score(
            **{field.name: float(getattr(self, field.name)[k]) for field in fields(self)[:5]},
            passages=tuple(passage.of_flight(k) for passage in self.passages),
            outcome=Outcome.COMPLETE,
            sentence="",
            observer=None,
            waypoints=tuple(waypoint.of_flight(k) for waypoint in self.waypoints),
            lap_begin_s=self.lap_begin_s,
            places=tuple(place.of_flight(k) for place in self.places),
            attitudes=tuple(attitude.of_flight(k) for attitude in self.attitudes),
        )
        outcome, sentence = self._outcome(k, found)
        return replace(found, outcome=outcome, sentence=sentence)

    def __iter__(self) -> Iterator[Score]:
        return (self[k] for k in range(len(self)))

    def __str__(self) -> str:
        """One line for people."""
        error = f"position error {length(float(self.max_position_error_m.max()))} at most"
        return f"{len(self)} flights: {counted(self.outcomes)}; {error}"

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """True of flights that did all that was asked, (flights,)."""
        return np.array([outcome.is_success for outcome in self.outcomes])

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """Outcome of each flight."""
        return tuple(score.outcome for score in self)

    def _outcome(self, k: int, score: Score) -> tuple[Outcome, str]:
        """The first thing that went wrong, else through all gates, else flown to the end.

        What gates, waypoints, the ground and the plant say comes before what is kept to a tolerance.
        """
        passed = score.passages
        found = [*self._endings(k), *_failures(passed, score.waypoints)] or [
            *_failures((), (*score.places, *score.attitudes)),
            *self._departure(k),
        ]
        if found:
            time, outcome, numbers = min(found, key=lambda event: event[0])
            return outcome, outcome.sentence(time=time, **numbers)
        error = length(score.max_position_error_m)
        if not passed:
            allowed = "" if isinf(self.path_radius_m) else f", {length(self.path_radius_m)} allowed"
            return Outcome.COMPLETE, Outcome.COMPLETE.sentence(error=error) + allowed
        worst = max(passed, key=lambda passage: passage.miss)
        several = "both" if len(passed) == 2 else f"all {len(passed)}"
        gates = "the gate" if len(passed) == 1 else f"{several} gates, the worst"
        numbers = {"gate": gates, "speed": worst.speed, "miss": length(worst.miss), "error": error}
        return Outcome.THROUGH_GATES, Outcome.THROUGH_GATES.sentence(**numbers)

    def _endings(self, k: int) -> Iterator[Event]:
        """The divergence of a flight, and what it touched."""
        if np.isfinite(self.stop[k]):
            outcome = Outcome.DIVERGED if self.is_finite[k] else Outcome.STATE_NOT_FINITE
            yield float(self.stop[k]), outcome, {}
        if np.isfinite(self.ground_time[k]):
            yield float(self.ground_time[k]), Outcome.HIT_GROUND, {}
        if np.isfinite(self.contact_time[k]):
            at_gate = self.contact[k] == Contact.GATE
            outcome = Outcome.TOUCHED_GATE if at_gate else Outcome.TOUCHED_GROUND
            yield float(self.contact_time[k]), outcome, {}

    def _departure(self, k: int) -> Iterator[Event]:
        """When a flight left its path, if it did."""
        if np.isfinite(self.off_path_time[k]):
            error = length(float(self.max_position_error_m[k]))
            numbers = {"allowed": length(self.path_radius_m), "error": error}
            yield float(self.off_path_time[k]), Outcome.OFF_PATH, {**numbers}


def _failures(
    passed: tuple[Passage, ...], others: tuple[WaypointPassage | StageAttitude, ...]
) -> Iterator[Event]:
    """What went wrong at gates, and at waypoints and other stages."""
    for passage in passed:
        label = "the gate" if len(passed) == 1 else f"gate '{passage.gate}'"
        if passage.failure is not None:
            outcome, time, numbers = passage.failure
            yield time, outcome, {"gate": label, **numbers}
    for other in others:
        if other.failure is not None:
            outcome, time, numbers = other.failure
            yield time, outcome, numbers


@validated
def score(flight: Flight, goal: Problem | Plan | str, vehicle: Vehicle | str | None = None) -> Score:
    """Score one flight; with the vehicle, by default the plan's, its clearance in the gates too.

    Errors are against the set-points in the flight: position as a distance [m], attitude as the angle of
    the relative rotation [deg]. With a plan, gates are to be passed at its stages' instants; with the
    problem alone, at the set-points' nearest approaches. Raises SpecError for a batch of flights.
    """
    if flight.is_batch:
        raise SpecError("score takes one flight at a time; of a batch, score flight[k]")
    goal = as_problem(goal) if isinstance(goal, str) else goal
    if vehicle is None and isinstance(goal, Plan):
        vehicle = goal.vehicle
    states = flight.states
    square, angle = flight.position_error**2, flight.attitude_error
    stop = flight.diverged_at
    body = None if vehicle is None else as_vehicle(vehicle).bounding_ellipsoid
    setpoint = flight.setpoint
    path = SampledPath(flight.times, setpoint.flat.position, setpoint.q_world_body)
    planned = passages_asked(goal, path)
    is_off = flight.position_error > planned.path_radius
    contact, touched = flight.first_contact
    lowest = lowest_height(ArrayOps, ground_of(flight.environment), components(states.velocity))
    scored = Scores(
        max_position_error_m=np.sqrt([square.max()]),
        rms_position_error_m=np.sqrt([square.mean()]),
        max_attitude_error_deg=np.rad2deg([angle.max()]),
        rms_attitude_error_deg=np.rad2deg(np.sqrt([np.mean(angle**2)])),
        saturated_fraction=np.array([flight.saturated.mean()]),
        passages=tuple(flown_passages(flight, planned.gates, body)),
        waypoints=tuple(flown_waypoints(flight, planned.waypoints)),
        stop=stop,
        is_finite=np.array([flight.outcome is not Outcome.STATE_NOT_FINITE]),
        ground_time=_first(flight.times, states.position[:, 2] < lowest),
        contact=np.array([contact]),
        contact_time=np.array([touched]),
        off_path_time=_first(flight.times, is_off),
        path_radius_m=planned.path_radius,
        lap_begin_s=planned.lap_begin,
        places=tuple(flown_waypoints(flight, planned.places)),
        attitudes=tuple(flown_attitudes(flight, planned.attitudes)),
    )[0]
    return replace(scored, observer=_observer(flight))


def ground_of(environment: Environment) -> Ground:
    """Return the ground of an environment as flights hit it."""
    height = -inf if environment.ground is None else environment.ground
    return Ground(height - TOUCHDOWN, height - LANDING_DEPTH, LANDING_SPEED**2)


def _first(times: Array, happens: NDArray[np.bool_]) -> Array:
    """The first of the times at which something happens, NaN if it never does, (1,)."""
    return np.array([times[int(np.argmax(happens))] if happens.any() else np.nan])


def _observer(flight: Flight) -> ObserverScore | None:
    """How well the filter knew the flight, if there was one."""
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


def scores_of(metrics: RunningMetrics, planned: Asked) -> Scores:
    """Scores of flights that were added up as they were flown, from their last metrics, leaves (flights,)."""
    ticks = np.maximum(metrics.ticks, 1.0)
    stop = np.where(metrics.flying < 0.5, metrics.stop, np.nan)
    met = [
        waypoint_passages(each, approach, stop)
        for each, approach in zip((*planned.waypoints, *planned.places), metrics.waypoints, strict=True)
    ]
    return Scores(
        max_position_error_m=np.sqrt(metrics.max_square),
        rms_position_error_m=np.sqrt(metrics.sum_square / ticks),
        max_attitude_error_deg=np.rad2deg(metrics.max_angle),
        rms_attitude_error_deg=np.rad2deg(np.sqrt(metrics.sum_square_angle / ticks)),
        saturated_fraction=metrics.saturated / ticks,
        passages=tuple(
            passages(each, progress, stop)
            for each, progress in zip(planned.gates, metrics.gates, strict=True)
        ),
        waypoints=tuple(met[: len(planned.waypoints)]),
        stop=stop,
        is_finite=metrics.is_finite > 0.5,
        ground_time=_if_ever(metrics.ground_time),
        contact=np.zeros(stop.shape),
        contact_time=np.full(stop.shape, np.nan),
        off_path_time=_if_ever(metrics.off_path_time),
        path_radius_m=planned.path_radius,
        lap_begin_s=planned.lap_begin,
        places=tuple(met[len(planned.waypoints) :]),
        attitudes=tuple(
            stage_attitudes(each, pointing, stop)
            for each, pointing in zip(planned.attitudes, metrics.attitudes, strict=True)
        ),
    )


def _if_ever(times: Array) -> Array:
    """Times that are infinite where something never happened, NaN instead."""
    return np.where(np.isinf(times), np.nan, times)
