"""The arithmetic of kernels, besides + - * / and comparisons.

A kernel does not depend on the type of its numbers: Python floats, NumPy arrays with one entry a vehicle,
tracers of a compiler, dual numbers. An engine provides the matching `Ops`.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias, TypeVar

Scalar: TypeAlias = Any  # any number type of an engine; every operation is elementwise
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Quaternion: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar]  # Hamilton, (w, x, y, z)
Matrix: TypeAlias = tuple[Vector, Vector, Vector]  # rows
Axes: TypeAlias = tuple[Vector, Vector, Vector]  # b1, b2, b3 in the world
PerRotor: TypeAlias = tuple[Scalar, ...]
T = TypeVar("T")
TINY = 1e-300  # added to a divisor: avoids 0/0 and changes no other quotient


class Ops(Protocol):
    """Elementwise functions of one engine; none branches on a value."""

    def sqrt(self, x: Scalar, /) -> Scalar:
        """Return the square root of x >= 0."""

    def exp(self, x: Scalar, /) -> Scalar:
        """Return the exponential."""

    def minimum(self, x: Scalar, y: Scalar, /) -> Scalar:
        """Return the smaller of two."""

    def maximum(self, x: Scalar, y: Scalar, /) -> Scalar:
        """Return the larger of two."""

    def select(self, condition: Scalar, x: Scalar, y: Scalar, /) -> Scalar:
        """Return `x` where the condition holds, else `y`; both are computed."""


def clip(ops: Ops, x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """Return `x` clipped to [low, high]."""
    return ops.minimum(ops.maximum(x, low), high)


def magnitude(ops: Ops, x: Scalar) -> Scalar:
    """Return |x|."""
    return ops.maximum(x, -x)


def select_tree(ops: Ops, condition: Scalar, x: T, y: T) -> T:
    """Return `x` where the condition holds, else `y`: numbers, or nested tuples of numbers."""
    if not isinstance(x, tuple) or not isinstance(y, tuple):
        chosen: T = ops.select(condition, x, y)
        return chosen
    children = [select_tree(ops, condition, a, b) for a, b in zip(x, y, strict=True)]
    return tuple.__new__(type(x), children)  # named tuples too
