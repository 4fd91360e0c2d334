"""Random problems of which many have no plan: those of `random_problems.py` under three to five hardships.

Weak, idle, slow or draggy vehicles, small limits, tight rooms, much thrust asked, gates next to the ends,
narrow and contradicting windows. Case k of a seed is always the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.problem import CustomManeuver, Flip, HalfFlip, Line, Waypoints, at_rest
from aerobat.states import STANDARD_GRAVITY
from random_problems import KINDS, Case, random_case

HARDSHIPS_EACH = (3, 6)  # from so many to fewer than that
FLIPS_FRACTION = 0.5  # of the cases; the others are of any kind


def hard_case(seed: int, k: int) -> Case:
    """Case `k` of a seed: one of any kind, three to five hardships on it."""
    rng = np.random.default_rng([seed, k, 3])
    kinds = ("flip", "half-flip", "tilted-flip") if rng.uniform() < FLIPS_FRACTION else tuple(KINDS)
    easy = random_case(seed, k, kinds)
    while True:
        names = rng.choice(list(HARDSHIPS), size=rng.integers(*HARDSHIPS_EACH), replace=False).tolist()
        case = easy
        try:
            for name in names:
                case = HARDSHIPS[name](rng, case)
            case.vehicle.require_hover(case.problem.environment.gravity)
        except SpecError:  # an end beyond its limits, or a vehicle that cannot hover
            continue
        problem = replace(case.problem, name=f"hard-{seed}-{k}", description=", ".join(names))
        return Case(problem, case.vehicle, easy.kind)


def weak(rng: np.random.Generator, case: Case) -> Case:
    """Thrust-to-weight of 1.1 to 2."""
    factor = STANDARD_GRAVITY * rng.uniform(1.1, 2.0) / case.vehicle.max_specific_thrust
    return _with_rotors(case, factor, None, 1.0)


def idle(rng: np.random.Generator, case: Case) -> Case:
    """Rotors that cannot give less than a fifth to four fifths of what hovers."""
    vehicle = case.vehicle
    hover = vehicle.mass * STANDARD_GRAVITY / len(vehicle.rotors)
    return _with_rotors(case, 1.0, rng.uniform(0.2, 0.8) * hover, 1.0)


def slow(rng: np.random.Generator, case: Case) -> Case:
    """Rotors two to eight times as slow."""
    return _with_rotors(case, 1.0, None, rng.uniform(2.0, 8.0))


def draggy(rng: np.random.Generator, case: Case) -> Case:
    """Drag of 0.8 to 3 /s per mass across the thrust."""
    lateral = case.vehicle.mass * rng.uniform(0.8, 3.0)
    drag = lateral * np.array([1.0, 1.0, rng.uniform(0.3, 1.0)])
    return replace(case, vehicle=replace(case.vehicle, drag_body=drag))


def turning_slowly(rng: np.random.Generator, case: Case) -> Case:
    """Body rates of 1.5 to 6 rad/s at most."""
    return replace(case, vehicle=replace(case.vehicle, max_body_rate=rng.uniform(1.5, 6.0)))


def small_limits(rng: np.random.Generator, case: Case) -> Case:
    """A small velocity, acceleration or jerk."""
    limits = case.problem.limits
    name = rng.choice(["velocity", "acceleration", "jerk"])
    if name == "velocity":
        limits = replace(limits, velocity=rng.uniform(0.6, 3.0))
    elif name == "acceleration":
        limits = replace(limits, acceleration=rng.uniform(2.0, 14.0))
    else:
        limits = replace(limits, jerk=rng.uniform(5.0, 60.0))
    return replace(case, problem=replace(case.problem, limits=limits))


def tight_room(rng: np.random.Generator, case: Case) -> Case:
    """Walls 2 cm to 60 cm from what is passed."""
    problem = case.problem
    points = np.array([problem.start.position, problem.goal.position, *(g.position for g in problem.gates)])
    if isinstance(problem.maneuver, Waypoints):
        passed = np.array([w.position for w in problem.maneuver.waypoints])
        points = np.concatenate([points, np.where(np.isnan(passed), points[0], passed)])
    room = rng.uniform(0.02, 0.6, 3)
    lower, upper = points.min(axis=0) - room, points.max(axis=0) + room
    limits = replace(problem.limits, lower=lower, upper=upper)
    return replace(case, problem=replace(problem, limits=limits))


def much_asked(rng: np.random.Generator, case: Case) -> Case:
    """Thrusts of flips and half-flips of 60 to 100 % of what there is."""
    maneuver = case.problem.maneuver
    asked = rng.uniform(0.6, 1.0) * case.vehicle.max_specific_thrust
    if isinstance(maneuver, Flip):
        maneuver = replace(maneuver, min_lateral_thrust=asked, min_inverted_thrust=asked)
    elif isinstance(maneuver, HalfFlip):
        gate = case.problem.gates[0]
        maneuver = replace(maneuver, min_lateral_thrust=asked * float(np.hypot(*gate.up[:2])))
    else:
        raise SpecError("asks for no thrust")
    return replace(case, problem=replace(case.problem, maneuver=maneuver))


def short_way(rng: np.random.Generator, case: Case) -> Case:
    """Start and goal within a metre of the first gate, and a small opening."""
    problem = case.problem
    if not problem.gates:
        raise SpecError("has no gates")
    gate = replace(problem.gates[0], width=0.3, height=0.15)
    start, goal = (at_rest(gate.position + rng.uniform(0.1, 1.0) * _direction(rng)) for _ in range(2))
    problem = replace(problem, start=start, goal=goal, gates=(gate, *problem.gates[1:]))
    return replace(case, problem=problem)


def narrow_windows(rng: np.random.Generator, case: Case) -> Case:
    """Passages at one early or late moment; stages in windows that may contradict their order."""
    maneuver = case.problem.maneuver
    begin = float(rng.choice([rng.uniform(0.05, 0.2), rng.uniform(0.75, 0.9)]))
    window = (begin, begin + 0.06)
    if isinstance(maneuver, Flip | HalfFlip | Line):
        maneuver = replace(maneuver, passage=replace(maneuver.passage, at=window))
    elif isinstance(maneuver, CustomManeuver):
        first, *others = maneuver.stages
        maneuver = replace(maneuver, stages=(replace(first, at=window), *others), ordered=True)
    else:
        raise SpecError("is passed whenever it is")
    return replace(case, problem=replace(case.problem, maneuver=maneuver))


HARDSHIPS: dict[str, Callable[[np.random.Generator, Case], Case]] = {
    "weak": weak,
    "idle": idle,
    "slow": slow,
    "draggy": draggy,
    "turning slowly": turning_slowly,
    "small limits": small_limits,
    "tight room": tight_room,
    "much asked": much_asked,
    "short way": short_way,
    "narrow windows": narrow_windows,
}


def _with_rotors(case: Case, stronger: float, min_thrust: float | None, slower: float) -> Case:
    """The case with other rotors; `min_thrust` [N] as it is where None."""
    rotors = tuple(
        replace(
            rotor,
            max_thrust=stronger * rotor.max_thrust,
            min_thrust=rotor.min_thrust if min_thrust is None else min_thrust,
            lag=slower * rotor.lag,
        )
        for rotor in case.vehicle.rotors
    )
    return replace(case, vehicle=replace(case.vehicle, rotors=rotors))


def _direction(rng: np.random.Generator) -> Array:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))
