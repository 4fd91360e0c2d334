"""Advice where no plan was found: each change is tried, and told with what it does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time
from aerobat.optimization.nonlinear import has_casadi
from aerobat.planning.miqp.eased_stages import at_any_time, eased, with_half_the_thrust
from aerobat.problem.problem import DERIVATIVES, Problem
from aerobat.problem.stage import Stage
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from aerobat.planning.miqp.miqp import Miqp

STRONGER = 1.5  # times the rotors' largest thrusts
_is_wanted: ContextVar[bool] = ContextVar("advice", default=True)


@contextmanager
def without_advice() -> Iterator[None]:
    """Let refusals in the block name the bound that binds, and try no change, which takes seconds each."""
    token = _is_wanted.set(False)
    try:
        yield
    finally:
        _is_wanted.reset(token)


@dataclass(frozen=True)
class Task:
    """A problem, the vehicle for it, and how to plan."""

    planner: Miqp
    problem: Problem
    vehicle: Vehicle

    @property
    def is_planned(self) -> bool:
        """True if the planner finds a plan by itself."""
        try:
            replace(self.planner, rescue=False).plan(self.problem, self.vehicle)
        except (Infeasible, SpecError):
            return False
        return True


@dataclass(frozen=True)
class Change:
    """A change that may help, in words, each of which is a value to be changed in a file or a call."""

    words: str
    apply: Callable[[Task], Task]


def advice(asked: Miqp, problem: Problem, vehicle: Vehicle) -> str:
    """The other ways to plan that found nothing, and the changes with which it is planned, if any is.

    Within `without_advice` the former alone. Single changes; where none of them is enough, the fewest of all
    of them together.

    Args:
        asked: The planner that found none, a rescue included.
        problem: What was planned.
        vehicle: What should fly it.
    """
    others = "other intervals, orders and free-knots find none"
    if not has_casadi():
        others = "other intervals and orders find none; free-knots was not tried, it needs the extra casadi"
    if not _is_wanted.get():
        return others
    task = Task(asked, problem, vehicle)
    found = changes(task)
    tried: list[str] = []
    helpful: list[str] = []
    for change in found:
        if out_of_time():
            break
        tried.append(change.words)
        if change.apply(task).is_planned:
            helpful.append(change.words)
    if helpful:
        return f"{others}; it is planned {' or '.join(helpful)}"
    nor = f"{others}, nor {' or '.join(tried)}" if tried else others
    if out_of_time() or len(found) < 2:
        return nor
    together = " and ".join(change.words for change in _fewest(task, found))
    if not together:
        return f"{nor}, nor with all of that together"
    return f"{others}, nor with one change alone; it is planned {together}"


def changes(task: Task) -> list[Change]:
    """Changes that may help: less asked of the path, of the vehicle, of stages."""
    return [*_of_limits(task), *_of_planner(task), *_of_vehicle(task), *_of_stages(task)]


def _of_limits(task: Task) -> Iterator[Change]:
    for derivative, name in enumerate(DERIVATIVES):
        if np.isfinite(np.concatenate(task.problem.limits.of(derivative))).any():
            key = "limits.lower and limits.upper" if derivative == 0 else f"limits.{name}"
            yield Change(f"without {key}", partial(_without_limit, derivative))
    if task.problem.environment.ground is not None:
        yield Change("without environment.ground", _without_ground)


def _without_limit(derivative: int, task: Task) -> Task:
    return _with_problem(task, limits=task.problem.limits.without(derivative))


def _without_ground(task: Task) -> Task:
    return _with_problem(task, environment=replace(task.problem.environment, ground=None))


def _with_problem(task: Task, **changed: Any) -> Task:
    return replace(task, problem=replace(task.problem, **changed))


def _of_planner(task: Task) -> Iterator[Change]:
    if task.planner.reserve > 0.0:
        yield Change("without reserve", _without_reserve)


def _without_reserve(task: Task) -> Task:
    return replace(task, planner=replace(task.planner, reserve=0.0))


def _of_vehicle(task: Task) -> Iterator[Change]:
    vehicle = task.vehicle
    yield Change(f"with {STRONGER:g} times the max_thrust", _with_stronger_rotors)
    if (vehicle.min_thrusts > 0.0).any():
        yield Change("with min_thrust 0", partial(_with_rotors, {"min_thrust": 0.0}))
    if vehicle.lags.any():
        yield Change("with rotors without lag", partial(_with_rotors, {"lag": 0.0}))
    if np.isfinite(vehicle.max_body_rate):
        yield Change("without max_body_rate", _without_rate_limit)


def _with_stronger_rotors(task: Task) -> Task:
    rotors = (replace(rotor, max_thrust=STRONGER * rotor.max_thrust) for rotor in task.vehicle.rotors)
    return replace(task, vehicle=replace(task.vehicle, rotors=tuple(rotors)))


def _with_rotors(changed: Mapping[str, Any], task: Task) -> Task:
    rotors = (replace(rotor, **changed) for rotor in task.vehicle.rotors)
    return replace(task, vehicle=replace(task.vehicle, rotors=tuple(rotors)))


def _without_rate_limit(task: Task) -> Task:
    return replace(task, vehicle=replace(task.vehicle, max_body_rate=np.inf))


def _of_stages(task: Task) -> Iterator[Change]:
    stages = task.problem.stages(task.vehicle.max_specific_thrust).stages
    if any(stage.at != "free" for stage in stages):
        yield Change("with its stages at any time", partial(_with_stages, at_any_time))
    if any(condition.min_thrust > 0.0 for stage in stages for condition in stage.conditions):
        yield Change("with half the thrust that its stages ask", partial(_with_stages, with_half_the_thrust))


def _with_stages(ease: Callable[[Stage], Stage], task: Task) -> Task:
    return replace(task, problem=eased(task.problem, task.vehicle.max_specific_thrust, ease))


def _fewest(task: Task, found: list[Change]) -> list[Change]:
    """The fewest changes that are enough together, none of which can be left out; none if all are too few."""
    if not _all_of(task, found).is_planned:
        return []
    kept = list(found)
    for change in found:
        fewer = [each for each in kept if each is not change]
        if not out_of_time() and _all_of(task, fewer).is_planned:
            kept = fewer
    return kept


def _all_of(task: Task, several: list[Change]) -> Task:
    return reduce(lambda changed, change: change.apply(changed), several, task)
