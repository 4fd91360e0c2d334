"""A convex QP plus stages, each assigned to one slot: the problem as data, and the answer checked against it.

    minimize    ½ xᵀ H x + fᵀ x + c
    subject to  E x = target                   (equality rows)
                lower <= A x <= upper          (range rows; infinite bounds never bind)
                every stage sits in one of its slots, no two in the same slot, some in order

A stage that sits in a slot tightens the bounds of a few range rows. Nothing here knows robots or solvers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat.arrays import Array, frozen, frozen_bounds
from aerobat.errors import SpecError

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Status = Literal["optimal", "time_limit", "infeasible", "unknown"]

TOLERANCE = 1e-6  # the violation of a row a x <= b, relative to |a| |x| + |b|, that a solution may have


@dataclass(frozen=True, eq=False)
class SlottedStage:
    """What must hold at exactly one slot: in slots[i] it tightens range rows rows[i] to [lower[i], upper[i]].

    A stage with one slot is fixed. `lower` and `upper` may be anything that broadcasts to the shape of
    `rows`. Raises SpecError for what does not fit together.
    """

    name: str
    slots: tuple[int, ...]  # (s,) distinct
    rows: Indices  # (s, k) of the program's range rows
    lower: Array  # (s, k)
    upper: Array  # (s, k)

    def __post_init__(self) -> None:
        """Copy, write-protect and check."""
        slots, rows = tuple(map(int, self.slots)), _indices(self.rows, f"stage '{self.name}': rows")
        if not slots or len(set(slots)) != len(slots):
            raise SpecError(f"stage '{self.name}': slots must be distinct, at least one, got {slots}")
        if rows.ndim != 2 or len(rows) != len(slots):
            raise SpecError(
                f"stage '{self.name}': rows must have one line for each of its {len(slots)} slots"
            )
        _set(self, slots=slots, rows=rows)
        for side in ("lower", "upper"):
            name = f"stage '{self.name}': {side}"
            _set(self, **{side: _broadcast(_bounds(getattr(self, side), name, side), rows.shape, name)})

    def index(self, slot: int) -> int:
        """The place of `slot` among `slots`; raises SpecError where the stage cannot sit there."""
        if slot not in self.slots:
            raise SpecError(f"stage '{self.name}' cannot sit in slot {slot}; its slots are {self.slots}")
        return self.slots.index(slot)


@dataclass(frozen=True, eq=False)
class AssignmentProgram:
    """The whole problem.

    Programs that share their matrices (made by `with_bounds`, or from the same write-protected arrays) share
    a solver's factorisations too. Raises SpecError for what does not fit together.
    """

    equality: Array  # E (p, n)
    target: Array  # (p,)
    rows: Array  # A (m, n)
    lower: Array  # (m,)
    upper: Array  # (m,)
    stages: tuple[SlottedStage, ...] = ()
    precedence: tuple[tuple[int, int], ...] = ()  # (i, j): the slot of stage i is below that of stage j
    hessian: Array | None = (
        None  # H (n, n) symmetric positive definite; None is 2 I, so that xᵀx is minimised
    )
    gradient: Array | None = None  # f (n,); None is 0
    constant: float = 0.0  # c

    def __post_init__(self) -> None:
        """Copy, write-protect and check."""
        rows = _matrix(self.rows, "rows", None)
        equality = _matrix(self.equality, "equality", rows.shape[1])
        _set(self, rows=rows, equality=equality)
        _set(self, target=frozen(self.target, "target", (len(equality),)))
        _set(self, lower=_bounds(self.lower, "lower", "lower", (len(rows),)))
        _set(self, upper=_bounds(self.upper, "upper", "upper", (len(rows),)))
        if self.hessian is not None:
            _set(self, hessian=_positive_definite(_matrix(self.hessian, "hessian", self.variables)))
        if self.gradient is not None:
            _set(self, gradient=frozen(self.gradient, "gradient", (self.variables,)))
        _set(self, stages=tuple(self.stages), precedence=tuple((int(i), int(j)) for i, j in self.precedence))
        self._check_stages()

    def _check_stages(self) -> None:
        m, stages = len(self.rows), len(self.stages)
        for stage in self.stages:
            if stage.rows.size and not 0 <= stage.rows.min() <= stage.rows.max() < m:
                raise SpecError(
                    f"stage '{stage.name}': rows must lie in 0..{m - 1}, the program's range rows"
                )
        if any(not 0 <= k < stages for pair in self.precedence for k in pair):
            raise SpecError(f"precedence must name stages 0..{stages - 1}, got {self.precedence}")

    @property
    def variables(self) -> int:
        """The number of variables n."""
        return int(self.rows.shape[1])

    @cached_property
    def before(self) -> Mask:
        """The transitive closure of `precedence`, (S, S): [i, j] says that stage i comes before stage j."""
        before = np.zeros((len(self.stages),) * 2, dtype=bool)
        for i, j in self.precedence:
            before[i, j] = True
        for k in range(len(before)):
            before |= np.outer(before[:, k], before[k])
        return before

    def with_bounds(
        self,
        *,
        target: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        stages: Sequence[SlottedStage] | None = None,
    ) -> AssignmentProgram:
        """The same matrices with other right-hand sides; what is left out stays."""
        given = {"target": target, "lower": lower, "upper": upper, "stages": stages}
        changes: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        return replace(self, **changes)

    def cost(self, x: Array) -> float:
        """½ xᵀ H x + fᵀ x + c."""
        quadratic = x @ x if self.hessian is None else 0.5 * (x @ self.hessian @ x)
        linear = 0.0 if self.gradient is None else self.gradient @ x
        return float(quadratic + linear + self.constant)

    @cached_property
    def _unconstrained(self) -> float:
        """|x| at the least cost of all."""
        if self.gradient is None:
            return 0.0
        least = self.gradient / 2.0 if self.hessian is None else np.linalg.solve(self.hessian, self.gradient)
        return float(np.linalg.norm(least))

    def admits(self, slots: Sequence[int]) -> bool:
        """Whether `slots`, one a stage, are the stages' own, distinct and in order."""
        own = all(slot in stage.slots for stage, slot in zip(self.stages, slots, strict=True))
        return own and len(set(slots)) == len(slots) and all(slots[i] < slots[j] for i, j in self.precedence)

    def check_start(self, start: Sequence[int] | None) -> None:
        """Raise SpecError unless `start` is None or has one slot a stage."""
        if start is not None and len(start) != len(self.stages):
            raise SpecError(
                f"start must have one slot for each of the {len(self.stages)} stages, got {start}"
            )

    def tightened(self, slots: Sequence[int | None]) -> tuple[Array, Array]:
        """The range rows' bounds (lower, upper) with stage i in slots[i]; None leaves that stage out."""
        lower, upper = self.lower.copy(), self.upper.copy()
        for stage, slot in zip(self.stages, slots, strict=True):
            if slot is not None:
                i = stage.index(slot)
                np.maximum.at(lower, stage.rows[i], stage.lower[i])
                np.minimum.at(upper, stage.rows[i], stage.upper[i])
        return lower, upper

    def violation(self, x: Array, slots: Sequence[int]) -> float:
        """The largest residual of any row a x <= b, relative to |a| |x| + |b|, the stages sitting in `slots`.

        |x| is taken no smaller than where the cost alone would lead. Infinite when `slots` are not admitted.
        """
        if not self.admits(slots):
            return inf
        lower, upper = self.tightened(slots)
        reached, missed = self.rows @ x, np.abs(self.equality @ x - self.target)
        below, above = lower - reached, reached - upper
        size = max(float(np.linalg.norm(x)), self._unconstrained)
        return max(
            _relative(np.maximum(below, above), self.rows, size, np.where(below > above, lower, upper)),
            _relative(missed, self.equality, size, self.target),
        )


