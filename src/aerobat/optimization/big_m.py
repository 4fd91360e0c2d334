"""An assignment program as solvers with binary variables see it: one binary for each stage and slot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerobat.optimization.assignment import AssignmentProgram, unit_rows
from aerobat.optimization.result import AssignmentResult

StageSlot = tuple[int, int]  # (stage, slot), the key of a binary


@dataclass(frozen=True)
class BinaryConstraint:
    """The sum of coefficient · binary is `bound`, or at most that."""

    terms: tuple[tuple[int, StageSlot], ...]  # (coefficient, binary)
    bound: int
    is_equality: bool = False


@dataclass(frozen=True)
class IndicatorConstraint:
    """A bound that a binary switches on: sign · (A x)[row] <= bound while it is 1, root_bound while it is 0.

    Where the root bound is finite, that is row <= root_bound + (bound − root_bound) · binary, the smallest
    big-M there is without further knowledge; where it is infinite, the solver's own indicator constraint.
    """

    binary: StageSlot
    row: int
    sign: int  # 1: an upper bound, -1: a lower bound
    bound: float
    root_bound: float


@dataclass(frozen=True, eq=False)
class ScaledProgram:
    """A program with unit rows and variables of order one, since general solvers' tolerances are absolute."""

    program: AssignmentProgram
    unit: float  # of the variables

    def unscaled(self, claim: AssignmentResult) -> AssignmentResult:
        """Return a claim on the scaled program as one on the program itself."""
        x = None if claim.x is None else self.unit * claim.x
        return replace(claim, x=x, bound=self.unit**2 * claim.bound)


def scaled(program: AssignmentProgram) -> ScaledProgram:
    """Return the program for solvers whose tolerances are absolute."""
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
        gradient=None if program.gradient is None else program.gradient / unit,
        constant=program.constant / unit**2,
    )
    return ScaledProgram(scaled_program, float(unit))


def binaries(program: AssignmentProgram) -> list[StageSlot]:
    """Return the keys of all binaries."""
    return [(i, slot) for i, stage in enumerate(program.stages) for slot in stage.slots]


def binary_constraints(program: AssignmentProgram) -> Iterator[BinaryConstraint]:
    """Yield what makes binaries an assignment: one slot a stage, one stage a slot, stages in order."""
    users: dict[int, list[StageSlot]] = {}
    for i, stage in enumerate(program.stages):
        yield BinaryConstraint(tuple((1, (i, slot)) for slot in stage.slots), 1, is_equality=True)
        for slot in stage.slots:
            users.setdefault(slot, []).append((i, slot))
    for sharing in users.values():
        if len(sharing) > 1:
            yield BinaryConstraint(tuple((1, key) for key in sharing), 1)
    for i, j in program.precedence:
        first = tuple((slot, (i, slot)) for slot in program.stages[i].slots)
        second = tuple((-slot, (j, slot)) for slot in program.stages[j].slots)
        yield BinaryConstraint(first + second, -1)


def indicator_constraints(program: AssignmentProgram) -> Iterator[IndicatorConstraint]:
    """Yield all bounds of stages that are tighter than the root's."""
    lower, upper = (bound.tolist() for bound in program.root_bounds)
    for i, stage in enumerate(program.stages):
        for slot, rows, lows, highs in zip(stage.slots, stage.rows, stage.lower, stage.upper, strict=True):
            for row, low, high in zip(rows.tolist(), lows.tolist(), highs.tolist(), strict=True):
                if high < upper[row]:
                    yield IndicatorConstraint((i, slot), row, 1, high, upper[row])
                if low > lower[row]:
                    yield IndicatorConstraint((i, slot), row, -1, -low, -lower[row])


def chosen_slots(program: AssignmentProgram, values: Mapping[StageSlot, float]) -> tuple[int, ...]:
    """Return the slot of each stage, from the values of the binaries."""
    return tuple(
        max((values[i, slot], slot) for slot in stage.slots)[1] for i, stage in enumerate(program.stages)
    )
