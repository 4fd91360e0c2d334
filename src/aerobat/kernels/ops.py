"""The arithmetic that kernels are written in, besides + - * / and comparisons.

A kernel never asks what its numbers are: Python floats, NumPy arrays with one entry a vehicle, tracers
of a compiler, dual numbers. An engine hands it the matching `Ops`.
"""

from __future__ import annotations

from typing import Any, Protocol, TypeAlias, TypeVar

Scalar: TypeAlias = Any  # whatever an engine computes with; every operation is element by element
Vector: TypeAlias = tuple[Scalar, Scalar, Scalar]
Quaternion: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar]  # Hamilton, (w, x, y, z)
Matrix: TypeAlias = tuple[Vector, Vector, Vector]  # rows
Axes: TypeAlias = tuple[Vector, Vector, Vector]  # b1, b2, b3 in the world
PerRotor: TypeAlias = tuple[Scalar, ...]
T = TypeVar("T")
TINY = 1e-300  # beside a divisor: keeps 0/0 away and changes no other quotient


class Ops(Protocol):
    """Element-wise functions of one engine; none branches on a value."""

    def sqrt(self, x: Scalar, /) -> Scalar:
        """The square root of x >= 0."""

    def exp(self, x: Scalar, /) -> Scalar:
        """The exponential."""

    def minimum(self, x: Scalar, y: Scalar, /) -> Scalar:
        """The smaller of two."""

    def maximum(self, x: Scalar, y: Scalar, /) -> Scalar:
        """The larger of two."""

    def select(self, condition: Scalar, x: Scalar, y: Scalar, /) -> Scalar:
        """`x` where the condition holds, `y` elsewhere; both are computed."""


def clip(ops: Ops, x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """`x` held within [low, high]."""
    return ops.minimum(ops.maximum(x, low), high)


def magnitude(ops: Ops, x: Scalar) -> Scalar:
    """|x|."""
    return ops.maximum(x, -x)


def select_tree(ops: Ops, condition: Scalar, x: T, y: T) -> T:
    """`x` where the condition holds, `y` elsewhere: numbers, or tuples of such of any depth."""
    if not isinstance(x, tuple) or not isinstance(y, tuple):
        chosen: T = ops.select(condition, x, y)
        return chosen
    children = [select_tree(ops, condition, a, b) for a, b in zip(x, y, strict=True)]
    return tuple.__new__(type(x), children)  # named tuples too