@dataclass(frozen=True, eq=False)
class AssignmentResult:
    """What a solver found. Cost and violation are recomputed from the program, never taken from the solver.

    "optimal": x is feasible and no other costs less. "time_limit": the search ended early, x is the best
    found and within `gap` of the bound. "infeasible": there is no x. "unknown": none was found, which proves
    nothing.
    """

    status: Status
    x: Array | None  # (n,)
    slots: tuple[int, ...] | None  # one a stage
    cost: float  # infinite without x
    bound: float  # no solution costs less
    nodes: int  # relaxations solved
    time: float  # [s], as the solver itself reports it
    backend: str
    max_violation: float = 0.0  # of any row a x <= b, relative to |a| |x| + |b|

    @property
    def gap(self) -> float:
        """How much of the cost may still be saved: (cost − bound) / |cost|; infinite without x."""
        return inf if self.x is None else max(0.0, self.cost - self.bound) / max(abs(self.cost), 1e-12)


def certified(program: AssignmentProgram, claim: AssignmentResult) -> AssignmentResult:
    """A solver's claim with cost and violation recomputed from the program.

    An x that violates a row by more than TOLERANCE is dropped, and "optimal" with it.
    """
    if claim.x is None or claim.slots is None:
        return replace(claim, x=None, slots=None, cost=inf)
    violation = program.violation(claim.x, claim.slots)
    if not violation <= TOLERANCE:
        return replace(claim, status="unknown", x=None, slots=None, cost=inf, max_violation=violation)
    cost = program.cost(claim.x)
    x = frozen(claim.x, "x")
    return replace(claim, x=x, cost=cost, bound=min(claim.bound, cost), max_violation=violation)


