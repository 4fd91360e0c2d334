"""Changes that may make a problem feasible: relaxed limits, vehicle, stages or reserve."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from aerobat.planning import Planner
from aerobat.planning.task import max_specific_thrust
from aerobat.problem import CustomManeuver
from aerobat.problem.condition import Condition
from aerobat.problem.limits import DERIVATIVES
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.studies.lens import lens
from aerobat.vehicle import Vehicle

THRUST_FACTOR = 1.5  # factor on the rotors' maximum thrusts


@dataclass(frozen=True, eq=False)
class Request:
    """A problem with its vehicle, if there is one, and its planner."""

    problem: Problem
    vehicle: Vehicle | None
    planner: Planner | None  # None: the planner that suits the problem

    @property
    def reserve(self) -> float:
        """The fraction of the rotors' ranges that the planner keeps in reserve; zero where it keeps none."""
        return float(getattr(self.planner, "reserve", 0.0))

    @property
    def max_specific_thrust(self) -> float:
        """The vehicle's maximum specific thrust, or the one assumed without a vehicle [m/s²]."""
        return max_specific_thrust(self.problem, self.vehicle)


@dataclass(frozen=True)
class Change:
    """A change that may help; its words name a value to be changed in a file or a call."""

    words: str
    apply: Callable[[Request], Request]


def changes(task: Request) -> Iterator[Change]:
    """Yield the changes that are possible for a task."""
    problem, vehicle = task.problem, task.vehicle
    for derivative, name in enumerate(DERIVATIVES):
        if np.isfinite(np.concatenate(problem.limits.of(derivative))).any():
            key = "limits.lower and limits.upper" if derivative == 0 else f"limits.{name}"
            yield Change(f"without {key}", partial(_without_limit, derivative))
    if np.isfinite(problem.limits.max_tilt):
        yield Change("without limits.max_tilt", partial(_with_field, "limits.max_tilt", np.inf))
    if problem.environment.ground is not None:
        yield Change("without environment.ground", partial(_with_field, "environment.ground", None))
    if task.reserve > 0.0:
        yield Change("without reserve", partial(_with_field, "planner.reserve", 0.0))
    if vehicle is not None:
        yield Change(f"with {THRUST_FACTOR:g} times the max_thrust", _with_stronger_rotors)
        if (vehicle.min_thrusts > 0.0).any():
            yield Change("with min_thrust 0", partial(_with_field, "vehicle.rotor_defaults.min_thrust", 0.0))
        if vehicle.lags.any():
            yield Change("with rotors without lag", partial(_with_field, "vehicle.rotor_defaults.lag", 0.0))
        if np.isfinite(vehicle.max_body_rate):
            yield Change("without max_body_rate", partial(_with_field, "vehicle.max_body_rate", np.inf))
    stages = problem.stages(task.max_specific_thrust).stages
    if any(stage.at != "free" for stage in stages):
        yield Change("with its stages at any time", partial(_with_stages, _at_any_time))
    if any(condition.min_thrust > 0.0 for stage in stages for condition in stage.conditions):
        yield Change("with half the thrust that its stages ask", partial(_with_stages, _with_half_the_thrust))


def _with_field(name: str, value: float | None, task: Request) -> Request:
    """Return the request with a field at a value."""
    return lens(name, task).set(task, value)


def _without_limit(derivative: int, task: Request) -> Request:
    return replace(task, problem=replace(task.problem, limits=task.problem.limits.without(derivative)))


def _with_stronger_rotors(task: Request) -> Request:
    assert task.vehicle is not None
    rotors = (replace(rotor, max_thrust=THRUST_FACTOR * rotor.max_thrust) for rotor in task.vehicle.rotors)
    return replace(task, vehicle=replace(task.vehicle, rotors=tuple(rotors)))


def _with_stages(ease: Callable[[Stage], Stage], task: Request) -> Request:
    """Return the request with every stage of its maneuver relaxed, and the maneuver as a list of stages."""
    problem = task.problem
    sequence = problem.maneuver.stage_sequence(problem.gates, task.max_specific_thrust)
    stages = tuple(map(ease, sequence.stages))
    maneuver = CustomManeuver(stages, sequence.path_constraints, sequence.ordered)
    return replace(task, problem=replace(problem, maneuver=maneuver))


def _at_any_time(stage: Stage) -> Stage:
    """Return the stage without a time window or a fixed instant."""
    return replace(stage, at="free", interval_offset=0)


def _with_half_the_thrust(stage: Stage) -> Stage:
    """Return the stage with half of each minimum thrust."""
    attitude = stage.attitude
    return replace(
        stage,
        conditions=tuple(map(_at_half_the_thrust, stage.conditions)),
        min_upright_thrust=None if stage.min_upright_thrust is None else 0.5 * stage.min_upright_thrust,
        attitude=None if attitude is None else replace(attitude, min_thrust=0.5 * attitude.min_thrust),
    )


def _at_half_the_thrust(condition: Condition) -> Condition:
    if condition.min_thrust <= 0.0:
        return condition
    lower = 0.5 * condition.lower if condition.lower > 0.0 else condition.lower
    upper = 0.5 * condition.upper if condition.upper < 0.0 else condition.upper
    return replace(condition, lower=lower, upper=upper)
