"""From a problem to its program: the paper's (1) as a convex QP over the inputs, with stages in intervals.

The 3N variables are the normalised inputs of the integrator chain, axis by axis: x = (w_x, w_y, w_z) with
w = dt^r u. The matrices do not depend on dt; only the bounds do. The exception are vehicles with drag, whose
conditions on specific thrust combine velocity and acceleration. These scale with different powers of dt, so
that the rows depend on dt.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, frozen
from aerobat.errors import SpecError
from aerobat.optimization import AssignmentProgram, SlottedStage
from aerobat.planning.miqp.integrator import INPUT_NAMES, IntegratorChain
from aerobat.planning.task import Task
from aerobat.problem.condition import Condition, Quantity
from aerobat.problem.end_state import VELOCITY
from aerobat.problem.limits import DERIVATIVES
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence


@dataclass(frozen=True)
class Row:
    """A scalar row: direction · (derivative of position at an interval's end, or input over the interval).

    `drag` times the next lower derivative is added to the derivative.
    """

    interval: int
    derivative: int
    direction: tuple[float, float, float]
    drag: float = 0.0  # [1/s]


@dataclass(frozen=True)
class Formulation:
    """A problem on N intervals of a chain of integrators, for any dt.

    As in the authors' reference code, bounds on the state hold at the ends of intervals 0..N−2, and stages
    are placed there. Bounds on the input hold on all N intervals. The goal is met at the end of the last.

    Raises SpecError when there are fewer interval ends than stages, or a limit on a derivative above the
    input.
    """

    task: Task
    chain: IntegratorChain

    def __post_init__(self) -> None:
        """Check that there are enough intervals, and that the input's order can hold all limits."""
        ends, stages = self.chain.intervals - 1, len(self.sequence.stages)
        nowhere = [s for s in self.sequence.stages if not self._slots(s)]
        if nowhere and ends >= max(stages, 1):
            first, last = nowhere[0].window
            raise SpecError(
                f"the stage '{nowhere[0].name}' may hold between {first:g} and {last:g} of the duration, "
                f"where none of {self.chain.intervals} intervals ends; widen its `at`, or use more intervals"
            )
        if ends < max(stages, 1):
            raise SpecError(
                f"intervals: {self.chain.intervals} leave {ends} interval ends between start and goal for "
                f"the {stages} stages of '{self.problem.name}'; use at least {max(2 * stages, 3)}"
            )
        for derivative in range(self.chain.order + 1, len(DERIVATIVES)):
            if np.isfinite(self.problem.path_limits.of(derivative)[1]).any():
                raise SpecError(
                    f"limits.{DERIVATIVES[derivative]} cannot be held when the input is "
                    f"{INPUT_NAMES[self.chain.order]}; plan with --order {derivative} or drop it"
                )

    @property
    def problem(self) -> Problem:
        """The task's problem."""
        return self.task.problem

    @cached_property
    def sequence(self) -> StageSequence:
        """The task's stages with linear conditions only: each ball is replaced by a polytope inside it."""
        return self.task.stages.linear

    def program(self, dt: float) -> AssignmentProgram:
        """Return the program at one dt [s]; without drag its matrices are the same arrays for all dt."""
        scale, free = dt**self._derivatives, self._free(dt)
        lower, upper = self._limits
        goal = self.problem.goal.derivatives(self.chain.order) * self.chain.scales(dt)[:, None]
        met, stages = self._met, range(len(self.sequence.stages))
        reached = self.chain.free(self.initial, dt)[-1]
        return AssignmentProgram(
            equality=self._equality,
            target=(goal - reached)[met].T.ravel(),
            rows=self._matrix if not self._drags.any() else self._rows_at(dt),
            lower=lower * scale - free,
            upper=upper * scale - free,
            stages=tuple(self._assigned(i, scale, free) for i in stages),
            precedence=tuple(pairwise(stages)) if self.sequence.ordered else (),
        )

    def inputs(self, x: Array, dt: float) -> Array:
        """Return the inputs in SI units, (N, 3), of a program's solution."""
        return x.reshape(3, -1).T / dt**self.chain.order

    def cost(self, program_cost: float, dt: float) -> float:
        """Return the paper's cost Σ|u|² in SI units from a program's cost."""
        return program_cost / dt ** (2 * self.chain.order)

    @cached_property
    def initial(self) -> Array:
        """The start's derivatives below the order in SI units, (r, 3)."""
        return self.problem.start.derivatives(self.chain.order)

    @cached_property
    def _equality(self) -> Array:
        """The equality rows: derivatives below the order that the goal fixes at the last interval's end."""
        return frozen(np.kron(np.eye(3), self.chain.forced[-1][self._met]), "equality")

    @property
    def _met(self) -> Array:
        """The mask of the derivatives below the order that the goal fixes."""
        return self.problem.goal.fixed(self.chain.order)

    @cached_property
    def _rows(self) -> dict[Row, tuple[float, float]]:
        """All rows that limits or stages use, with the lower and upper limit in SI units."""
        rows: dict[Row, tuple[float, float]] = {}
        for row, lower, upper in self._limit_rows():
            low, high = rows.get(row, (-inf, inf))
            rows[row] = (max(low, lower), min(high, upper))
        for stage in self.sequence.stages:
            for interval in self._slots(stage):
                for condition in stage.conditions:
                    rows.setdefault(self._row(condition, interval), (-inf, inf))
        return rows

    def _limit_rows(self) -> Iterable[tuple[Row, float, float]]:
        """Yield the rows of linear limits along the path; the vehicle's limits are left to the refinement."""
        for limit in self.task.limits:
            for linear in limit.linear:
                *_, derivative = linear.quantity.derivatives
                at_goal = derivative == VELOCITY and self.problem.goal.free_velocity
                intervals = self.chain.intervals - (derivative != self.chain.order and not at_goal)
                x, y, z = linear.quantity.path[derivative].tolist()
                drag = self.task.balance.drag if len(linear.quantity.derivatives) > 1 else 0.0
                lower, upper = linear.ends
                for interval in range(intervals):
                    row = Row(interval, derivative, (x, y, z), drag)
                    yield row, linear.size * lower, linear.size * upper

    @cached_property
    def _derivatives(self) -> Array:
        return np.array([row.derivative for row in self._rows], dtype=float)

    @cached_property
    def _directions(self) -> Array:
        return np.array([row.direction for row in self._rows]).reshape(-1, 3)

    @cached_property
    def _drags(self) -> Array:
        return np.array([row.drag for row in self._rows])

    @cached_property
    def _limits(self) -> tuple[Array, Array]:
        """The lower and the upper limits of all rows in SI units, (m,) each."""
        bounds = np.array(list(self._rows.values())).reshape(-1, 2)
        return bounds[:, 0], bounds[:, 1]

    @cached_property
    def _matrix(self) -> Array:
        """The matrix of all rows by the inputs, without drag, (m, 3N)."""
        return self._rows_at(0.0)

    def _rows_at(self, dt: float) -> Array:
        """Return the matrix of all rows by the inputs at one dt, with drag, (m, 3N)."""
        matrix = self._directions[:, :, None] * self._with_drag(self._response, dt)[:, None, :]
        return frozen(matrix.reshape(len(self._rows), 3 * self.chain.intervals), "rows")

    def _with_drag(self, values: Array, dt: float) -> Array:
        """Return the values (m, ·) at each row's interval and derivative, of values (N, r + 1, ·) at all."""
        intervals, derivatives = self._places
        below = values[intervals, np.maximum(derivatives - 1, 0)]
        return np.asarray(values[intervals, derivatives] + (dt * self._drags)[:, None] * below)

    @cached_property
    def _response(self) -> Array:
        """The effect of the inputs on the derivatives at interval ends, and on the inputs, (N, r + 1, N)."""
        return np.concatenate([self.chain.forced, np.eye(self.chain.intervals)[:, None]], axis=1)

    @cached_property
    def _places(self) -> tuple[Indices, Indices]:
        """The interval and the derivative of each row, (m,) each."""
        intervals = np.array([row.interval for row in self._rows], dtype=np.intp)
        return intervals, self._derivatives.astype(np.intp)

    def _free(self, dt: float) -> Array:
        """Return the normalised value of each row for zero input, (m,)."""
        free = np.pad(self.chain.free(self.initial, dt), ((0, 0), (0, 1), (0, 0)))
        return np.asarray(np.sum(self._with_drag(free, dt) * self._directions, axis=-1))

    def _row(self, condition: Condition, interval: int) -> Row:
        x, y, z = condition.direction.tolist()
        about_thrust = condition.quantity is Quantity.SPECIFIC_THRUST
        drag = self.task.balance.drag if about_thrust else 0.0
        return Row(interval, condition.quantity.derivative, (x, y, z), drag)

    def _slots(self, stage: Stage) -> range:
        """Return the intervals at whose ends a stage may hold; none when its window contains no such end."""
        return stage.slots(self.chain.intervals)

    @cached_property
    def _stage_rows(self) -> tuple[tuple[Indices, Array], ...]:
        """The rows of each stage's conditions (slots, conditions), and their SI bounds (conditions, 2)."""
        index, found = {row: i for i, row in enumerate(self._rows)}, list[tuple[Indices, Array]]()
        for stage in self.sequence.stages:
            rows = [[index[self._row(c, n)] for c in stage.conditions] for n in self._slots(stage)]
            bounds = [c.bound(self.task.balance).limits for c in stage.conditions]
            found.append((np.array(rows, dtype=np.intp), np.array(bounds).reshape(-1, 2)))
        return tuple(found)

    def _assigned(self, i: int, scale: Array, free: Array) -> SlottedStage:
        stage, (rows, bounds) = self.sequence.stages[i], self._stage_rows[i]
        lower, upper = (bounds[:, side] * scale[rows] - free[rows] for side in (0, 1))
        return SlottedStage(stage.name, tuple(self._slots(stage)), rows, lower, upper)
