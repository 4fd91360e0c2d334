"""A linear cost under smooth constraints, by a primal-dual interior point method.

    minimize    gᵀ x   subject to   c(x) ≤ 0,   e(x) = 0,   lower < x < upper

Slacks s = −c(x) > 0 and multipliers z satisfy s z = μ, and μ falls towards zero. Each step solves

    (H + Cᵀ Σ C + B + δ I) dx + Eᵀ dy = −r,     E dx = −e,     Σ = z/s.

H holds the second derivatives of the Lagrangian, and B is what the box adds on the diagonal. The damping δ is
as large as makes the matrix positive definite and a step acceptable, as in a trust region: it grows where
steps are shortened, falls where they are not, and never vanishes. A step is taken if it lowers the barrier
function plus the weighted violation; where the constraints' curvature speaks against it, a second-order
correction is tried. This is the merit function of Byrd, Hribar and Nocedal, "An interior point algorithm for
large-scale nonlinear programming", 1999. Each slack stops by itself short of zero, and is as large as the
room that a step leaves. The matrix of some hundred to a thousand unknowns is factorized as a dense one, in a
millisecond or two: what a step costs is second derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from aerobat.arrays import Array
from aerobat.optimization.deadline import out_of_time

_BOUND_PUSH = 1e-2  # of the box's width: how far the start is moved from its edges
_NEARLY = 0.99  # of the way to where a multiplier vanishes, or to the edge of the box: the longest step
_LEAST_SLACK = 0.1  # of a slack: what a step leaves of it at least
_BARRIER_SOLVED = 10.0  # times μ: an error of the barrier problem that lets μ fall,
_BARRIER_FALL = 0.2  # to this fraction,
_BARRIER_POWER = 1.5  # or this power of it
_GROWTH = 4.0  # of δ, until the matrix is positive definite, and where a step is shortened
_SHRINK = 3.0  # of δ, where a whole step is taken
_JUMP = 10.0  # of δ, where no part of a step is taken
_MOST_DAMPING = 1.0  # that a short step leads to
_LARGEST_DAMPING = 1e10
_SHORT = 0.2  # of a step: what leaves its box earlier is damped more
_JAMMED = 1e-3  # of a step: where no more is taken, slacks and multipliers begin anew
_BACKTRACKS = 10  # parts of a step that are tried, each half the one before
_CORRECTIONS = 3  # of second order, in a row
_SLOW_CORRECTION = 0.99  # of the violation: a correction that leaves more ends them
_ARMIJO = 1e-4  # of the promised fall
_LEAST_WEIGHT = 1e-3  # of the violation beside the barrier function
_SHARE = 0.5  # of the fall of the weighted violation, which the barrier function may rise by
_ROUNDING = 1e-12  # of the merit
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


class _Value(NamedTuple):
    """What a step has to lower."""

    violation: float
    barrier: float  # the barrier function


class _Trial(NamedTuple):
    """The end of a step."""

    x: Array
    slacks: Array
    point: ConstrainedPoint
    value: _Value


def interior_point(
    program: ConstrainedProgram,
    start: Array,
    settings: Settings,
    multipliers: Array | None = None,
) -> InteriorPointResult:
    """Return a local minimum near a start, feasible or not, or where iterations or time end.

    What makes no sense on the way, or lies at the edge of the box, is infinite.

    Args:
        program: What is minimized.
        start: Where to begin, (n,).
        settings: Accuracy and length.
        multipliers: Of the inequalities, from a program that is nearly the same.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return _InteriorPoint(program, settings).run(start, multipliers)


