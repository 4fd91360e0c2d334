"""A program with one stage in one slot, as two halves that share the state at that slot's end alone.

The state's part of the inputs before it, z = Qᵀ x_before with orthonormal Q, is all that the second half sees
of the first. It pays SHARE of |z|², the first half the rest, and a price q makes both want the same z:

    before: |x_before|² − SHARE |z|² + qᵀz          behind: |x_behind|² + SHARE |z|² − qᵀz

Whatever the price, the two minima add up to a lower bound on the whole.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from math import sqrt

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.errors import SpecError
from aerobat.optimization.assignment import (
    AssignmentProgram,
    LinearDynamics,
    SlottedStage,
    row_norms,
)
from aerobat.optimization.branch_and_bound.time_decomposition.halves import Half

SHARE = 0.3  # of the effort that the state takes, paid by the half behind it
CAUSALITY_TOLERANCE = 1e-9  # of a row, for what it may see of earlier inputs beside the state


class Timeline:
    """A program, its stages in order, and the slot of the last input that each of its rows sees."""

    def __init__(self, program: AssignmentProgram, dynamics: LinearDynamics) -> None:
        """Find the slots."""
        self.program = program
        self.dynamics = dynamics
        self.ends = _last_slots(program.rows, dynamics)  # (m,)
        self.goals = _last_slots(program.equality, dynamics)  # (p,)


class Cut:
    """Both halves of a program, cut behind a slot in which one of its stages sits.

    Raises SpecError where rows behind the cut see more of what is before it than the state, and where a
    stage bounds rows beyond the cut.
    """

    def __init__(self, timeline: Timeline, stage: int, slot: int) -> None:
        """Factor the state."""
        self._timeline = timeline
        self._program = timeline.program
        self._stage = stage
        self.slot = slot
        columns = timeline.dynamics.columns
        self._earlier = columns[: slot + 1].ravel()
        self._later = columns[slot + 1 :].ravel()
        basis, triangle = np.linalg.qr(timeline.dynamics.state(slot).T)
        self._basis: Array = basis  # Q, (earlier inputs, r)
        self._triangle: Array = triangle  # R: the state is Rᵀ z

    @property
    def is_early(self) -> bool:
        """True where the half before the cut is the shorter one."""
        return len(self._earlier) < len(self._later)

    @cached_property
    def before(self) -> Half:
        """The stages before the cut, and all rows up to its slot."""
        rows, goals = self._timeline.ends <= self.slot, self._timeline.goals <= self.slot
        spread = 1.0 / sqrt(1.0 - SHARE)
        inputs = np.eye(len(self._earlier)) + (spread - 1.0) * self._basis @ self._basis.T
        program = self._half(
            rows,
            goals,
            self._program.rows[np.ix_(rows, self._earlier)] @ inputs,
            self._program.equality[np.ix_(goals, self._earlier)] @ inputs,
            range(self._stage),
        )
        return Half(program, spread * self._basis.T, 1.0)

    @cached_property
    def behind(self) -> Half:
        """The stages behind the cut, and all rows that see later inputs, or of its slot the state alone."""
        rows, goals = self._timeline.ends > self.slot, self._timeline.goals > self.slot
        if not (
            self._sees_state(self._program.rows[rows]).all()
            and self._sees_state(self._program.equality[goals]).all()
        ):
            raise SpecError(
                "dynamics: rows of later slots must see earlier variables through the state alone"
            )
        at_end = self._timeline.ends == self.slot
        rows[at_end] = self._sees_state(self._program.rows[at_end])
        program = self._half(
            rows,
            goals,
            self._over_state(self._program.rows[rows]),
            self._over_state(self._program.equality[goals]),
            range(self._stage + 1, len(self._program.stages)),
        )
        state = np.zeros((self._basis.shape[1], program.num_variables))
        np.fill_diagonal(state, 1.0 / sqrt(SHARE))
        return Half(program, state, -1.0)

    def price(self, costate: Array) -> Array:
        """The price of z where the state is worth the costate."""
        return self._triangle @ costate

    def costate(self, price: Array) -> Array:
        """Return the costate, the worth of the state, at a price of z: the inverse of `price`."""
        return np.asarray(np.linalg.lstsq(self._triangle, price, rcond=None)[0])

    def optimal_price(self, x: Array, multipliers: Array) -> Array:
        """The price at which the halves have a solution's parts for minima, its stages kept in their slots.

        Args:
            x: The solution, (n,).
            multipliers: Of the rows and of the equalities, (m + p,), where 2 x + rowsᵀ multipliers = 0.
        """
        rows = np.concatenate([self._program.rows, self._program.equality])
        is_behind = np.concatenate([self._timeline.ends, self._timeline.goals]) > self.slot
        pull = (multipliers * is_behind) @ rows + 2.0 * SHARE * x
        return np.asarray(self._basis.T @ pull[self._earlier])

    def _over_state(self, matrix: Array) -> Array:
        """Rows over √SHARE z and the later inputs."""
        of_state = matrix[:, self._earlier] @ self._basis / sqrt(SHARE)
        return np.hstack([of_state, matrix[:, self._later]])

    def _sees_state(self, matrix: Array) -> Mask:
        """Tell which rows see earlier inputs through the state alone."""
        seen = matrix[:, self._earlier]
        beside = seen - (seen @ self._basis) @ self._basis.T
        return row_norms(beside) <= CAUSALITY_TOLERANCE * row_norms(seen)

    def _half(
        self, rows: Mask, goals: Mask, matrix: Array, equality: Array, stages: range
    ) -> AssignmentProgram:
        """The program of some rows (m,) and equalities (p,), over a half's variables, with some stages."""
        slots = [self.slot if i == self._stage else None for i in range(len(self._program.stages))]
        lower, upper = self._program.bounds_for(slots)
        place = np.cumsum(rows) - 1
        within = [self._within(self._program.stages[i], i < self._stage) for i in stages]
        if not all(rows[stage.rows].all() for stage in within):
            raise SpecError("dynamics: a stage must bound rows whose last input is that of its slot")
        for array in (matrix, equality):
            array.flags.writeable = False  # and so shared, never copied
        return AssignmentProgram(
            equality=equality,
            target=self._program.target[goals],
            rows=matrix,
            lower=lower[rows],
            upper=upper[rows],
            stages=tuple(replace(stage, rows=place[stage.rows]) for stage in within),
            precedence=tuple((i, i + 1) for i in range(len(stages) - 1)),
        )

    def _within(self, stage: SlottedStage, is_before: bool) -> SlottedStage:
        """A stage in the slots of its half."""
        return stage.restricted(
            [k for k, slot in enumerate(stage.slots) if (slot < self.slot if is_before else slot > self.slot)]
        )


def _last_slots(matrix: Array, dynamics: LinearDynamics) -> Indices:
    """The slot of the last input that each row of a matrix sees, −1 where it sees none."""
    seen = np.any(matrix[:, dynamics.columns] != 0.0, axis=2)  # (m, s)
    last: Indices = np.where(seen.any(axis=1), seen.shape[1] - 1 - seen[:, ::-1].argmax(axis=1), -1)
    return last
