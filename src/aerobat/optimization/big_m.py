"""An assignment program as solvers with binary variables see it: one binary for each stage and slot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram, AssignmentResult

StageSlot = tuple[int, int]


@dataclass(frozen=True)
class Switch:
    """A bound that holds while a stage sits in a slot: sign · (A x)[row] <= sign · bound."""

    stage: int
    slot: int
    row: int
    sign: int  # 1: an upper bound, -1: a lower bound
    bound: float


@dataclass(frozen=True, eq=False)
class Conditioned:
    """A program with unit rows and variables of order one, since general solvers' tolerances are absolute."""

    program: AssignmentProgram
    unit: float  # of the variables

    def restored(self, claim: AssignmentResult) -> AssignmentResult:
        """What a claim says of the program that was conditioned."""
        x = None if claim.x is None else self.unit * claim.x
        return replace(claim, x=x, bound=self.unit**2 * claim.bound)


def conditioned(program: AssignmentProgram) -> Conditioned:
    """The program for solvers whose tolerances are absolute."""
    lengths, rows = _unit_rows(program.rows)
    equality_lengths, equality = _unit_rows(program.equality)
    target = program.target / equality_lengths
    lower, upper = (bound / lengths for bound in standing_bounds(program))
    pinned = lower == upper
    known = np.concatenate([target, lower[pinned]])
    least = np.linalg.lstsq(np.concatenate([equality, rows[pinned]]), known)[0]
    unit = np.abs(least).max(initial=0.0) or np.maximum(lower, -upper).max(initial=0.0) or 1.0
    stages = (
        replace(s, lower=s.lower / (unit * lengths[s.rows]), upper=s.upper / (unit * lengths[s.rows]))
        for s in program.stages
    )
    scaled = replace(
        program,
        rows=rows,
        lower=program.lower / (unit * lengths),
        upper=program.upper / (unit * lengths),
        equality=equality,
        target=target / unit,
        stages=tuple(stages),
        gradient=None if program.gradient is None else program.gradient / unit,
        constant=program.constant / unit**2,
    )
    return Conditioned(scaled, float(unit))


def _unit_rows(matrix: Array) -> tuple[Array, Array]:
    """The length of each row, 1 for those that are zero, and the rows divided by it."""
    lengths = np.linalg.norm(matrix, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    return lengths, matrix / lengths[:, None]


def standing_bounds(program: AssignmentProgram) -> tuple[Array, Array]:
    """The range rows' bounds (lower, upper) with the stages of a single slot in place."""
    return program.tightened([stage.slots[0] if len(stage.slots) == 1 else None for stage in program.stages])


def switches(program: AssignmentProgram) -> Iterator[Switch]:
    """All that placements tighten beyond the standing bounds."""
    lower, upper = standing_bounds(program)
    for i, stage in enumerate(program.stages):
        for slot, rows, lows, highs in zip(stage.slots, stage.rows, stage.lower, stage.upper, strict=True):
            for row, low, high in zip(rows.tolist(), lows.tolist(), highs.tolist(), strict=True):
                if high < upper[row]:
                    yield Switch(i, slot, row, 1, high)
                if low > lower[row]:
                    yield Switch(i, slot, row, -1, low)


def slots_taken(program: AssignmentProgram) -> list[list[StageSlot]]:
    """For each slot that several stages may take, who they are."""
    users: dict[int, list[StageSlot]] = {}
    for i, stage in enumerate(program.stages):
        for slot in stage.slots:
            users.setdefault(slot, []).append((i, slot))
    return [sharing for sharing in users.values() if len(sharing) > 1]


def chosen_slots(program: AssignmentProgram, values: Mapping[StageSlot, float]) -> tuple[int, ...]:
    """The slot of each stage, from the values of the binaries."""
    return tuple(
        max((values[i, slot], slot) for slot in stage.slots)[1] for i, stage in enumerate(program.stages)
    )
