"""Advice where a vehicle can fly no plan that was found: each change is tried, and told with what it does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.nonlinear import has_casadi
from aerobat.problem.problem import DERIVATIVES, Problem
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from aerobat.planning.miqp.miqp import Miqp

STRONGER = 1.5  # times the rotors' largest thrusts


def advice(asked: Miqp, problem: Problem, vehicle: Vehicle) -> str:
    """The other ways to plan that found nothing, and the changes with which it is planned, if any is.

    Args:
        asked: The planner that found none, a rescue included.
        problem: What was planned.
        vehicle: What should fly it.
    """
    others = "other intervals, orders and free-knots find none"
    if not has_casadi():
        others = "other intervals and orders find none; free-knots was not tried, it needs the extra casadi"
    changes = list(_changes(problem, vehicle))
    helpful = [words for words, task, flown in changes if _is_planned(asked, task, flown)]
    if helpful:
        return f"{others}; it is planned {' or '.join(helpful)}"
    return f"{others}, nor {' or '.join(words for words, _, _ in changes)}"


def _changes(problem: Problem, vehicle: Vehicle) -> Iterator[tuple[str, Problem, Vehicle]]:
    """Changes that may help, each in words."""
    rotors = tuple(replace(rotor, max_thrust=STRONGER * rotor.max_thrust) for rotor in vehicle.rotors)
    yield f"with {STRONGER:g} times the max_thrust", problem, replace(vehicle, rotors=rotors)
    if vehicle.lags.any():
        rotors = tuple(replace(rotor, lag=0.0) for rotor in vehicle.rotors)
        yield "with rotors without lag", problem, replace(vehicle, rotors=rotors)
    if np.isfinite(vehicle.max_body_rate):
        yield "without max_body_rate", problem, replace(vehicle, max_body_rate=np.inf)
    for derivative, name in enumerate(DERIVATIVES):
        if np.isfinite(problem.limits.of(derivative)).any():
            key = "limits.lower and limits.upper" if derivative == 0 else f"limits.{name}"
            yield f"without {key}", replace(problem, limits=problem.limits.without(derivative)), vehicle
    if problem.environment.ground is not None:
        environment = replace(problem.environment, ground=None)
        yield "without environment.ground", replace(problem, environment=environment), vehicle


def _is_planned(asked: Miqp, problem: Problem, vehicle: Vehicle) -> bool:
    """True if the same planner finds a certified plan after a change."""
    try:
        return replace(asked, rescue=False).plan(problem, vehicle).certified
    except (Infeasible, SpecError):
        return False
