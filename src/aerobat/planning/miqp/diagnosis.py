"""Diagnosis of an infeasible problem: a few relaxed programs show the bound that binds, within a second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil, inf
from typing import Any

import numpy as np

from aerobat.errors import Reason, limits_of
from aerobat.limits.box import FIELDS, field_with_value
from aerobat.limits.path_condition import FIELD
from aerobat.optimization import evenly_spread, solver
from aerobat.optimization.deadline import out_of_time, within_time, work
from aerobat.planning.courses import is_placed_in_windows
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.recorder import Attempt
from aerobat.problem.stage import Stage

GROUND = "environment.ground"
MORE_INTERVALS = (1.3, 1.8, 2.5)  # factors tried on the number of intervals, or of stages if larger
DIAGNOSIS_WORK = 1.0  # work limit [s] of all relaxed programs
PROBES = 4  # number of dt at which a relaxed problem is tried


def why_infeasible(formulation: Formulation, attempts: Sequence[Attempt]) -> str:
    """Return a sentence: the vehicle's limit if some program had a solution, else the bounds that bind."""
    tried = [a.duration / formulation.chain.intervals for a in attempts]
    said = f"'{formulation.problem.name}' has no plan at any dt from {min(tried):.3g} to {max(tried):.3g} s"
    solved = [a for a in attempts if a.cost is not None]
    vehicle = formulation.task.vehicle_if_any
    if solved and vehicle is not None:
        best = max(solved, key=lambda a: -inf if a.margin is None else a.margin).outcome
        return Reason(f"{said} that {vehicle.name} can fly: at best, {best}", limits_of(best))
    with within_time(DIAGNOSIS_WORK, work):
        found = list(_binding(formulation, tried))
        binding = [name for name, _ in found]
        if out_of_time() and not binding:
            return f"{said}; which bound binds is not known"
    unanswered = sum(a.status == "unknown" for a in attempts)
    if not binding and unanswered:
        return (
            f"no plan of '{formulation.problem.name}' was found at any dt from {min(tried):.3g} to "
            f"{max(tried):.3g} s; {unanswered} of {len(attempts)} programs were left without an answer, so "
            "that there may be one"
        )
    if not binding:
        return (
            f"{said}: its stages, goal and limits exclude each other, and dropping any one of them does not "
            "help"
        )
    limits = (field for _, field in found)
    return Reason(f"{said}: {' or '.join(binding)} binds; without it the program has a solution", limits)


def leg_without_room(formulation: Formulation, dt: float) -> str | None:
    """Return a sentence on the first leg of a course that has no path, and how many intervals remedy that.

    The stages are spread evenly, as at the start of a search in windows. Return None where all legs have a
    path, where none of the tried numbers of intervals helps, and for sequences that are searched as a whole.
    """
    if not is_placed_in_windows(formulation.sequence):
        return None
    stages, count = formulation.sequence.stages, formulation.chain.intervals
    placed = _placed_when_spread(formulation, dt)
    if placed is None or placed == len(stages):
        return None
    begin = "the start" if placed == 0 else _stage_name(stages, placed - 1)
    said = (
        f"'{formulation.problem.name}' has no plan with {count} intervals: its {len(stages)} stages spread "
        f"evenly over them, the leg from {begin} to {_stage_name(stages, placed)} has no path"
    )
    for more in (ceil(factor * max(count, len(stages))) for factor in MORE_INTERVALS):
        chain = replace(formulation.chain, intervals=more)
        if _placed_when_spread(replace(formulation, chain=chain), dt * count / more) == len(stages):
            return f"{said}; with {more} intervals all of them have one"
    return None


def _placed_when_spread(formulation: Formulation, dt: float) -> int | None:
    """Return the number of leading stages that have a path with evenly spread slots; None without slots."""
    program = formulation.program(dt)
    slots = evenly_spread(program)
    if slots is None:
        return None
    fixed = [stage.restricted([stage.index(slot)]) for stage, slot in zip(program.stages, slots, strict=True)]
    for count in range(1, len(fixed) + 1):
        tried = replace(program, stages=tuple(fixed[:count]), precedence=())
        if solver("builtin").solve(tried).status == "infeasible":
            return count - 1
    return len(fixed)


def _stage_name(stages: Sequence[Stage], number: int) -> str:
    """Return a stage's name, with its lap where there are several."""
    stage = stages[number]
    return f"'{stage.name}'" + (f" of lap {stage.lap}" if stages[-1].lap > 1 else "")


def _binding(formulation: Formulation, dts: Sequence[float]) -> Iterator[tuple[str, str]]:
    """Yield each bound whose removal alone makes some dt feasible, in words and by its field."""
    probes = np.unique(np.quantile(dts, np.linspace(0.0, 1.0, PROBES), method="nearest"))
    for name, field, relaxed in _relaxations(formulation):
        search = solver("builtin")
        if any(search.solve(relaxed.program(float(dt))).x is not None for dt in probes):
            yield name, field


def _relaxations(formulation: Formulation) -> Iterator[tuple[str, str, Formulation]]:
    """Yield each bound in words, its field, and the formulation without the bound."""
    task = formulation.task
    problem, sequence = task.problem, task.stages

    def without(**changes: Any) -> Formulation:
        return replace(formulation, task=replace(task, **changes))

    for derivative in range(formulation.chain.order + 1):
        if np.isfinite(np.concatenate(problem.path_limits.of(derivative))).any():
            name, field = field_with_value(derivative, problem.path_limits), FIELDS[derivative]
            unlimited = replace(problem, limits=problem.limits.without(derivative))
            if derivative == 0:  # the ground is a bound on position, too
                unlimited = replace(unlimited, environment=replace(problem.environment, ground=None))
                is_bounded = np.isfinite(np.concatenate(problem.limits.of(0))).any()
                name, field = (f"the volume between {name}", field) if is_bounded else (GROUND, GROUND)
            yield name, field, without(problem=unlimited)
    for i, stage in enumerate(sequence.stages):
        others = sequence.stages[:i] + sequence.stages[i + 1 :]
        name, fewer = f"stage '{stage.name}'", replace(sequence, stages=others)
        yield f"the {name}", name, without(stages=fewer)
    if sequence.path_constraints:
        unconstrained = replace(sequence, path_constraints=())
        yield "what holds at every interval", FIELD, without(stages=unconstrained)