def _relative(residual: Array, rows: Array, size: float, bound: Array) -> float:
    """The largest residual above zero, each relative to its row, its bound and the size of the variables."""
    over = np.flatnonzero(residual > 0.0)
    scale = lengths(rows[over]) * size + np.abs(bound[over])
    return float((residual[over] / scale).max(initial=0.0))


def lengths(rows: Array) -> Array:
    """The Euclidean length of each row."""
    squares: Array = np.einsum("ij,ij->i", rows, rows)
    return np.sqrt(squares)


def _set(value: object, **fields: object) -> None:
    for name, field in fields.items():
        object.__setattr__(value, name, field)


def _matrix(value: ArrayLike, name: str, columns: int | None) -> Array:
    """As `frozen`, but a matrix that is already write-protected is shared: solvers cache by its identity."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.base is None:
        fits = value.ndim == 2 and columns in (None, value.shape[1])
        if fits and not value.flags.writeable and np.isfinite(value).all():
            return value
    return frozen(value, name, (None, columns))


def _bounds(value: ArrayLike, name: str, side: str, shape: tuple[int] | None = None) -> Array:
    bounds, never = frozen_bounds(value, name, shape), inf if side == "lower" else -inf
    if (bounds == never).any():
        raise SpecError(f"{name} must not be {never}, which nothing satisfies")
    return bounds


def _positive_definite(hessian: Array) -> Array:
    if not np.allclose(hessian, hessian.T, rtol=1e-9, atol=1e-12):
        raise SpecError("hessian must be symmetric")
    try:
        np.linalg.cholesky(hessian)
    except np.linalg.LinAlgError:
        raise SpecError("hessian must be positive definite; add a small multiple of the identity") from None
    return hessian


def _indices(value: ArrayLike, name: str) -> Indices:
    array = np.array(value)
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise SpecError(f"{name} must be whole numbers")
    array = array.astype(np.intp)
    array.flags.writeable = False
    return array


def _broadcast(bound: Array, shape: tuple[int, ...], name: str) -> Array:
    try:
        return bound if bound.shape == shape else np.broadcast_to(bound, shape)  # read-only either way
    except ValueError:
        raise SpecError(f"{name} must fit rows, which has the shape {shape}, got {bound.shape}") from None
