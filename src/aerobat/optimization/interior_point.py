"""A linear cost under smooth constraints, by a primal-dual interior point method.

    minimize    gᵀ x   subject to   c(x) ≤ 0,   e(x) = 0,   lower < x < upper

Slacks s = −c(x) > 0 and multipliers z satisfy s z = μ, and μ falls towards zero. Each step solves

    (H + Cᵀ Σ C + B + δ I) dx + Eᵀ dy = −r,     E dx = −e,     Σ = z/s.

H holds the second derivatives of the Lagrangian, and B is what the box adds on the diagonal. The damping δ is
as large as makes the matrix positive definite, and never zero, so that directions in which nothing changes
are not run along. A filter accepts steps that lower the violation or the barrier function, with a
second-order correction where the constraints' curvature rejects them. The filter is that of Wächter and
Biegler, "On the implementation of an interior-point filter line-search algorithm for large-scale nonlinear
programming", 2006. The matrix of some hundred to a thousand unknowns is factorized as a dense one, in a
millisecond or two: what a step costs is second derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from aerobat.arrays import Array
from aerobat.optimization.deadline import out_of_time

_BOUND_PUSH = 1e-2  # of the box's width: how far the start is moved from its edges
_NEARLY = 0.99  # of the way to where a slack or a multiplier vanishes: the longest step
_BARRIER_SOLVED = 10.0  # times μ: an error of the barrier problem that lets μ fall,
_BARRIER_FALL = 0.2  # to this fraction,
_BARRIER_POWER = 1.5  # or this power of it
_GROWTH = 4.0  # of δ, until the matrix is positive definite
_SHRINK = 3.0  # of δ, from one step to the next
_LARGEST_DAMPING = 1e10
_JAMMED = 1e-4  # of a step: where slacks allow for less, they begin anew
_BACKTRACKS = 10  # halvings of a step
_CORRECTIONS = 3  # of second order, in a row
_SLOW_CORRECTION = 0.99  # of the violation: a correction that leaves more ends them
_SUFFICIENT = (
    1e-5  # of the violation: the least fall of it, or of the barrier function, that a step is taken for
)
_ARMIJO = 1e-4  # of the promised fall of the barrier function
_SMALL_VIOLATION = 1e-4  # of the first violation: below, the barrier function decides
_LARGE_VIOLATION = 1e4  # times the first: beyond, no step is taken
_SWITCH_POWERS = 2.3, 1.1  # of the promised fall and of the violation, as Wächter and Biegler have them
_CORRIDOR = 1e10  # the factor by which s z may differ from μ
_EQUALITY_WEIGHT = 1e-2  # of the matrix's largest entry, by which equalities are added to it
_ITERATIONS_FLAT = 3  # over which the cost has to stand still
_LARGE_MULTIPLIER = 100.0  # on average: larger ones make the dual error count less


class ConstraintRows(Protocol):
    """The slopes C (q, n) of inequalities, whichever way they are kept."""

    def times(self, step: Array) -> Array:
        """C d, (q,)."""

    def transposed(self, weights: Array) -> Array:
        """Cᵀ w, (n,)."""


class ConstrainedPoint(Protocol):
    """A program's constraints at a point."""

    @property
    def inequalities(self) -> Array:
        """c, (q,); infinite where the point makes no sense."""

    @property
    def equalities(self) -> Array:
        """e, (p,)."""

    @property
    def rows(self) -> ConstraintRows:
        """The slopes of the inequalities."""

    @property
    def equality_rows(self) -> Array:
        """The slopes of the equalities, (p, n)."""

    def curvature(self, inequality_weights: Array, equality_weights: Array, squares: Array) -> Array:
        """The second derivatives of their weighted sum, and Cᵀ diag(squares) C, (n, n)."""


class ConstrainedProgram(Protocol):
    """A linear cost to be minimized under constraints; variables are scaled to a size of about one."""

    @property
    def cost(self) -> Array:
        """g, (n,)."""

    @property
    def box(self) -> tuple[Array, Array]:
        """The least and the most that variables may be, (n,) each."""

    def at(self, x: Array) -> ConstrainedPoint:
        """The constraints at a point."""


