"""Random problems and vehicles as an auditor would make them: case k of a seed is always the same.

    uv run python benchmarks/random_problems.py FOLDER [--count N] [--seed S] [--kinds flip half-flip ...]

writes them as files, for the command line: FOLDER/S-K.toml and FOLDER/S-K-vehicle.toml.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem import (
    Condition,
    CustomManeuver,
    Flip,
    Gate,
    GatePassage,
    HalfFlip,
    Limits,
    Line,
    Maneuver,
    Problem,
    Quantity,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    tilted_gate,
    write_problem,
)
from aerobat.problem.stage import CrossingTime
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, write_vehicle

PRESETS = ("agile-quad", "crazyflie", "hexarotor")
PRESET_FRACTION = 0.4  # of the cases, the others' vehicles are random ones
THRUST_TO_WEIGHT = (1.9, 6.0)
LAG = (0.01, 0.08)  # [s]
DRAG = (0.05, 0.45)  # [1/s] across the thrust, per mass


@dataclass(frozen=True)
class Case:
    """A problem and what shall fly it."""

    problem: Problem
    vehicle: Vehicle
    kind: str


def random_case(seed: int, k: int, kinds: tuple[str, ...] = ()) -> Case:
    """Case `k` of a seed; of one of these kinds, by default any of `MIXED`."""
    rng = np.random.default_rng([seed, k])
    drawn = int(rng.integers(len(MIXED)))  # drawn whatever the kinds are, so that the vehicle stays the same
    vehicle = random_vehicle(rng)
    names = kinds or MIXED
    kind = names[drawn % len(names)]
    while True:
        problem = KINDS[kind](rng, vehicle)
        try:
            limited = _limited(rng, replace(problem, name=f"{kind}-{seed}-{k}"), vehicle)
            vehicle.require_hover(limited.environment.gravity)
            return Case(limited, vehicle, kind)
        except SpecError:  # an end beyond its limits
            continue


def random_vehicle(rng: np.random.Generator) -> Vehicle:
    """A preset, with drag where it has none, or an irregular quad-, hexa- or octorotor."""
    if rng.uniform() < PRESET_FRACTION:
        preset = load_vehicle(str(rng.choice(PRESETS)))
        drag = rng.uniform(*DRAG) * preset.mass * np.array([1.0, 1.0, 0.6])
        return preset if preset.drag_body.any() else replace(preset, drag_body=drag)
    while True:
        try:
            vehicle = _irregular(rng)
            vehicle.require_hover(STANDARD_GRAVITY)
            return vehicle
        except SpecError:  # so skew that it cannot hover
            continue


def _irregular(rng: np.random.Generator) -> Vehicle:
    """Skew arms, a full inertia matrix, centre of mass off the middle; all rotors of one make."""
    count, mass = int(rng.choice([4, 6, 8])), float(np.exp(rng.uniform(np.log(0.1), np.log(4.0))))
    size = 0.17 * mass ** (1 / 3) * rng.uniform(0.8, 1.3)
    strength = rng.uniform(*THRUST_TO_WEIGHT) * mass * STANDARD_GRAVITY / count
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count + rng.normal(0, 0.08, count)
    reach = size * rng.uniform(0.9, 1.1, count)
    places = np.stack([reach * np.cos(angles), reach * np.sin(angles), size * rng.normal(0, 0.04, count)], 1)
    places += size * rng.normal(0, [0.02, 0.02, 0.0])
    inertia = mass * size**2 * np.diag([0.22, 0.22, 0.35]) * rng.uniform(0.7, 1.3)
    skew = 0.04 * inertia[0, 0] * rng.normal(size=(3, 3))
    rotor = Rotor(
        position_body=places[0],
        spin=1,
        min_thrust=float(rng.choice([0.0, 0.02])) * strength,
        max_thrust=strength,
        torque_coefficient=size * rng.uniform(0.05, 0.12),
        lag=rng.uniform(*LAG),
        radius=0.4 * size,
    )
    rotors = tuple(replace(rotor, position_body=p, spin=(-1, 1)[i % 2]) for i, p in enumerate(places))
    lateral = mass * rng.uniform(*DRAG)
    drag = np.array([lateral, lateral, lateral * rng.uniform(0.3, 1.0)])
    return Vehicle("random", mass, inertia + skew + skew.T, rotors, drag)


def flip(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """A flip about any axis through a gate upside down, as often in place as not, start and goal unequal."""
    start, height = 0.7 * rng.normal(size=3), rng.uniform(3.5, 7.0)
    leg = rng.choice([0.0, 1.0]) * rng.uniform(1.5, 6.0) * _level(rng.uniform(-np.pi, np.pi))
    goal = start + leg + [0.0, 0.0, rng.normal(0.0, 0.4)]
    middle = start + rng.uniform(0.3, 0.7) * leg + [*rng.normal(0, 0.3, 2), height]
    heading = rng.uniform(-180.0, 180.0)
    offset = rng.choice([90.0, -90.0, 150.0, rng.uniform(-180.0, 180.0)])
    gate = tilted_gate(middle, np.deg2rad(heading), tilt=np.pi)
    return _problem(start, goal, Flip(axis_deg=float(heading + offset)), gate)


def tilted_flip(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """A flip through a gate at any angle of the turn, passed along the axis: when is free, or not quite."""
    problem = flip(rng, vehicle)
    gate, tilt = problem.gates[0], rng.uniform(70.0, 290.0)
    heading = np.rad2deg(gate.angles[0]) + rng.choice([0.0, 180.0])
    begin = rng.uniform(0.3, 0.6)
    at: CrossingTime = ("free", 0.5, (float(begin), float(begin + 0.2)))[int(rng.integers(3))]
    maneuver = Flip(axis_deg=float(heading), passage=GatePassage(at=at))
    return replace(problem, maneuver=maneuver, gates=(gate.tilted(np.deg2rad(tilt)),))


def half_flip(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """A half-flip through a gate of any tilt, near the way or beside it, in one of three sloped."""
    start, heading = 0.7 * rng.normal(size=3), rng.uniform(-np.pi, np.pi)
    goal = start + rng.uniform(3.0, 14.0) * _level(heading) + [0.0, 0.0, rng.normal(0.0, 0.4)]
    tilt, turn = np.deg2rad(rng.uniform(-90.0, 90.0)), rng.uniform(-0.6, 0.6)
    slope = rng.choice([0.0, 0.0, rng.uniform(-0.35, 0.35)])
    beside = rng.uniform(0.0, 2.0) * np.sin(tilt) * _level(heading + np.pi / 2)
    middle = start + rng.uniform(0.25, 0.7) * (goal - start) + beside + [0.0, 0.0, rng.uniform(0.0, 3.5)]
    gate = tilted_gate(middle, heading + turn, float(slope), tilt)
    return _problem(start, goal, HalfFlip(), gate)


def waypoints(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """Past one to four points, some of them without a component, some with a velocity."""
    tour = _tour(rng, int(rng.integers(3, 7)))
    points = []
    for before, here, after in zip(tour, tour[1:], tour[2:], strict=False):
        position, velocity = here.copy(), np.full(3, np.nan)
        if rng.uniform() < 0.2:
            position[rng.integers(3)] = np.nan
        if rng.uniform() < 0.2:
            velocity = rng.uniform(0.3, 0.8) * (after - before)
        points.append(Waypoint(position=position, velocity=velocity))
    return _problem(tour[0], tour[-1], Waypoints(tuple(points)))


def gate_line(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """Through one to three upright gates that look roughly along the way."""
    tour = _tour(rng, int(rng.integers(3, 6)))
    gates = []
    for i, (before, here, after) in enumerate(zip(tour, tour[1:], tour[2:], strict=False)):
        way = after - before
        heading = np.arctan2(way[1], way[0]) + rng.uniform(-0.5, 0.5)
        gates.append(tilted_gate(here, heading, name=f"gate {i + 1}"))
    return _problem(tour[0], tour[-1], Line(), *gates)


def stages(rng: np.random.Generator, vehicle: Vehicle) -> Problem:
    """Stages spelled out: a point on the way, and a thrust tilted to a side at a time or anywhere."""
    tour = _tour(rng, 3)
    fraction = rng.choice([0.0, rng.uniform(0.3, 0.7)])
    tilt, heading = rng.uniform(0.3, 1.4), rng.uniform(-np.pi, np.pi)
    side = _level(heading)
    thrust = 0.2 * vehicle.max_specific_thrust
    point = tuple(
        Condition(Quantity.POSITION, e, x, x) for e, x in zip(np.eye(3), tour[1].tolist(), strict=True)
    )
    lean = (
        Condition(Quantity.SPECIFIC_THRUST, np.sin(tilt) * side + [0.0, 0.0, np.cos(tilt)], lower=thrust),
        Condition(Quantity.SPECIFIC_THRUST, np.cos(tilt) * side - [0.0, 0.0, np.sin(tilt)], 0.0, 0.0),
    )
    upright = (Condition(Quantity.SPECIFIC_THRUST, np.array([0.0, 0.0, 1.0]), lower=0.0),)
    always = upright if rng.uniform() < 0.5 else ()
    course = (Stage("point", point, at=float(fraction) or "free"), Stage("lean", lean))
    return _problem(tour[0], tour[2], CustomManeuver(course, always, ordered=not fraction))


KINDS: dict[str, Callable[[np.random.Generator, Vehicle], Problem]] = {
    "flip": flip,
    "half-flip": half_flip,
    "waypoints": waypoints,
    "line": gate_line,
    "stages": stages,
    "tilted-flip": tilted_flip,
}
MIXED = ("flip", "half-flip", "waypoints", "line", "stages")  # where no kind is asked for


def _problem(start: Array, goal: Array, maneuver: Maneuver, *gates: Gate) -> Problem:
    return Problem(name="random", start=at_rest(start), goal=at_rest(goal), maneuver=maneuver, gates=gates)


def _tour(rng: np.random.Generator, count: int) -> Array:
    """Points 1 to 5 m apart that seldom double back."""
    heading, points = rng.uniform(-np.pi, np.pi), [0.7 * rng.normal(size=3)]
    for _ in range(count - 1):
        heading += rng.normal(0.0, 0.9)
        points.append(points[-1] + rng.uniform(1.0, 5.0) * _level(heading) + [0.0, 0.0, rng.normal(0.0, 0.7)])
    return np.array(points)


def _level(heading: float) -> Array:
    return np.array([np.cos(heading), np.sin(heading), 0.0])


def _limited(rng: np.random.Generator, problem: Problem, vehicle: Vehicle) -> Problem:
    """The problem with a heading, and sometimes limits, a room, ground and wind."""
    ends = np.array([problem.start.position, problem.goal.position, *(g.position for g in problem.gates)])
    if isinstance(problem.maneuver, Waypoints):
        passed = np.array([w.position for w in problem.maneuver.waypoints])
        ends = np.concatenate([ends, np.where(np.isnan(passed), ends[0], passed)])
    limits = Limits()
    if rng.uniform() < 0.5:
        limits = replace(limits, velocity=rng.uniform(6.0, 14.0))
    if rng.uniform() < 0.25:
        acceleration = STANDARD_GRAVITY + rng.uniform(0.6, 1.2) * vehicle.max_specific_thrust
        limits = replace(limits, acceleration=acceleration)
    if rng.uniform() < 0.2:
        room = rng.uniform([1.0, 1.0, 1.0], [4.0, 4.0, 4.0])
        limits = replace(limits, lower=ends.min(axis=0) - room, upper=ends.max(axis=0) + room)
    ground = float(ends[:, 2].min() - rng.uniform(0.2, 1.5)) if rng.uniform() < 0.25 else None
    wind = rng.normal(0.0, [1.5, 1.5, 0.3]) if rng.uniform() < 0.15 else np.zeros(3)
    heading = rng.choice([0.0, rng.uniform(-np.pi, np.pi)])
    environment = Environment(wind=wind, ground=ground)
    return replace(problem, limits=limits, environment=environment, heading=float(heading))


def write_case(case: Case, folder: Path, stem: str) -> str:
    """Write a case's two files and return the command that plans it."""
    folder.mkdir(parents=True, exist_ok=True)
    problem, vehicle = folder / f"{stem}.toml", folder / f"{stem}-vehicle.toml"
    write_problem(case.problem, problem)
    write_vehicle(case.vehicle, vehicle)
    return f"aerobat plan {problem} --vehicle {vehicle}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=10, help="cases (10)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--kinds", nargs="*", default=[], choices=list(KINDS), help="of these kinds only")
    options = parser.parse_args()
    for k in range(options.count):
        case = random_case(options.seed, k, tuple(options.kinds))
        print(write_case(case, options.folder, f"{options.seed}-{k}"))


if __name__ == "__main__":
    main()