class _InteriorPoint:
    """One run of the method."""

    def __init__(self, program: ConstrainedProgram, settings: Settings) -> None:
        self._program, self._settings = program, settings
        self._cost = program.cost
        self._lower, self._upper = program.box
        self._barrier = settings.barrier
        self._damping = settings.damping
        self._violation_weight = _LEAST_WEIGHT

    def run(self, start: Array, multipliers: Array | None) -> InteriorPointResult:
        """Descend from a start until the end."""
        iterate, costs, jammed = self._begun(start, multipliers), [], False
        if not np.isfinite(iterate.point.inequalities).all():
            return InteriorPointResult(iterate.x, False, 0, iterate.z)  # no step leads on from there
        for iteration in range(self._settings.iterations):
            costs.append(float(self._cost @ iterate.x))
            if self._error(iterate, 0.0) < self._settings.tolerance or self._stands_still(iterate, costs):
                return InteriorPointResult(iterate.x, True, iteration, iterate.z)
            if out_of_time():
                return InteriorPointResult(iterate.x, False, iteration, iterate.z)
            self._lower_barrier(iterate)
            if self._advance(iterate):
                jammed = False
            elif jammed:
                return InteriorPointResult(iterate.x, False, iteration, iterate.z)
            else:
                jammed = True
                self._begin_anew(iterate)
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

    def _advance(self, at: _Iterate) -> bool:
        """Take one step; False where none is accepted, however damped."""
        equations = _Equations(at, self)
        before = self._value(at.x, at.slacks, at.point)
        while self._damping < _LARGEST_DAMPING:
            if not equations.factorize(self._damping):
                self._damping *= _GROWTH
                continue
            found = self._accepted(at, equations, before)
            if found is not None:
                self._move(at, *found)
                if found[1] < _JAMMED:
                    self._begin_anew(at)
                return True
            self._damping *= _JUMP
        return False

    def _begin_anew(self, at: _Iterate) -> None:
        """Move slacks away from zero where steps hardly lead on, and choose multipliers that fit."""
        at.slacks = np.maximum(at.slacks, self._settings.least_slack)
        at.z, at._residual = self._barrier / at.slacks, None
        self._damping = self._settings.damping

    def _accepted(
        self, at: _Iterate, equations: _Equations, before: _Value
    ) -> tuple[_Step, float, _Trial] | None:
        """A step, its length and its end, corrected or shortened; None if it is not taken."""
        missed = at.point.inequalities + at.slacks
        step = equations.step(missed, at.point.equalities)
        promised, length = self._promised(at, step), self._longest(at, step)
        if length < _SHORT and self._damping < _MOST_DAMPING:
            return None
        for halvings in range(_BACKTRACKS):
            trial = self._tried(at, step, length)
            if self._accepts(before, trial.value, promised, length):
                self._adapt(is_whole=not halvings)
                return step, length, trial
            if not halvings and trial.value.violation >= before.violation:
                corrected = self._corrected(at, equations, trial, before, step, promised)
                if corrected is not None:
                    self._adapt(is_whole=True)
                    return corrected
            length *= 0.5
        return None

    def _accepts(self, before: _Value, after: _Value, promised: float, length: float) -> bool:
        """True where a step lowers the merit: the barrier function plus the weighted violation.

        Args:
            before: Where it begins.
            after: Where it ends.
            promised: Change of the barrier function that a whole step was promised.
            length: Of the step, 1 for a whole one.
        """
        if promised > 0.0 and before.violation > 0.0:
            least = promised / (_SHARE * before.violation)
            self._violation_weight = max(self._violation_weight, least)
        merits = [each.barrier + self._violation_weight * each.violation for each in (before, after)]
        fall = min(promised - self._violation_weight * before.violation, 0.0)
        return merits[1] <= merits[0] + _ARMIJO * length * fall + _ROUNDING

    def _adapt(self, is_whole: bool) -> None:
        """Damp the next step less after a whole one, more after one that was shortened."""
        if is_whole:
            self._damping = max(self._damping / _SHRINK, self._settings.damping)
        else:
            self._damping = max(self._damping, min(self._damping * _GROWTH, _MOST_DAMPING))

    def _corrected(
        self,
        at: _Iterate,
        equations: _Equations,
        trial: _Trial,
        before: _Value,
        step: _Step,
        promised: float,
    ) -> tuple[_Step, float, _Trial] | None:
        """A step that counts the curvature of the constraints too, if it is accepted.

        Args:
            at: Where the step begins.
            equations: Of the step.
            trial: The end of the step, which is rejected.
            before: Violation and barrier function.
            step: That is corrected.
            promised: Change of the barrier function that it was promised.
        """
        longest = length = self._longest(at, step)
        missed, equal = at.point.inequalities + at.slacks, at.point.equalities
        violation = np.inf
        for _ in range(_CORRECTIONS):
            if not np.isfinite(trial.point.inequalities).all():
                return None
            missed = length * missed + trial.point.inequalities + at.slacks + length * step.slacks
            equal = length * equal + trial.point.equalities
            step = equations.step(missed, equal)
            length = self._longest(at, step)
            trial = self._tried(at, step, length)
            if self._accepts(before, trial.value, promised, longest):
                return step, length, trial
            if trial.value.violation > _SLOW_CORRECTION * violation:
                return None
            violation = trial.value.violation
        return None

    def _tried(self, at: _Iterate, step: _Step, length: float) -> _Trial:
        """The end of a step: no slack falls too far, and all have the room that there is."""
        x = at.x + length * step.x
        point = self._program.at(x)
        falling = np.maximum(at.slacks + length * step.slacks, _LEAST_SLACK * at.slacks)
        slacks = np.maximum(falling, -point.inequalities)
        return _Trial(x, slacks, point, self._value(x, slacks, point))

    def _value(self, x: Array, slacks: Array, point: ConstrainedPoint) -> _Value:
        """Violation and barrier function; the violation is infinite where there is no number."""
        missed = float(np.abs(point.inequalities + slacks).sum() + np.abs(point.equalities).sum())
        logarithms = np.log(slacks).sum() + np.log((x - self._lower) * (self._upper - x)).sum()
        barrier = float(self._cost @ x - self._barrier * logarithms)
        return _Value(missed if np.isfinite(missed) else np.inf, barrier)

    def _promised(self, at: _Iterate, step: _Step) -> float:
        lower, upper = at.x - self._lower, self._upper - at.x
        along = (step.slacks / at.slacks).sum() + (step.x / lower).sum() - (step.x / upper).sum()
        return float(self._cost @ step.x - self._barrier * along)

    def _longest(self, at: _Iterate, step: _Step) -> float:
        """The longest step that keeps the point in its box."""
        return min(_to_zero(at.x - self._lower, step.x), _to_zero(self._upper - at.x, -step.x))

    def _move(self, at: _Iterate, step: _Step, length: float, trial: _Trial) -> None:
        """Change the iterate by a step; multipliers go as far as they stay positive."""
        lower, upper = at.x - self._lower, self._upper - at.x
        by_lower = self._barrier / lower - at.z_lower - at.z_lower / lower * step.x
        by_upper = self._barrier / upper - at.z_upper + at.z_upper / upper * step.x
        dual = min(_to_zero(at.z, step.z), _to_zero(at.z_lower, by_lower), _to_zero(at.z_upper, by_upper))
        at.x, at.slacks, at.point, _ = trial
        at.y, at._residual = at.y + length * step.y, None
        at.z = self._near_path(at.z + dual * step.z, at.slacks)
        at.z_lower = self._near_path(at.z_lower + dual * by_lower, at.x - self._lower)
        at.z_upper = self._near_path(at.z_upper + dual * by_upper, self._upper - at.x)

    def _near_path(self, multipliers: Array, distances: Array) -> Array:
        """Multipliers whose products with distances are not too far from the barrier parameter."""
        fitting = self._barrier / distances
        return np.clip(multipliers, fitting / _CORRIDOR, fitting * _CORRIDOR)


