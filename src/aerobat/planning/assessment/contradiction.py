"""Infeasibility proofs in milliseconds: stages whose conditions and the limits exclude each other.

Conditions on position, velocity and acceleration are linear, as are the limits per axis, so that a linear
program decides. Of attitudes only the tilt is tested, and of rotor limits only their sum at the ends: a
problem without a contradiction may still have no plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import force_balance, reference_of
from aerobat.limits.box import FIELDS, field_with_value
from aerobat.optimization import AssignmentProgram, solver
from aerobat.problem.condition import Condition, LinearBound, Quantity
from aerobat.problem.end_state import EndState
from aerobat.problem.limits import Limits
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.states import FlatState
from aerobat.vehicle import Vehicle

STAGE_DERIVATIVES = 3  # number of derivatives that stages constrain: position, velocity, acceleration
ROUNDING = 1e-9  # excess of tilt [rad], or of thrust relative to its range, that is rounding
LINEAR = (Quantity.POSITION, Quantity.VELOCITY, Quantity.ACCELERATION)


@dataclass(frozen=True)
class Contradiction:
    """A stage whose conditions and the limits exclude each other at any time."""

    stage: str  # or the end, start or goal
    limits: tuple[str, ...]  # fields of the problem; removing any one of them resolves the contradiction
    sentence: str


def contradiction(problem: Problem, vehicle: Vehicle) -> Contradiction | None:
    """Return the contradiction of the first stage that has one, or None, which proves nothing.

    A contradiction means that no instant within the limits has the position, velocity, acceleration and tilt
    that the stage asks. Start and goal contradict the vehicle if they ask a tilt beyond the limit, or a
    thrust which the rotors together cannot give. Raises SpecError for gates that do not suit the maneuver.
    """
    for end, state in problem.ends.items():
        if state.acceleration.any() and not state.leaves_attitude_free:
            found = _beyond_vehicle(end, state, problem, vehicle)
            if found is not None:
                return found
    balance = force_balance(problem.environment, vehicle)
    for stage in problem.stages(vehicle.max_specific_thrust, vehicle.body_radius).stages:
        bounds = [c.bound(balance) for c in _linear(stage)]
        if bounds and not is_possible(bounds, problem.path_limits):
            return _contradiction(stage, bounds, problem.path_limits)
        if stage.attitude is not None:
            tilt, tolerance = _tilt(stage.attitude.up), stage.attitude.tolerance
            if tilt - tolerance > problem.limits.max_tilt + ROUNDING:
                sentence = _tilt_sentence(stage.name, tilt, tolerance, problem.limits.max_tilt)
                return Contradiction(stage.name, ("limits.max_tilt",), sentence)
    return None


def _beyond_vehicle(end: str, state: EndState, problem: Problem, vehicle: Vehicle) -> Contradiction | None:
    """Return the contradiction of an end whose thrust the rotors cannot give, or whose tilt is too large."""
    there = FlatState(*state.derivatives(5)[:, None])
    at_end = reference_of([0.0], there, vehicle, problem.environment).setpoint
    thrust, most_tilt = float(at_end.wrench.thrust[0]), problem.limits.max_tilt
    tilt = _tilt(so3.thrust_axis(at_end.q_world_body[0]))
    if tilt > most_tilt + ROUNDING:
        sentence = (
            f"{end}.acceleration asks {math.degrees(tilt):.3g}° of tilt, more than limits.max_tilt "
            f"({math.degrees(most_tilt):.3g}°) allows; ask less, or widen that"
        )
        return Contradiction(end, ("limits.max_tilt", f"{end}.acceleration"), sentence)
    least, most = float(vehicle.min_thrusts.sum()), float(vehicle.max_thrusts.sum())
    rounding = ROUNDING * (most - least)
    if least - rounding <= thrust <= most + rounding:
        return None
    sentence = (
        f"{end}.acceleration asks {thrust:.3g} N of thrust, and the rotors of {vehicle.name} give "
        f"{least:.3g} to {most:.3g} N together; ask {'less' if thrust > most else 'more'} there"
    )
    return Contradiction(end, (f"{end}.acceleration",), sentence)


def _tilt(thrust_axis: Array) -> float:
    """Return the tilt [rad] of a thrust axis, a unit vector in the world (3,)."""
    return float(np.arccos(np.clip(thrust_axis[2], -1.0, 1.0)))


def _tilt_sentence(stage: str, tilt: float, tolerance: float, most: float) -> str:
    """Return the sentence about a stage whose tilt, less its tolerance, exceeds the largest tilt [rad]."""
    asked, spared, limit = np.degrees((tilt, tolerance, most)).tolist()
    within = f", at least {asked - spared:.3g}° within its tolerance," if spared > 0.0 else ","
    # a limit at the edge of the tolerance leaves a plan no room: both remedies leave the whole of it
    remedy = f"set limits.max_tilt to {math.ceil(10.0 * asked - ROUNDING) / 10.0:g}° or more"
    return (
        f"the stage '{stage}' asks {asked:.3g}° of tilt{within} more than limits.max_tilt ({limit:.3g}°) "
        f"allows at whatever time; {remedy}, or ask {math.floor(10.0 * limit + ROUNDING) / 10.0:g}° at most"
    )


def _linear(stage: Stage) -> list[Condition]:
    """Return a stage's conditions without those on thrust; its ball is replaced by the cube around it."""
    others = (c for c in stage.conditions if c.quantity is not Quantity.POSITION)
    return [c for c in (*stage.where, *others) if c.quantity in LINEAR]


def _contradiction(stage: Stage, bounds: list[LinearBound], limits: Limits) -> Contradiction:
    if not is_possible(bounds, Limits()):
        sentence = (
            f"the conditions of the stage '{stage.name}' exclude each other; change or drop one of them"
        )
        return Contradiction(stage.name, (), sentence)
    binding = [k for k in range(STAGE_DERIVATIVES) if is_possible(bounds, limits.without(k))]
    bound = " or ".join(field_with_value(k, limits) for k in binding)
    return Contradiction(
        stage.name,
        tuple(FIELDS[k] for k in binding),
        f"what the stage '{stage.name}' asks lies outside {bound or 'the limits together'} at whatever time; "
        "ask less of it or widen them",
    )


def is_possible(bounds: list[LinearBound], limits: Limits) -> bool:
    """Return False where no position, velocity and acceleration within the limits satisfy the bounds."""
    boxes = [limits.of(derivative) for derivative in range(STAGE_DERIVATIVES)]
    lower, upper = (np.concatenate([box[side] for box in boxes]) for side in (0, 1))
    bounded = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
    rows = [bound.weights.ravel() for bound in bounds]
    instant = AssignmentProgram(
        equality=np.zeros((0, 3 * STAGE_DERIVATIVES)),
        target=np.zeros(0),
        rows=np.array([*rows, *np.eye(3 * STAGE_DERIVATIVES)[bounded]]),
        lower=np.array([*(bound.limits[0] for bound in bounds), *lower[bounded]]),
        upper=np.array([*(bound.limits[1] for bound in bounds), *upper[bounded]]),
    )
    return solver("builtin").solve(instant).status != "infeasible"