@dataclass(frozen=True)
class Settings:
    """Settings of the method: accuracy, number of iterations and barrier parameters."""

    barrier: float = 1e-5  # μ at first: a thousand limits times it are little beside a cost of one
    least_barrier: float = 1e-6  # μ in the end
    least_slack: float = 1e-2  # at first
    damping: float = 1e-4  # the least δ
    iterations: int = 60
    tolerance: float = 1e-4  # of all optimality conditions
    violation: float = 1e-3  # with which a cost that stands still is an end
    gain: float = 1e-3  # of the cost, over some iterations: less is standing still


@dataclass(frozen=True, eq=False)
class InteriorPointResult:
    """The point at which the method ended, with its multipliers."""

    x: Array
    converged: bool  # all conditions hold, or the cost stands still at a small violation
    iterations: int
    z: Array  # the multipliers of inequalities


@dataclass(eq=False)
class _Iterate:
    """A point with its slacks and multipliers."""

    x: Array
    point: ConstrainedPoint
    slacks: Array
    z: Array  # of inequalities
    y: Array  # of equalities
    z_lower: Array
    z_upper: Array

    def dual_residual(self, cost: Array) -> Array:
        """The gradient of the Lagrangian, (n,)."""
        if self._residual is None:
            rows = self.point.rows.transposed(self.z) + self.point.equality_rows.T @ self.y
            self._residual = np.asarray(cost + rows - self.z_lower + self.z_upper)
        return self._residual

    _residual: Array | None = None


@dataclass(eq=False)
class _Step:
    """Changes of an iterate."""

    x: Array
    slacks: Array
    z: Array
    y: Array


@dataclass(eq=False)
class _Filter:
    """Pairs of a violation and a barrier function that a step must improve on."""

    first: float  # violation of the start
    entries: list[tuple[float, float]] = field(default_factory=list)

    def accepts(
        self, before: tuple[float, float], after: tuple[float, float], promised: float, length: float
    ) -> bool:
        """True where a step is taken.

        Args:
            before: Violation and barrier function.
            after: The same at the step's end.
            promised: Change of the barrier function that a whole step was promised.
            length: Of the step, 1 for a whole one.
        """
        violation, barrier = before
        if not after[0] < _LARGE_VIOLATION * self.first:
            return False
        if any(after[0] >= known and after[1] >= value for known, value in self.entries):
            return False
        if violation < _SMALL_VIOLATION * self.first and _promises(violation, promised, length):
            return after[1] <= barrier + _ARMIJO * length * promised
        return after[0] <= (1.0 - _SUFFICIENT) * violation or after[1] <= barrier - _SUFFICIENT * violation

    def add(self, before: tuple[float, float]) -> None:
        """Keep what the next steps have to improve on."""
        self.entries.append(((1.0 - _SUFFICIENT) * before[0], before[1] - _SUFFICIENT * before[0]))


def _promises(violation: float, promised: float, length: float) -> bool:
    by_fall, by_violation = _SWITCH_POWERS
    return promised < 0.0 and bool((-length * promised) ** by_fall > violation**by_violation)


def interior_point(
    program: ConstrainedProgram,
    start: Array,
    settings: Settings | None = None,
    multipliers: Array | None = None,
) -> InteriorPointResult:
    """Return a local minimum near a start, feasible or not, or where iterations or time end.

    Args:
        program: What is minimized.
        start: Where to begin, (n,).
        settings: Accuracy and length.
        multipliers: Of the inequalities, from a program that is nearly the same.
    """
    return _InteriorPoint(program, settings or Settings()).run(start, multipliers)


