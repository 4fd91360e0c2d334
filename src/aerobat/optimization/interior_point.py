"""Minimize a linear cost under smooth constraints, by a primal-dual interior point method.

    minimize    gᵀ x   subject to   c(x) ≤ 0,   e(x) = 0,   lower < x < upper.

Slacks s = −c(x) > 0 and multipliers z satisfy s z = μ, and the barrier
parameter μ falls towards zero. Each step solves

    (H + Cᵀ Σ C + B + δ I) dx + Eᵀ dy = −r,     E dx = −e,     Σ = z/s.

H holds the second derivatives of the Lagrangian, and B is the diagonal that the box bounds add. The damping δ
(Levenberg-Marquardt) makes the matrix positive definite and the step acceptable, as in a trust region. δ
grows where steps are shortened, falls where they are not, and never reaches zero. A step is accepted if the
line search finds a decrease of the merit function: the barrier function plus the weighted constraint
violation. Where the first trial increases the violation, a second-order correction is tried. The merit
function is the one of Byrd, Hribar and Nocedal, "An interior point algorithm for large-scale nonlinear
programming", 1999. Each slack is limited by its own fraction-to-the-boundary rule, and is raised to −c(x)
after a step where that is larger. The matrix has a band and a border, as the variables of a path's segments
give it. Most of the time of a step goes into second derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.bordered_band import BorderedBand
from aerobat.optimization.deadline import count_work, out_of_time

_BOUND_PUSH = 1e-2  # distance of the start from the bounds of the box, as a fraction of its width
_FRACTION_TO_BOUNDARY = 0.99  # longest step towards a zero multiplier or the edge of the box
_MIN_SLACK_FRACTION = 0.1  # smallest fraction of a slack that a step leaves
_BARRIER_SOLVED = 10.0  # μ is decreased when the error of the barrier problem is below this multiple of μ
_BARRIER_FALL = 0.2  # factor of μ at each decrease
_BARRIER_POWER = 1.5  # exponent of μ at each decrease; the smaller of the two results is used
_DAMPING_GROWTH = 4.0  # factor of δ where the matrix is not positive definite or a step is shortened
_DAMPING_DECAY = 3.0  # divisor of δ after a whole step
_DAMPING_JUMP = 10.0  # factor of δ where no length of a step is accepted
_MOST_DAMPING = 1.0  # largest δ that shortened steps lead to
_LARGEST_DAMPING = 1e10  # δ at which the method gives up a step
_SHORT_STEP = 0.2  # step length to the edge of the box below which δ is raised first
_JAMMED = 1e-3  # step length below which slacks and multipliers are initialized anew
_BACKTRACKS = 10  # step lengths tried by the line search, each half the previous one
_CORRECTIONS = 3  # second-order corrections in a row
_SLOW_CORRECTION = 0.99  # a correction that leaves a larger fraction of the violation is the last one
_ARMIJO = 1e-4  # sufficient decrease (Armijo), as a fraction of the predicted decrease
_LEAST_WEIGHT = 1e-3  # smallest weight of the violation in the merit function
# fraction of the decrease of the weighted violation by which the barrier function may rise
_PENALTY_FRACTION = 0.5
_ROUNDING = 1e-12  # increase of the merit function that counts as rounding
_CORRIDOR = 1e10  # largest factor between s z and μ
# weight of EᵀE added to the matrix, relative to its largest entry, for the rows of E whose squares fit there
_EQUALITY_WEIGHT = 1e-2
_ITERATIONS_FLAT = 3  # iterations over which the cost must not change
_LARGE_MULTIPLIER = 100.0  # average multiplier above which the dual error is scaled down
# work [s] of a trial point and of a step's equations: of each, and more by its number of inequalities
# (benchmarks/work.py)
_POINT_WORK, _POINT_VALUE_WORK = 0.12e-3, 0.02e-6
_STEP_WORK, _STEP_VALUE_WORK = 1.3e-3, 0.26e-6


class ConstraintRows(Protocol):
    """The Jacobian C (q, n) of the inequalities, in any storage format."""

    def times(self, step: Array) -> Array:
        """Return C d, (q,)."""

    def transposed(self, weights: Array) -> Array:
        """Return Cᵀ w, (n,)."""


class ConstrainedPoint(Protocol):
    """The constraints of a program, evaluated at a point."""

    @property
    def inequalities(self) -> Array:
        """The values c, (q,); infinite where the point is outside the domain of the constraints."""

    @property
    def equalities(self) -> Array:
        """The values e, (p,)."""

    @property
    def rows(self) -> ConstraintRows:
        """The Jacobian of the inequalities."""

    @property
    def equality_rows(self) -> Array:
        """The Jacobian E of the equalities, (p, n)."""

    def curvature(self, inequality_weights: Array, equality_weights: Array, squares: Array) -> BorderedBand:
        """Return the second derivatives of the weighted constraints plus Cᵀ diag(squares) C, (n, n)."""


class ConstrainedProgram(Protocol):
    """A linear cost to be minimized under constraints. Variables are scaled to a size of about one."""

    @property
    def cost(self) -> Array:
        """The gradient g, (n,)."""

    @property
    def box(self) -> tuple[Array, Array]:
        """The lower and upper bounds of the variables, (n,) each."""

    def at(self, x: Array) -> ConstrainedPoint:
        """Return the constraints at a point."""


@dataclass(frozen=True)
class Settings:
    """Settings of the method: accuracy, number of iterations and barrier parameters."""

    barrier: float = 1e-5  # initial μ: the barrier of a thousand limits stays small beside a cost of one
    least_barrier: float = 1e-6  # final μ
    least_slack: float = 1e-2  # smallest initial slack
    damping: float = 1e-4  # smallest δ
    iterations: int = 60
    tolerance: float = 1e-4  # tolerance of all optimality conditions
    violation: float = 1e-3  # largest violation at which a cost that no longer changes counts as converged
    gain: float = 1e-3  # change of the cost, over some iterations, below which the cost counts as unchanged


@dataclass(frozen=True, eq=False)
class InteriorPointResult:
    """The last iterate of the method, with its multipliers."""

    x: Array
    converged: bool  # all conditions hold, or the cost no longer changes and the violation is small
    iterations: int
    z: Array  # multipliers of the inequalities


@dataclass(eq=False)
class _Iterate:
    """A point with its slacks and multipliers."""

    x: Array
    point: ConstrainedPoint
    slacks: Array
    z: Array  # multipliers of the inequalities
    y: Array  # multipliers of the equalities
    z_lower: Array
    z_upper: Array

    def dual_residual(self, cost: Array) -> Array:
        """Return the gradient of the Lagrangian, (n,)."""
        if self._dual_residual is None:
            rows = self.point.rows.transposed(self.z) + self.point.equality_rows.T @ self.y
            self._dual_residual = np.asarray(cost + rows - self.z_lower + self.z_upper)
        return self._dual_residual

    _dual_residual: Array | None = None


@dataclass(eq=False)
class _Step:
    """Changes of an iterate."""

    x: Array
    slacks: Array
    z: Array
    y: Array


class _Value(NamedTuple):
    """The two terms of the merit function."""

    violation: float
    barrier: float  # the barrier function


class _Trial(NamedTuple):
    """A trial point of the line search."""

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
    """Return a local minimum near a start, or the last iterate when iterations or time end.

    The result may be infeasible. Points outside the domain, or on the edge of the box, count as infinite.

    Args:
        program: The program to minimize.
        start: The initial point, (n,).
        settings: Accuracy, number of iterations and barrier parameters.
        multipliers: Multipliers of the inequalities from a similar program (warm start).
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
        """Iterate from a start until convergence or a limit."""
        iterate, costs, jammed = self._initial_iterate(start, multipliers), [], False
        if not np.isfinite(iterate.point.inequalities).all():
            return InteriorPointResult(iterate.x, False, 0, iterate.z)  # no step can be computed from here
        for iteration in range(self._settings.iterations):
            costs.append(float(self._cost @ iterate.x))
            if self._error(iterate, 0.0) < self._settings.tolerance or self._has_flat_cost(iterate, costs):
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
                self._restart(iterate)
        return InteriorPointResult(iterate.x, False, self._settings.iterations, iterate.z)

    def _initial_iterate(self, start: Array, multipliers: Array | None) -> _Iterate:
        """Return the first iterate: the start inside the box, with slacks and multipliers that match μ."""
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
        """Return the largest error of the optimality conditions for a barrier parameter."""
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

    def _has_flat_cost(self, at: _Iterate, costs: list[float]) -> bool:
        """Return True where the cost no longer changes, at a small violation and the final μ."""
        recent = costs[-_ITERATIONS_FLAT:]
        still = len(costs) > _ITERATIONS_FLAT and max(recent) - min(recent) < self._settings.gain
        at_end = self._barrier <= self._settings.least_barrier
        violation = max(float(at.point.inequalities.max(initial=0.0)), _largest(at.point.equalities))
        return still and at_end and violation < self._settings.violation

    def _lower_barrier(self, at: _Iterate) -> None:
        least = self._settings.least_barrier
        while self._barrier > least and self._error(at, self._barrier) < _BARRIER_SOLVED * self._barrier:
            self._barrier = max(least, min(_BARRIER_FALL * self._barrier, self._barrier**_BARRIER_POWER))

    def _advance(self, at: _Iterate) -> bool:
        """Take one step. Return False where no step is accepted, even with the largest damping."""
        count_work(_STEP_WORK + _STEP_VALUE_WORK * len(at.z))
        equations = _Equations(at, self)
        before = self._value(at.x, at.slacks, at.point)
        while self._damping < _LARGEST_DAMPING:
            if not equations.factorize(self._damping):
                self._damping *= _DAMPING_GROWTH
                continue
            found = self._accepted(at, equations, before)
            if found is not None:
                self._move(at, *found)
                if found[1] < _JAMMED:
                    self._restart(at)
                return True
            self._damping *= _DAMPING_JUMP
        return False

    def _restart(self, at: _Iterate) -> None:
        """Move slacks away from zero, and reset multipliers to match μ, where steps have become too short."""
        at.slacks = np.maximum(at.slacks, self._settings.least_slack)
        at.z, at._dual_residual = self._barrier / at.slacks, None
        self._damping = self._settings.damping

    def _accepted(
        self, at: _Iterate, equations: _Equations, before: _Value
    ) -> tuple[_Step, float, _Trial] | None:
        """Return a step, its length and its trial point, corrected or shortened; None if it is rejected."""
        residual = at.point.inequalities + at.slacks
        step = equations.step(residual, at.point.equalities)
        predicted, length = self._predicted_change(at, step), self._longest(at, step)
        if length < _SHORT_STEP and self._damping < _MOST_DAMPING:
            return None
        for halvings in range(_BACKTRACKS):
            trial = self._trial_point(at, step, length)
            if self._accepts(before, trial.value, predicted, length):
                self._adapt(is_whole=not halvings)
                return step, length, trial
            if not halvings and trial.value.violation >= before.violation:
                corrected = self._corrected(at, equations, trial, before, step, predicted)
                if corrected is not None:
                    self._adapt(is_whole=True)
                    return corrected
            length *= 0.5
        return None

    def _accepts(self, before: _Value, after: _Value, predicted: float, length: float) -> bool:
        """Return True where a step lowers the merit function enough (Armijo condition).

        The weight of the violation is raised first where the `predicted` change of the barrier function, for
        a whole step of length 1, needs it.
        """
        if predicted > 0.0 and before.violation > 0.0:
            least = predicted / (_PENALTY_FRACTION * before.violation)
            self._violation_weight = max(self._violation_weight, least)
        merits = [each.barrier + self._violation_weight * each.violation for each in (before, after)]
        fall = min(predicted - self._violation_weight * before.violation, 0.0)
        return merits[1] <= merits[0] + _ARMIJO * length * fall + _ROUNDING

    def _adapt(self, is_whole: bool) -> None:
        """Decrease the damping after a whole step, increase it after a shortened one."""
        if is_whole:
            self._damping = max(self._damping / _DAMPING_DECAY, self._settings.damping)
        else:
            self._damping = max(self._damping, min(self._damping * _DAMPING_GROWTH, _MOST_DAMPING))

    def _corrected(
        self,
        at: _Iterate,
        equations: _Equations,
        trial: _Trial,
        before: _Value,
        step: _Step,
        predicted: float,
    ) -> tuple[_Step, float, _Trial] | None:
        """Return a rejected step with second-order correction; None where that is rejected, too."""
        longest = length = self._longest(at, step)
        residual, equal = at.point.inequalities + at.slacks, at.point.equalities
        violation = np.inf
        for _ in range(_CORRECTIONS):
            if not np.isfinite(trial.point.inequalities).all():
                return None
            residual = length * residual + trial.point.inequalities + at.slacks + length * step.slacks
            equal = length * equal + trial.point.equalities
            step = equations.step(residual, equal)
            length = self._longest(at, step)
            trial = self._trial_point(at, step, length)
            if self._accepts(before, trial.value, predicted, longest):
                return step, length, trial
            if trial.value.violation > _SLOW_CORRECTION * violation:
                return None
            violation = trial.value.violation
        return None

    def _trial_point(self, at: _Iterate, step: _Step, length: float) -> _Trial:
        """Return the trial point of a step, with slacks of at least −c(x).

        No slack falls below a fraction of its value (fraction to the boundary).
        """
        x = at.x + length * step.x
        point = self._program.at(x)
        count_work(_POINT_WORK + _POINT_VALUE_WORK * len(point.inequalities))
        falling = np.maximum(at.slacks + length * step.slacks, _MIN_SLACK_FRACTION * at.slacks)
        slacks = np.maximum(falling, -point.inequalities)
        return _Trial(x, slacks, point, self._value(x, slacks, point))

    def _value(self, x: Array, slacks: Array, point: ConstrainedPoint) -> _Value:
        """Return the violation (infinite where it is not a number) and the barrier function."""
        violation = float(np.abs(point.inequalities + slacks).sum() + np.abs(point.equalities).sum())
        logarithms = np.log(slacks).sum() + np.log((x - self._lower) * (self._upper - x)).sum()
        barrier = float(self._cost @ x - self._barrier * logarithms)
        return _Value(violation if np.isfinite(violation) else np.inf, barrier)

    def _predicted_change(self, at: _Iterate, step: _Step) -> float:
        lower, upper = at.x - self._lower, self._upper - at.x
        along = (step.slacks / at.slacks).sum() + (step.x / lower).sum() - (step.x / upper).sum()
        return float(self._cost @ step.x - self._barrier * along)

    def _longest(self, at: _Iterate, step: _Step) -> float:
        """Return the longest step that keeps the point inside the box."""
        return min(
            _step_to_boundary(at.x - self._lower, step.x), _step_to_boundary(self._upper - at.x, -step.x)
        )

    def _move(self, at: _Iterate, step: _Step, length: float, trial: _Trial) -> None:
        """Apply an accepted step. Multipliers move by their own step length, which keeps them positive."""
        lower, upper = at.x - self._lower, self._upper - at.x
        by_lower = self._barrier / lower - at.z_lower - at.z_lower / lower * step.x
        by_upper = self._barrier / upper - at.z_upper + at.z_upper / upper * step.x
        dual = min(
            _step_to_boundary(at.z, step.z),
            _step_to_boundary(at.z_lower, by_lower),
            _step_to_boundary(at.z_upper, by_upper),
        )
        at.x, at.slacks, at.point, _ = trial
        at.y, at._dual_residual = at.y + length * step.y, None
        at.z = self._near_central_path(at.z + dual * step.z, at.slacks)
        at.z_lower = self._near_central_path(at.z_lower + dual * by_lower, at.x - self._lower)
        at.z_upper = self._near_central_path(at.z_upper + dual * by_upper, self._upper - at.x)

    def _near_central_path(self, multipliers: Array, distances: Array) -> Array:
        """Return the multipliers, clipped so that their products with `distances` stay near μ."""
        central = self._barrier / distances
        return np.clip(multipliers, central / _CORRIDOR, central * _CORRIDOR)


