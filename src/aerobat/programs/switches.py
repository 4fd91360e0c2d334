"""An assignment program as solvers with binary variables see it: one binary for each stage and slot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from aerobat.arrays import Array
from aerobat.programs.assignment import AssignmentProgram

StageSlot = tuple[int, int]


@dataclass(frozen=True)
class Switch:
    """A bound that holds while a stage sits in a slot: sign · (A x)[row] <= sign · bound."""

    stage: int
    slot: int
    row: int
    sign: int  # 1: an upper bound, -1: a lower bound
    bound: float


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