class _InteriorPoint:
    """One run of the method."""

    def __init__(self, program: ConstrainedProgram, settings: Settings) -> None:
        self._program, self._settings = program, settings
        self._cost = program.cost
        self._lower, self._upper = program.box
        self._barrier = settings.barrier
        self._damping = 0.0  # of the last step that needed some
        self._filter = _Filter(1.0)
        self._is_anew = False  # slacks and multipliers, from the last step on

    def run(self, start: Array, multipliers: Array | None) -> InteriorPointResult:
        """Descend."""
        iterate, costs = self._begun(start, multipliers), []
        if not np.isfinite(iterate.point.inequalities).all():
            return InteriorPointResult(iterate.x, False, 0, iterate.z)  # no step leads on from there
        self._filter.first = max(_violation(iterate.point, iterate.slacks), 1.0)
        for iteration in range(self._settings.iterations):
            costs.append(float(self._cost @ iterate.x))
            if self._error(iterate, 0.0) < self._settings.tolerance or self._stands_still(iterate, costs):
                return InteriorPointResult(iterate.x, True, iteration, iterate.z)
            if out_of_time():
                return InteriorPointResult(iterate.x, False, iteration, iterate.z)
            self._lower_barrier(iterate)
            if not self._advance(iterate):
                return InteriorPointResult(iterate.x, False, iteration, iterate.z)
        return InteriorPointResult(iterate.x, False, self._settings.iterations, iterate.z)

    def _begun(self, start: Array, multipliers: Array | None) -> _Iterate:
        """The start within the box, with slacks and multipliers that fit the barrier."""
        push = _BOUND_PUSH * (self._upper - self._lower)
        x = np.clip(start, self._lower + push, self._upper - push)
        point, barrier = self._program.at(x), self._barrier
        least = np.full(len(point.inequalities), self._settings.least_slack)
        if multipliers is not None:
            least = np.minimum(least, barrier / multipliers)
        slacks = np.maximum(-point.inequalities, least)
        z = barrier / slacks if multipliers is None else np.maximum(multipliers, barrier / slacks)
        return _Iterate(
            x=x,
            point=point,
            slacks=slacks,
            z=z,
            y=np.zeros(len(point.equalities)),
            z_lower=barrier / (x - self._lower),
            z_upper=barrier / (self._upper - x),
        )

    def _error(self, at: _Iterate, barrier: float) -> float:
        """The largest error in the conditions of optimality for a barrier parameter."""
        multipliers = np.abs(at.z).sum() + np.abs(at.y).sum()
        size = max(_LARGE_MULTIPLIER, multipliers / (len(at.z) + len(at.y))) / _LARGE_MULTIPLIER
        products = (
            at.slacks * at.z,
            (at.x - self._lower) * at.z_lower,
            (self._upper - at.x) * at.z_upper,
        )
        errors = (
            float(np.abs(at.dual_residual(self._cost)).max()) / size,
            _largest(at.point.inequalities + at.slacks),
            _largest(at.point.equalities),
            *(_largest(product - barrier) / size for product in products),
        )
        return float(max(errors))

    def _stands_still(self, at: _Iterate, costs: list[float]) -> bool:
        """True where the cost has not changed for a while, at a small violation and the last barrier."""
        recent = costs[-_ITERATIONS_FLAT:]
        still = len(costs) > _ITERATIONS_FLAT and max(recent) - min(recent) < self._settings.gain
        at_end = self._barrier <= self._settings.least_barrier
        missed = max(float(at.point.inequalities.max(initial=0.0)), _largest(at.point.equalities))
        return still and at_end and missed < self._settings.violation

    def _lower_barrier(self, at: _Iterate) -> None:
        least = self._settings.least_barrier
        while self._barrier > least and self._error(at, self._barrier) < _BARRIER_SOLVED * self._barrier:
            self._barrier = max(least, min(_BARRIER_FALL * self._barrier, self._barrier**_BARRIER_POWER))
            self._filter.entries.clear()

    def _advance(self, at: _Iterate) -> bool:
        """Take one step; False where no damping makes the matrix positive definite."""
        system = self._system(at)
        if system is None:
            return False
        missed = at.point.inequalities + at.slacks
        step = system.step(missed, at.point.equalities)
        before = _violation(at.point, at.slacks), self._barrier_function(at.x, at.slacks)
        promised = self._promised(at, step)
        longest = length = self._longest(at, step)
        if longest < _JAMMED and not self._is_anew:
            self._begin_anew(at)
            return True
        self._is_anew = longest < _JAMMED
        for halvings in range(_BACKTRACKS):
            after, trial = self._tried(at, step, length)
            if self._filter.accepts(before, after, promised, length):
                break
            if halvings == 0 and after[0] >= before[0]:
                corrected = self._corrected(at, system, trial, before, longest, promised)
                if corrected is not None:
                    step, length, after, trial = corrected
                    break
            length *= 0.5
        else:
            self._filter.entries.clear()
            self._damping = max(100.0 * self._settings.damping, 10.0 * self._damping)
            return self._damping < _LARGEST_DAMPING
        falls = promised < 0.0 and after[1] <= before[1] + _ARMIJO * length * promised
        if not falls:
            self._filter.add(before)
        self._move(at, step, length, trial)
        return True

    def _begin_anew(self, at: _Iterate) -> None:
        """Move slacks away from zero where they stop every step, and choose multipliers that fit."""
        at.slacks = np.maximum(at.slacks, self._settings.least_slack)
        at.z, at._residual = self._barrier / at.slacks, None
        self._filter.entries.clear()
        self._is_anew = True

    def _corrected(
        self,
        at: _Iterate,
        system: _System,
        trial: ConstrainedPoint,
        before: tuple[float, float],
        longest: float,
        promised: float,
    ) -> tuple[_Step, float, tuple[float, float], ConstrainedPoint] | None:
        """A step that counts the curvature of the constraints too, if it is accepted.

        Args:
            at: Where the step begins.
            system: Of the step.
            trial: The end of the step, which is rejected.
            before: Violation and barrier function.
            longest: The length of the step.
            promised: Change of the barrier function that it was promised.
        """
        missed = longest * (at.point.inequalities + at.slacks)
        equal = longest * at.point.equalities
        slacks, violation = at.slacks + longest * system.last_slacks, np.inf
        for _ in range(_CORRECTIONS):
            if not np.isfinite(trial.inequalities).all():
                return None
            missed, equal = missed + trial.inequalities + slacks, equal + trial.equalities
            step = system.step(missed, equal)
            length = self._longest(at, step)
            after, trial = self._tried(at, step, length)
            if self._filter.accepts(before, after, promised, longest):
                return step, length, after, trial
            if after[0] > _SLOW_CORRECTION * violation:
                return None
            violation, slacks = after[0], at.slacks + length * step.slacks
            missed, equal = length * missed, length * equal
        return None

    def _system(self, at: _Iterate) -> _System | None:
        """The equations of a step, damped until they have a positive definite matrix."""
        lower, upper = at.x - self._lower, self._upper - at.x
        matrix = at.point.curvature(at.z, at.y, at.z / at.slacks)
        matrix[np.diag_indices_from(matrix)] += at.z_lower / lower + at.z_upper / upper
        equal = at.point.equality_rows
        weight = max(1.0, np.abs(np.diag(matrix)).max()) * _EQUALITY_WEIGHT if len(equal) else 0.0
        matrix += weight * (equal.T @ equal)
        residual = self._cost + equal.T @ at.y - self._barrier * (1.0 / lower - 1.0 / upper)
        least = damping = self._settings.damping
        while damping < _LARGEST_DAMPING:
            try:
                factor = cho_factor(matrix + damping * np.eye(len(matrix)), check_finite=False)
            except LinAlgError:
                grown = _GROWTH * damping
                damping = max(grown, self._damping / _SHRINK) if damping == least else grown
                continue
            self._damping = damping if damping > least else self._damping / _SHRINK
            return _System(at, self._barrier, factor, weight, residual)
        return None

    def _tried(
        self, at: _Iterate, step: _Step, length: float
    ) -> tuple[tuple[float, float], ConstrainedPoint]:
        """Violation and barrier function at a step's end, and the constraints there."""
        x, slacks = at.x + length * step.x, at.slacks + length * step.slacks
        point = self._program.at(x)
        return (_violation(point, slacks), self._barrier_function(x, slacks)), point

    def _barrier_function(self, x: Array, slacks: Array) -> float:
        logarithms = np.log(slacks).sum() + np.log((x - self._lower) * (self._upper - x)).sum()
        return float(self._cost @ x - self._barrier * logarithms)

    def _promised(self, at: _Iterate, step: _Step) -> float:
        lower, upper = at.x - self._lower, self._upper - at.x
        along = (step.slacks / at.slacks).sum() + (step.x / lower).sum() - (step.x / upper).sum()
        return float(self._cost @ step.x - self._barrier * along)

    def _longest(self, at: _Iterate, step: _Step) -> float:
        """The longest step that keeps slacks positive and the point in its box."""
        lower, upper = at.x - self._lower, self._upper - at.x
        return min(_to_zero(at.slacks, step.slacks), _to_zero(lower, step.x), _to_zero(upper, -step.x))

    def _move(self, at: _Iterate, step: _Step, length: float, trial: ConstrainedPoint) -> None:
        """Change the iterate by a step; multipliers go as far as they stay positive."""
        lower, upper = at.x - self._lower, self._upper - at.x
        by_lower = self._barrier / lower - at.z_lower - at.z_lower / lower * step.x
        by_upper = self._barrier / upper - at.z_upper + at.z_upper / upper * step.x
        dual = min(_to_zero(at.z, step.z), _to_zero(at.z_lower, by_lower), _to_zero(at.z_upper, by_upper))
        at.x = at.x + length * step.x
        at.y = at.y + length * step.y
        at.point, at._residual = trial, None
        at.slacks = at.slacks + length * step.slacks
        at.z = self._near_path(at.z + dual * step.z, at.slacks)
        at.z_lower = self._near_path(at.z_lower + dual * by_lower, at.x - self._lower)
        at.z_upper = self._near_path(at.z_upper + dual * by_upper, self._upper - at.x)
        at.slacks = np.maximum(at.slacks, -trial.inequalities)  # where there is more room than that

    def _near_path(self, multipliers: Array, distances: Array) -> Array:
        """Multipliers whose products with distances are not too far from the barrier parameter."""
        fitting = self._barrier / distances
        return np.clip(multipliers, fitting / _CORRIDOR, fitting * _CORRIDOR)


