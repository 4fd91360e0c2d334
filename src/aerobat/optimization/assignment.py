"""An assignment program: a convex QP plus stages, each assigned to one slot.

    minimize    xᵀ x
    subject to  E x = target                   (equality rows)
                lower <= A x <= upper          (range rows; infinite bounds never bind)
                every stage has one of its slots, no two stages the same slot, some stages in order.

A stage in a slot tightens the bounds of a few range rows. This module is data only: it does not depend on
robots or solvers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, Indices, Mask, frozen, frozen_bounds
from aerobat.errors import SpecError


@dataclass(frozen=True, eq=False)
class SlottedStage:
    """Bounds that hold at exactly one slot: slots[i] tightens range rows rows[i] to [lower[i], upper[i]].

    A stage with one slot is fixed. `lower` and `upper` are broadcast to the shape of `rows`. Inconsistent
    arguments raise SpecError.
    """

    name: str
    slots: tuple[int, ...]  # (s,) distinct
    rows: Indices  # (s, k) of the program's range rows
    lower: Array  # (s, k)
    upper: Array  # (s, k)

    def __post_init__(self) -> None:
        """Copy, write-protect and check."""
        slots = tuple(map(int, self.slots))
        rows = _indices(self.rows, f"stage '{self.name}': rows")
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
        """Return the index of `slot` in `slots`; raise SpecError where the slot is not one of them."""
        if slot not in self.slots:
            raise SpecError(f"stage '{self.name}' cannot sit in slot {slot}; its slots are {self.slots}")
        return self.slots.index(slot)

    def restricted(self, places: Sequence[int]) -> SlottedStage:
        """Return the stage with only the slots at some indices of `slots`."""
        at = list(places)
        slots = tuple(self.slots[k] for k in at)
        return SlottedStage(self.name, slots, self.rows[at], self.lower[at], self.upper[at])


@dataclass(frozen=True, eq=False)
class AssignmentProgram:
    """A convex QP with slotted stages.

    Programs that share their write-protected matrices, e.g. copies made by `dataclasses.replace`, also share
    a solver's factorizations. Inconsistent arguments raise SpecError.
    """

    equality: Array  # E (p, n)
    target: Array  # (p,)
    rows: Array  # A (m, n)
    lower: Array  # (m,)
    upper: Array  # (m,)
    stages: tuple[SlottedStage, ...] = ()
    precedence: tuple[tuple[int, int], ...] = ()  # (i, j): stage i has a smaller slot than stage j

    def __post_init__(self) -> None:
        """Copy, write-protect and check."""
        rows = _shared(self.rows, "rows", (None, None))
        equality = _shared(self.equality, "equality", (None, rows.shape[1]))
        _set(self, rows=rows, equality=equality)
        _set(self, target=_shared(self.target, "target", (len(equality),)))
        _set(self, lower=_bounds(self.lower, "lower", "lower", (len(rows),)))
        _set(self, upper=_bounds(self.upper, "upper", "upper", (len(rows),)))
        _set(self, stages=tuple(self.stages), precedence=tuple((int(i), int(j)) for i, j in self.precedence))
        self._check_stages()

    def _check_stages(self) -> None:
        m = len(self.rows)
        for stage in self.stages:
            if stage.rows.size and not 0 <= stage.rows.min() <= stage.rows.max() < m:
                raise SpecError(
                    f"stage '{stage.name}': rows must lie in 0..{m - 1}, the program's range rows"
                )
        stages = len(self.stages)
        if any(not 0 <= k < stages for pair in self.precedence for k in pair):
            raise SpecError(f"precedence must name stages 0..{stages - 1}, got {self.precedence}")

    @property
    def num_variables(self) -> int:
        """The number of variables n."""
        return int(self.rows.shape[1])

    @cached_property
    def precedes(self) -> Mask:
        """The transitive closure of `precedence`, (S, S): [i, j] says that stage i comes before stage j."""
        precedes = np.zeros((len(self.stages),) * 2, dtype=bool)
        for i, j in self.precedence:
            precedes[i, j] = True
        for k in range(len(precedes)):
            precedes |= np.outer(precedes[:, k], precedes[k])
        precedes.flags.writeable = False
        return precedes

    @property
    def is_totally_ordered(self) -> bool:
        """True if `precedence` orders all stages as they are listed."""
        return all(self.precedes[i, i + 1] for i in range(len(self.stages) - 1))

    def cost(self, x: Array) -> float:
        """Return xᵀ x."""
        return float(x @ x)

    def is_assignment(self, slots: Sequence[int]) -> bool:
        """Tell if `slots`, one for each stage, are allowed slots, distinct and in order."""
        own = all(slot in stage.slots for stage, slot in zip(self.stages, slots, strict=True))
        return own and len(set(slots)) == len(slots) and all(slots[i] < slots[j] for i, j in self.precedence)

    def check_start(self, start: Sequence[int] | None) -> None:
        """Raise SpecError unless `start` is None or has one slot for each stage."""
        if start is not None and len(start) != len(self.stages):
            raise SpecError(
                f"start must have one slot for each of the {len(self.stages)} stages, got {start}"
            )

    def bounds_for(self, slots: Sequence[int | None]) -> tuple[Array, Array]:
        """Return the bounds (lower, upper) of the range rows with stage i in slots[i]; None omits a stage."""
        lower = self.lower.copy()
        upper = self.upper.copy()
        for stage, slot in zip(self.stages, slots, strict=True):
            if slot is not None:
                i = stage.index(slot)
                np.maximum.at(lower, stage.rows[i], stage.lower[i])
                np.minimum.at(upper, stage.rows[i], stage.upper[i])
        return lower, upper

    @property
    def root_bounds(self) -> tuple[Array, Array]:
        """The bounds (lower, upper) of the range rows with all stages of a single slot in place."""
        return self.bounds_for([stage.slots[0] if len(stage.slots) == 1 else None for stage in self.stages])

    def violation(self, x: Array, slots: Sequence[int]) -> float:
        """Return the largest residual of any row a x <= b, relative to |a| |x| + |b|, for stages in `slots`.

        The result is infinite where `slots` are not a valid assignment.
        """
        if not self.is_assignment(slots):
            return inf
        lower, upper = self.bounds_for(slots)
        values = self.rows @ x
        below = lower - values
        above = values - upper
        norm = float(np.linalg.norm(x))
        return max(
            _relative(np.maximum(below, above), self.rows, norm, np.where(below > above, lower, upper)),
            _relative(np.abs(self.equality @ x - self.target), self.equality, norm, self.target),
        )


def row_norms(rows: Array) -> Array:
    """Return the Euclidean norm of each row."""
    squares: Array = np.einsum("ij,ij->i", rows, rows)
    return np.sqrt(squares)


def unit_rows(matrix: Array) -> tuple[Array, Array]:
    """Return the norm of each row (1 for zero rows), and the rows divided by their norms."""
    norms = row_norms(matrix)
    norms = np.where(norms > 0.0, norms, 1.0)
    return norms, matrix / norms[:, None]


def _relative(residual: Array, rows: Array, x_norm: float, bound: Array) -> float:
    """Return the largest positive residual relative to |row| |x| + |bound|."""
    positive = np.flatnonzero(residual > 0.0)
    scale = row_norms(rows[positive]) * x_norm + np.abs(bound[positive])
    return float((residual[positive] / scale).max(initial=0.0))


def _set(value: object, **fields: object) -> None:
    for name, field in fields.items():
        object.__setattr__(value, name, field)


def _shared(value: ArrayLike, name: str, shape: Sequence[int | None]) -> Array:
    """Return a read-only array as `frozen` does, without copying arrays that are already write-protected.

    Solvers cache factorizations by the identity of these arrays.
    """
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.base is None:
        fits = value.ndim == len(shape) and all(
            n in (None, m) for n, m in zip(shape, value.shape, strict=True)
        )
        if fits and not value.flags.writeable and np.isfinite(value).all():
            return value
    return _without_leading_axes(frozen(value, name, shape), name, shape)


def _without_leading_axes(array: Array, name: str, shape: Sequence[int | None]) -> Array:
    if array.ndim != len(shape):
        raise SpecError(f"{name} must have no more axes than {len(shape)}, got the shape {array.shape}")
    return array


def _bounds(value: ArrayLike, name: str, side: str, shape: tuple[int] | None = None) -> Array:
    bounds = frozen_bounds(value, name, shape)
    if shape is not None:
        _without_leading_axes(bounds, name, shape)
    never = inf if side == "lower" else -inf
    if (bounds == never).any():
        raise SpecError(f"{name} must not be {never}, which nothing satisfies")
    return bounds


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
