"""An assignment program as a mixed-integer program, with one binary for each pair of stage and slot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf
from typing import Any, Protocol

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, unit_rows
from aerobat.optimization.backends import solver
from aerobat.optimization.deadline import count_work
from aerobat.optimization.result import AssignmentResult, verified

StageSlot = tuple[int, int]  # (stage, slot), the key of a binary


class Model(Protocol):
    """A model of a general solver; its variables are added, multiplied and compared as numbers are."""

    def variable(self, is_binary: bool = False) -> Any:
        """Add a binary variable, or a continuous one without bounds."""
        ...

    def total(self, terms: Iterable[Any]) -> Any:
        """Return the sum of expressions."""
        ...

    def add(self, constraint: Any) -> None:
        """Add a constraint."""
        ...

    def add_indicator(self, binary: Any, constraint: Any) -> None:
        """Add a constraint that holds while a binary is 1."""
        ...

    def minimize(self, cost: Any) -> None:
        """Set the cost, a quadratic expression."""
        ...


@dataclass(frozen=True)
class Variables:
    """The variables of a program in a model."""

    x: list[Any]
    binaries: dict[StageSlot, Any]

    def values(self, value: Callable[[Any], float]) -> tuple[Array, tuple[int, ...]]:
        """Return x and the slot of each stage, from the values that a solver gives the variables."""
        rising = sorted((value(binary), slot, stage) for (stage, slot), binary in self.binaries.items())
        chosen = {stage: slot for _, slot, stage in rising}  # the last slot has the largest binary
        return np.array([value(each) for each in self.x]), tuple(chosen[stage] for stage in sorted(chosen))


@dataclass(frozen=True, eq=False)
class ScaledProgram:
    """A program with unit rows and variables of order one, for solvers whose tolerances are absolute."""

    original: AssignmentProgram
    program: AssignmentProgram
    unit: float  # unit of the variables

    def result(self, claim: AssignmentResult) -> AssignmentResult:
        """Return a claim on the scaled program as a verified result on the original one.

        A solution can be verified by its residuals, but infeasibility cannot. Presolve and tolerances of
        general solvers are sometimes wrong (SCIP 10 reports feasible flips as infeasible). So the exact
        search confirms infeasibility. Where it finds a solution, its own result is returned.
        """
        count_work(claim.time)
        x = None if claim.x is None else self.unit * claim.x
        result = verified(self.original, replace(claim, x=x, bound=self.unit**2 * claim.bound))
        if result.status != "infeasible":
            return result
        exact = solver("builtin").solve(self.original)
        return result if exact.x is None else exact


def scaled(program: AssignmentProgram) -> ScaledProgram:
    """Return the program with unit rows and variables of order one."""
    norms, rows = unit_rows(program.rows)
    equality_norms, equality = unit_rows(program.equality)
    target = program.target / equality_norms
    lower, upper = (bound / norms for bound in program.root_bounds)
    fixed = lower == upper
    known = np.concatenate([target, lower[fixed]])
    shortest = np.linalg.lstsq(np.concatenate([equality, rows[fixed]]), known)[0]
    unit = np.abs(shortest).max(initial=0.0) or np.maximum(lower, -upper).max(initial=0.0) or 1.0
    stages = (
        replace(s, lower=s.lower / (unit * norms[s.rows]), upper=s.upper / (unit * norms[s.rows]))
        for s in program.stages
    )
    scaled_program = replace(
        program,
        rows=rows,
        lower=program.lower / (unit * norms),
        upper=program.upper / (unit * norms),
        equality=equality,
        target=target / unit,
        stages=tuple(stages),
    )
    return ScaledProgram(program, scaled_program, float(unit))


def build(model: Model, program: AssignmentProgram) -> Variables:
    """Add a program to an empty model: its rows, its binaries, the bounds that they enable, and its cost."""
    x = [model.variable() for _ in range(program.num_variables)]

    def product(row: Array) -> Any:
        """Return the expression row · x."""
        terms = [weight * each for weight, each in zip(row.tolist(), x, strict=True) if weight]
        return model.total(terms) if terms else 0.0 * x[0]

    for row, value in zip(program.equality, program.target.tolist(), strict=True):
        model.add(product(row) == value)
    for sign, bounds in zip((-1, 1), program.root_bounds, strict=True):
        for row, bound in zip(program.rows, bounds.tolist(), strict=True):
            if abs(bound) < inf:
                model.add(product(sign * row) <= sign * bound)
    binaries = _add_binaries(model, program)
    for key, row, bound, root_bound in _stage_bounds(program):
        if root_bound < inf:  # the smallest big-M without further knowledge
            model.add(product(row) <= root_bound + (bound - root_bound) * binaries[key])
        else:
            model.add_indicator(binaries[key], product(row) <= bound)
    model.minimize(model.total(each * each for each in x))
    return Variables(x, binaries)


def _add_binaries(model: Model, program: AssignmentProgram) -> dict[StageSlot, Any]:
    """Add the binaries: one slot for each stage, at most one stage for each slot, stages in order."""
    stages = program.stages
    keys = ((i, slot) for i, stage in enumerate(stages) for slot in stage.slots)
    binaries = {key: model.variable(is_binary=True) for key in keys}
    users: dict[int, list[Any]] = {}
    for i, stage in enumerate(stages):
        model.add(model.total(binaries[i, slot] for slot in stage.slots) == 1)
        for slot in stage.slots:
            users.setdefault(slot, []).append(binaries[i, slot])
    for sharing in users.values():
        if len(sharing) > 1:
            model.add(model.total(sharing) <= 1)
    for i, j in program.precedence:
        first = [slot * binaries[i, slot] for slot in stages[i].slots]
        second = [-slot * binaries[j, slot] for slot in stages[j].slots]
        model.add(model.total(first + second) <= -1)
    return binaries


def _stage_bounds(program: AssignmentProgram) -> Iterator[tuple[StageSlot, Array, float, float]]:
    """Yield the tightened bounds: row · x <= bound where the binary is 1, <= root_bound where it is 0."""
    lower, upper = (bound.tolist() for bound in program.root_bounds)
    for i, stage in enumerate(program.stages):
        for slot, rows, lows, highs in zip(stage.slots, stage.rows, stage.lower, stage.upper, strict=True):
            for k, low, high in zip(rows.tolist(), lows.tolist(), highs.tolist(), strict=True):
                if high < upper[k]:
                    yield (i, slot), program.rows[k], high, upper[k]
                if low > lower[k]:
                    yield (i, slot), -program.rows[k], -low, -lower[k]
