"""Scenes: the content of a replay page of a plan or of flights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.environment.obstacles.surface import Surface
from aerobat.environment.obstacles.visible_surfaces import surfaces_around
from aerobat.errors import SpecError
from aerobat.evaluation.score import score
from aerobat.evaluation.subject import Subject, subject_of
from aerobat.flatness import Reference, reference
from aerobat.planning import PlacedStage, Plan
from aerobat.problem.gate import Gate
from aerobat.simulation import Flight
from aerobat.simulation.outcome import length
from aerobat.vehicle import Vehicle

RowIndex = NDArray[np.intp]

PLAN_RATE = 250.0  # [1/s] rows of a plan without a flight
MAX_ROWS = 4000  # of a flight: 60 s are then shown at 67 rows a second
MAX_POSES = 36_000  # of all flights together, so that a page of many stays under 2 MB
MAX_FLIGHTS = 100
FEW_STAGES = 4  # with fewer, there are ghosts between the stages,
GHOSTS = 8  # at so many equal steps of time
SAME_PATH = 1e-6  # [m] largest distance of set-points from their path


@dataclass(frozen=True, eq=False)
class Ghost:
    """The planned pose at one instant."""

    name: str  # of the stage, empty where there is none
    position: Array  # [m], (3,)
    q_world_body: Array  # (4,)


@dataclass(frozen=True, eq=False)
class Track:
    """One vehicle over time, at the instants of its scene."""

    name: str
    position: Array  # [m], (T, 3)
    q_world_body: Array  # (T, 4)
    thrusts: Array  # [N], (T, n)
    end: float  # [s] when it ends, before the others do where it diverges
    failed: bool  # true where something went wrong
    sentence: str  # how it went


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity of each track over time."""

    name: str
    unit: str
    values: Array  # (tracks, T)


@dataclass(frozen=True, eq=False)
class Scene:
    """The content of a view: a vehicle, gates, the planned path and the flights along it."""

    title: str
    facts: tuple[str, ...]  # a line each
    is_well: bool  # false where the first fact says that something went wrong
    vehicle: Vehicle
    gravity: float  # [m/s²]
    ground: float | None  # [m]
    gates: tuple[Gate, ...]
    surfaces: tuple[Surface, ...]  # of obstacles, as far as they are shown
    stages: tuple[PlacedStage, ...]
    ghosts: tuple[Ghost, ...]
    times: Array  # [s], (T,)
    planned: Array  # [m] the reference path, (T, 3)
    tracks: tuple[Track, ...]
    curves: tuple[Curve, ...]


def scene_of(
    shown: Plan | Flight,
    plan: Plan | None = None,
    vehicle: Vehicle | str | None = None,
    poses: int = MAX_POSES,
) -> Scene:
    """Return the scene of a plan, a flight or a batch. Raise SpecError where there is nothing to show.

    Args:
        shown: What is shown.
        plan: What was flown, for its gates and stages.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
        poses: The largest number of rows, of all flights together.
    """
    subject = subject_of(shown, plan, vehicle)
    if isinstance(shown, Plan):
        return _plan_scene(subject, shown)
    if len(shown.times) < 2:
        raise SpecError("the flight has one row, so that nothing moves; show one of two rows or more")
    own = subject.vehicle
    if shown.thrusts.shape[-1] != len(own.rotors):
        rotors = f"{shown.thrusts.shape[-1]} rotors, {own.name} has {len(own.rotors)}"
        raise SpecError(f"vehicle: the flight is one of {rotors}; name the vehicle that flew")
    return _flight_scene(subject, shown, poses)


def plan_fits(plan: Plan, flight: Flight) -> bool:
    """Return True if the set-points of a flight lie on a plan's path."""
    times = flight.times
    if times[-1] > plan.duration + SAME_PATH:
        return False
    off = plan.trajectory.evaluate(times) - flight.setpoint.flat.position
    return bool(np.abs(off).max() <= SAME_PATH)


def _plan_scene(subject: Subject, plan: Plan) -> Scene:
    rate = min(PLAN_RATE, MAX_ROWS / plan.duration)
    planned = reference(plan, subject.vehicle, rate=rate)
    setpoint = planned.setpoint
    track = Track(
        name=subject.vehicle.name,
        position=setpoint.flat.position,
        q_world_body=setpoint.q_world_body,
        thrusts=planned.rotor_thrusts,
        end=plan.duration,
        failed=not plan.certified,
        sentence="as planned",
    )
    speed = np.linalg.norm(setpoint.flat.velocity, axis=-1)
    rates = np.rad2deg(np.linalg.norm(setpoint.omega_body, axis=-1))
    curves = (Curve("speed", "m/s", speed[None]), Curve("body rate", "°/s", rates[None]))
    proof = "not certified" if plan.certificate is None else plan.certificate.why
    facts = (f"planned by {plan.planner}: {plan.duration:.3f} s", proof)
    return _scene(subject, planned, np.arange(len(planned.times)), facts, (track,), curves)