class _Equations:
    """The linear equations (KKT system) of the steps from one iterate."""

    def __init__(self, at: _Iterate, method: _InteriorPoint) -> None:
        lower, upper = at.x - method._lower, method._upper - at.x
        matrix = at.point.curvature(at.z, at.y, at.z / at.slacks)
        matrix = matrix.plus_diagonal(at.z_lower / lower + at.z_upper / upper)
        self._equal = at.point.equality_rows
        weight = _EQUALITY_WEIGHT * max(1.0, np.abs(matrix.diagonal).max())
        fits = matrix.pattern.has_squares(self._equal)
        self._weights = np.where(fits, weight, 0.0)
        self._matrix = matrix.plus_squares(self._equal[fits], weight)
        barrier = self._barrier = method._barrier
        self._residual = method._cost + self._equal.T @ at.y - barrier * (1.0 / lower - 1.0 / upper)
        self._at = at

    def factorize(self, damping: float) -> bool:
        """Factorize the damped matrix. Return False where it is not positive definite."""
        factors = self._matrix.plus_diagonal(damping).cholesky()
        if factors is None:
            return False
        self._factors = factors
        self._moved = factors.forward(self._equal.T)
        self._schur = self._moved.T @ self._moved + 1e-14 * np.eye(len(self._equal))
        return True

    def step(self, residual: Array, equal: Array) -> _Step:
        """Return the step that removes `residual` = c + s (q,) and `equal` = e (p,)."""
        at = self._at
        sigma, central = at.z / at.slacks, self._barrier / at.slacks
        right = -self._residual - at.point.rows.transposed(central + sigma * residual)
        right -= self._equal.T @ (self._weights * equal)
        x = self._factors.solve(right)
        y = np.asarray(np.linalg.solve(self._schur, self._equal @ x + equal), dtype=float)
        x = x - self._factors.backward(self._moved @ y)
        slacks = -residual - at.point.rows.times(x)
        return _Step(x, slacks, central - at.z - sigma * slacks, y)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _step_to_boundary(values: Array, changes: Array) -> float:
    """Return the step length, at most 1, that keeps positive values positive."""
    fall = float((-changes / values).max(initial=0.0))
    return _FRACTION_TO_BOUNDARY / fall if fall > _FRACTION_TO_BOUNDARY else 1.0