class _Equations:
    """The linear equations of one iterate's steps."""

    def __init__(self, at: _Iterate, method: _InteriorPoint) -> None:
        lower, upper = at.x - method._lower, method._upper - at.x
        matrix = at.point.curvature(at.z, at.y, at.z / at.slacks)
        _diagonal(matrix)[:] += at.z_lower / lower + at.z_upper / upper
        self._equal = at.point.equality_rows
        largest = max(1.0, np.abs(_diagonal(matrix)).max())
        self._weight = largest * _EQUALITY_WEIGHT if len(self._equal) else 0.0
        self._matrix = matrix + self._weight * (self._equal.T @ self._equal)
        barrier = self._barrier = method._barrier
        self._residual = method._cost + self._equal.T @ at.y - barrier * (1.0 / lower - 1.0 / upper)
        self._at = at

    def factorize(self, damping: float) -> bool:
        """Factorize the damped matrix; False where it is not positive definite."""
        damped = self._matrix.copy()
        _diagonal(damped)[:] += damping
        self._factor, failed = dpotrf(damped.T, clean=False, overwrite_a=True)
        if failed:
            return False
        self._moved, _ = dpotrs(self._factor, self._equal.T)
        self._schur = self._equal @ self._moved
        _diagonal(self._schur)[:] += 1e-14
        return True

    def step(self, missed: Array, equal: Array) -> _Step:
        """The step that removes what inequalities and their slacks (q,) and equalities (p,) are missed by."""
        at = self._at
        sigma, fitting = at.z / at.slacks, self._barrier / at.slacks
        right = -self._residual - at.point.rows.transposed(fitting + sigma * missed)
        right -= self._weight * (self._equal.T @ equal)
        x, _ = dpotrs(self._factor, right)
        y = np.linalg.solve(self._schur, self._equal @ x + equal)
        x = x - self._moved @ y
        slacks = -missed - at.point.rows.times(x)
        return _Step(x, slacks, fitting - at.z - sigma * slacks, y)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _to_zero(values: Array, changes: Array) -> float:
    """How much of the changes positive values stand, at most all of it."""
    fall = float((-changes / values).max(initial=0.0))
    return _NEARLY / fall if fall > _NEARLY else 1.0


def _diagonal(matrix: Array) -> Array:
    """The diagonal (n,) of a square matrix, in place."""
    return matrix.reshape(-1)[:: len(matrix) + 1]