def _flight_scene(subject: Subject, flight: Flight, poses: int) -> Scene:
    flights = (
        [flight[k] for k in range(min(len(flight.vehicles), MAX_FLIGHTS))] if flight.is_batch else [flight]
    )
    rows = shown_rows(len(flight.times), len(flights), poses)
    plan = subject.plan
    tracks = tuple(
        _track(each, plan, subject.vehicle, rows, k if flight.is_batch else None)
        for k, each in enumerate(flights)
    )
    facts = (*_facts(tracks, flight, plan), *_left_out(flight, rows, len(flights)))
    return _scene(subject, flight, rows, facts, tracks, _errors(flight, len(flights), rows))


def _scene(
    subject: Subject,
    followed: Reference | Flight,
    rows: RowIndex,
    facts: tuple[str, ...],
    tracks: tuple[Track, ...],
    curves: tuple[Curve, ...],
) -> Scene:
    """Return the scene of vehicles that follow set-points, at some of their rows."""
    gates, setpoint = subject.gates, followed.setpoint
    path = setpoint.flat.position
    batch = f"{len(tracks)} flights of " if isinstance(followed, Flight) and followed.is_batch else ""
    points = np.concatenate([path, *(gate.outline for gate in gates)])
    return Scene(
        title=f"{subject.name} · {batch}{subject.vehicle.name}",
        facts=facts,
        is_well=not any(track.failed for track in tracks),
        vehicle=subject.vehicle,
        gravity=subject.environment.gravity,
        ground=subject.environment.ground,
        gates=gates,
        surfaces=surfaces_around(subject.pieces, points),
        stages=subject.stages,
        ghosts=_ghosts(subject.stages, followed.times, path, setpoint.q_world_body),
        times=followed.times[rows],
        planned=path[rows],
        tracks=tracks,
        curves=curves,
    )


def shown_rows(rows: int, flights: int, poses: int = MAX_POSES) -> RowIndex:
    """Return the indices of the rows that are shown of flights of `rows` rows: every k-th and the last."""
    stride = ceil(rows / min(MAX_ROWS, poses // flights))
    return np.unique(np.append(np.arange(0, rows, stride), rows - 1))


def _track(flight: Flight, plan: Plan | None, vehicle: Vehicle, rows: RowIndex, number: int | None) -> Track:
    """Return the track of a flight with its score's sentence; `number` is its place in a batch."""
    outcome, sentence = flight.outcome, flight.sentences[0]
    if plan is not None:
        judged = score(flight, plan, vehicle)
        outcome, sentence = judged.outcome, judged.sentence
    kept = np.minimum(rows, len(flight.times) - 1)  # one that diverged stays where it ended
    return Track(
        name=flight.vehicles[0] if number is None else f"{number} · {flight.vehicles[0]}",
        position=flight.position[kept],
        q_world_body=flight.q_world_body[kept],
        thrusts=flight.thrusts[kept],
        end=float(flight.ends),
        failed=not outcome.is_success,
        sentence=sentence,
    )


def _facts(tracks: Sequence[Track], flight: Flight, plan: Plan | None) -> tuple[str, ...]:
    planned = [] if plan is None else [f"planned by {plan.planner}: {plan.duration:.3f} s"]
    if plan is not None and plan.certificate is not None:
        planned.append("certified" if plan.certified else plan.certificate.why)
    failed = [track for track in tracks if track.failed]
    went = tracks[0].sentence
    if len(tracks) > 1:
        worst = f"position error at most {length(float(flight.position_error[: len(tracks)].max()))}"
        some = f"{len(failed)} of {len(tracks)} flights failed"
        went = f"{some if failed else f'all {len(tracks)} flights went well'}, {worst}"
    return (went, ", ".join(planned)) if planned else (went,)


def _left_out(flight: Flight, rows: RowIndex, flights: int) -> Iterator[str]:
    """Yield a line for each part of the flights that the scene leaves out."""
    stride = int(rows[1] - rows[0])
    rate = 1.0 / float(np.median(np.diff(flight.times)))
    if stride > 1:
        yield f"shown at {rate / stride:.4g} rows a second of {rate:.4g}, errors the largest between them"
    if flights < len(flight.vehicles):
        yield f"the first {flights} of {len(flight.vehicles)} flights"


def _errors(flight: Flight, flights: int, rows: RowIndex) -> tuple[Curve, ...]:
    """Return the tracking errors; each row shows the largest error up to the next row shown."""
    position, attitude = (
        np.maximum.reduceat(np.atleast_2d(error)[:flights], rows, axis=-1)
        for error in (flight.position_error, flight.attitude_error)
    )
    return (Curve("position error", "m", position), Curve("attitude error", "°", np.rad2deg(attitude)))


def _ghosts(
    stages: Sequence[PlacedStage], times: Array, position: Array, q_world_body: Array
) -> tuple[Ghost, ...]:
    """Return the planned vehicle at its stages; if they are few, at equal steps of time between them too."""
    instants = [(stage.name, stage.time) for stage in stages if stage.time <= times[-1]]
    if len(instants) < FEW_STAGES:
        steps = np.linspace(times[0], times[-1], GHOSTS + 1).tolist()[1:-1]
        apart = 0.5 * (steps[1] - steps[0])
        instants += [("", t) for t in steps if all(abs(t - known) > apart for _, known in instants)]
    rows = np.searchsorted(times, [time - 1e-9 for _, time in instants]).clip(0, len(times) - 1)
    return tuple(
        Ghost(name, position[k], q_world_body[k])
        for (name, _), k in zip(instants, rows.tolist(), strict=True)
    )
