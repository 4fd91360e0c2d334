"""The candidates, each a pair of a stage with several slots and one of its slots, and their compatibility."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.branch_and_bound.null_space import NullSpace, ReducedBounds, in_units

FEASIBILITY_TOLERANCE = 1e-9  # on rows of unit norm, in units of the solution's minimum norm


@dataclass(frozen=True, eq=False)
class CandidateBounds:
    """The bounds of each candidate, on rows of unit norm."""

    lower: Array  # (k, P)
    upper: Array  # (k, P)
    possible: Mask  # (P,) False where a candidate contradicts constant rows or a fixed stage

    def in_units(self, unit: float) -> CandidateBounds:
        """Return the bounds for y in units of `unit`.

        Candidates that contradict the root's bounds are marked as not possible.
        """
        lower = in_units(self.lower, unit)
        upper = in_units(self.upper, unit)
        consistent = np.all(lower <= upper + FEASIBILITY_TOLERANCE, axis=0)
        return CandidateBounds(lower, upper, self.possible & consistent)


class Candidates:
    """Every slot of every stage that has several: P candidates of k rows each, sorted by stage.

    The candidates of one stage are a group, of which exactly one is chosen. They depend only on the matrices
    and on the stages' rows; `bounds` adds the bounds. Candidates of stages with fewer rows than others are
    padded with the all-zero row.
    """

    def __init__(self, program: AssignmentProgram, null_space: NullSpace) -> None:
        """`null_space` contains all rows of the stages that have several slots."""
        self.free_stages = tuple(i for i, stage in enumerate(program.stages) if len(stage.slots) > 1)
        stages = [program.stages[i] for i in self.free_stages]
        counts = [len(stage.slots) for stage in stages]
        self.stage = np.repeat(np.array(self.free_stages, dtype=np.intp), counts)
        self.slot = np.array([slot for stage in stages for slot in stage.slots], dtype=np.intp)
        self.group = np.repeat(np.arange(len(stages)), counts)  # the index of the stage among free_stages
        self._group_starts = np.cumsum([0, *counts])
        self.compatible = _compatible(
            program, self.stage, self.slot, self.stage[:, None], self.slot[:, None]
        )  # (P, P)
        self.widths = np.array([stage.rows.shape[1] for stage in stages], dtype=np.intp)  # rows, by group
        place = np.full(len(program.rows), null_space.zero_row)
        place[null_space.ranges] = np.arange(len(null_space.ranges))
        rows = self._padded([place[stage.rows] for stage in stages], null_space.zero_row)
        self.rows = rows.astype(np.intp)  # (k, P) of the null space

    def bounds(
        self, program: AssignmentProgram, null_space: NullSpace, root: ReducedBounds
    ) -> CandidateBounds:
        """Return the candidates' bounds for the program's stages, intersected with the root's."""
        lower = self._padded([stage.lower for stage in program.stages if len(stage.slots) > 1], -inf)
        upper = self._padded([stage.upper for stage in program.stages if len(stage.slots) > 1], inf)
        lower = np.maximum(null_space.normalized(lower, root.row_offset, self.rows), root.lower[self.rows])
        upper = np.minimum(null_space.normalized(upper, root.row_offset, self.rows), root.upper[self.rows])
        constant = null_space.constant[self.rows]
        slack = root.slack[self.rows]
        possible = np.all(~constant | (lower <= slack) & (upper >= -slack), axis=0)
        for i, stage in enumerate(program.stages):
            if len(stage.slots) == 1:
                possible &= _compatible(program, self.stage, self.slot, i, stage.slots[0])
        return CandidateBounds(np.where(constant, -inf, lower), np.where(constant, inf, upper), possible)

    def _padded(self, blocks: Sequence[Array | Indices], filler: float) -> Array:
        """Return the groups' blocks (slots, rows) side by side, padded with `filler`, (k, P)."""
        padded = np.full((int(self.widths.max(initial=0)), len(self.stage)), filler)
        for block, (start, end) in zip(blocks, pairwise(self._group_starts), strict=True):
            padded[: block.shape[1], start:end] = block.T
        return padded

    def min_norm(self, bounds: CandidateBounds) -> float:
        """Return a lower bound of |y|.

        All candidates of some group violate a row at y = 0 by at least this value.
        """
        violation = np.maximum(bounds.lower, -bounds.upper).max(axis=0, initial=0.0)
        norms = [
            violation[start:end][bounds.possible[start:end]].min(initial=inf)
            for start, end in pairwise(self._group_starts)
        ]
        return max((float(norm) for norm in norms if norm < inf), default=0.0)

    def slots_with(self, program: AssignmentProgram, chosen: Sequence[int]) -> tuple[int, ...]:
        """Return the slot of each stage of the program, given one chosen candidate of each group."""
        slots = [stage.slots[0] for stage in program.stages]
        for candidate in chosen:
            slots[self.stage[candidate]] = int(self.slot[candidate])
        return tuple(slots)

    def compatible_with(self, chosen: Sequence[int], excluded: Sequence[int] = ()) -> Mask:
        """Return the candidates that are compatible with all `chosen` and not `excluded`, (P,)."""
        joining: Mask = self.compatible[chosen[0]]
        for candidate in chosen[1:]:
            joining = joining & self.compatible[candidate]
        if excluded:
            joining = joining.copy()
            joining[list(excluded)] = False
        return joining


def _compatible(
    program: AssignmentProgram,
    stage: Indices,
    slot: Indices,
    other_stage: Indices | int,
    other_slot: Indices | int,
) -> Mask:
    """Tell which stages and slots are compatible with others: another stage, another slot, in order."""
    result: Mask = (stage != other_stage) & (slot != other_slot)
    if program.precedence:
        result &= (slot < other_slot) | ~program.precedes[stage, other_stage]
        result &= (slot > other_slot) | ~program.precedes[other_stage, stage]
    return result