class _System:
    """The linear equations of one iterate's steps, factorized."""

    def __init__(
        self,
        at: _Iterate,
        barrier: float,
        factor: tuple[Array, bool],
        weight: float,
        residual: Array,
    ) -> None:
        self._at, self._barrier, self._factor = at, barrier, factor
        self._weight, self._residual = weight, residual
        self._equal = at.point.equality_rows
        self._moved = cho_solve(factor, self._equal.T, check_finite=False)
        self._schur = self._equal @ self._moved + 1e-14 * np.eye(len(self._equal))
        self.last_slacks = np.zeros(0)  # of the first step

    def step(self, missed: Array, equal: Array) -> _Step:
        """The step that removes what inequalities and their slacks (q,) and equalities (p,) are missed by."""
        at = self._at
        sigma, fitting = at.z / at.slacks, self._barrier / at.slacks
        right = -self._residual - at.point.rows.transposed(fitting + sigma * missed)
        right -= self._weight * (self._equal.T @ equal)
        x = cho_solve(self._factor, right, check_finite=False)
        y = np.linalg.solve(self._schur, self._equal @ x + equal)
        x = x - self._moved @ y
        slacks = -missed - at.point.rows.times(x)
        if not self.last_slacks.size:
            self.last_slacks = slacks
        return _Step(x, slacks, fitting - at.z - sigma * slacks, y)


def _violation(point: ConstrainedPoint, slacks: Array) -> float:
    """The sum of what inequalities with their slacks and equalities are missed by; infinite for no number."""
    total = float(np.abs(point.inequalities + slacks).sum() + np.abs(point.equalities).sum())
    return total if np.isfinite(total) else np.inf


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _to_zero(values: Array, changes: Array) -> float:
    """How much of the changes positive values stand, at most all of it."""
    falling = changes < 0.0
    return min(1.0, float((-_NEARLY * values[falling] / changes[falling]).min(initial=1.0)))
