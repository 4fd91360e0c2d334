"""Exact derivatives by forward-mode differentiation: kernels run on dual numbers of any arithmetic.

A dual number is a value and its tangent along one direction. Kernels do not depend on the type of their
numbers, so every engine can also run their derivatives: the loop over time is wrapped, not the engine.
Several directions are run as several vehicles, side by side.

At a kink the tangent is one-sided; the tangent of the square root at zero is defined as zero.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree, tree_leaves, tree_unflatten
from aerobat.kernels.ops import Ops, Scalar


def _compared(compare: Callable[[Any, Any], Any]) -> Callable[[Dual, Any], Any]:
    """Return the comparison of a dual number by its value."""
    return lambda self, other: compare(self.value, _parts(other)[0])


@dataclass(frozen=True, eq=False, slots=True)
class Dual:
    """A value and its tangent; None for a tangent that is always zero."""

    value: Scalar
    tangent: Scalar | None = None

    __array_ufunc__ = None  # makes NumPy use the operators of this class

    def __neg__(self) -> Dual:
        return Dual(-self.value, None if self.tangent is None else -self.tangent)

    def __add__(self, other: Any) -> Dual:
        x, tangent = _parts(other)
        return Dual(self.value + x, _sum(self.tangent, tangent))

    def __radd__(self, other: Any) -> Dual:
        return dual(other) + self

    def __sub__(self, other: Any) -> Dual:
        x, tangent = _parts(other)
        return Dual(self.value - x, _difference(self.tangent, tangent))

    def __rsub__(self, other: Any) -> Dual:
        return dual(other) - self

    def __mul__(self, other: Any) -> Dual:
        x, tangent = _parts(other)
        return Dual(self.value * x, _sum(_product(self.tangent, x), _product(tangent, self.value)))

    def __rmul__(self, other: Any) -> Dual:
        return dual(other) * self

    def __truediv__(self, other: Any) -> Dual:
        x, tangent = _parts(other)
        quotient = self.value / x
        change = _difference(self.tangent, _product(tangent, quotient))
        return Dual(quotient, None if change is None else change / x)

    def __rtruediv__(self, other: Any) -> Dual:
        return dual(other) / self

    def __pow__(self, exponent: int) -> Dual:
        return Dual(self.value**exponent, _product(self.tangent, exponent * self.value ** (exponent - 1)))

    __eq__, __ne__ = _compared(operator.eq), _compared(operator.ne)
    __lt__, __le__ = _compared(operator.lt), _compared(operator.le)
    __gt__, __ge__ = _compared(operator.gt), _compared(operator.ge)
    __hash__ = object.__hash__


def dual(x: Any) -> Dual:
    """Return a dual number unchanged, or any other number without a tangent."""
    return x if isinstance(x, Dual) else Dual(x)


@dataclass(frozen=True)
class DualOps:
    """The operations of kernels on dual numbers, over those of their parts."""

    ops: Ops

    def sqrt(self, x: Any) -> Dual:
        """Return the square root."""
        value, tangent = _parts(x)
        root = self.ops.sqrt(value)
        if tangent is None:
            return Dual(root)
        positive = root > 0.0
        rate = 0.5 / self.ops.select(positive, root, 1.0)
        return Dual(root, self.ops.select(positive, rate * tangent, 0.0))

    def exp(self, x: Any) -> Dual:
        """Return the exponential."""
        value, tangent = _parts(x)
        power = self.ops.exp(value)
        return Dual(power, _product(tangent, power))

    def minimum(self, x: Any, y: Any) -> Dual:
        """Return the smaller of two; the tangent is the second's where they are equal."""
        x, y = dual(x), dual(y)
        return Dual(self.ops.minimum(x.value, y.value), self._either(x < y, x, y))

    def maximum(self, x: Any, y: Any) -> Dual:
        """Return the larger of two; the tangent is the second's where they are equal."""
        x, y = dual(x), dual(y)
        return Dual(self.ops.maximum(x.value, y.value), self._either(x > y, x, y))

    def select(self, condition: Any, x: Any, y: Any) -> Dual:
        """Return `x` if the condition holds, else `y`."""
        condition, x, y = _parts(condition)[0], dual(x), dual(y)
        return Dual(self.ops.select(condition, x.value, y.value), self._either(condition, x, y))

    def _either(self, condition: Any, x: Dual, y: Dual) -> Scalar | None:
        """Return the tangent of `x` if the condition holds, else that of `y`."""
        if x.tangent is None and y.tangent is None:
            return None
        return self.ops.select(condition, _number(x.tangent), _number(y.tangent))


@lru_cache(maxsize=32)
def differentiated(init: Init, step: Step) -> tuple[Init, Step]:
    """Return the loop whose rows are pairs: the rows of the given loop, and their tangents.

    Its parameters and inputs are pairs (values, tangents), too. Tangents are a tuple with an entry for each
    leaf of the values, from left to right. For parameters and inputs an entry may be `()`, for no tangent.
    """

    def begin(ops: Ops, parameters: Tree, row: Tree) -> Tree:
        return _split_pairs(init(DualOps(ops), _as_duals(parameters), _as_duals(row)))

    def advance(ops: Ops, parameters: Tree, carry: Tree, row: Tree) -> tuple[Tree, Tree]:
        carry, output = step(DualOps(ops), _as_duals(parameters), _as_duals(carry), _as_duals(row))
        return _split_pairs(carry), _split_pairs(output)

    return begin, advance


def _as_duals(pair: Tree) -> Tree:
    """Return values and tangents as dual numbers."""
    values, tangents = pair
    optional = (None if isinstance(tangent, tuple) else tangent for tangent in tangents)
    return tree_unflatten(values, map(Dual, tree_leaves(values), optional))


def _split_pairs(tree: Tree) -> Tree:
    """Return dual numbers as values and tangents."""
    numbers = [value_and_tangent(leaf) for leaf in tree_leaves(tree)]
    return tree_unflatten(tree, (value for value, _ in numbers)), tuple(tangent for _, tangent in numbers)


def value_and_tangent(x: Any) -> tuple[Scalar, Scalar]:
    """Return both parts of a number, with zero for a missing tangent."""
    value, tangent = _parts(x)
    return value, _number(tangent)


def _parts(x: Any) -> tuple[Scalar, Scalar | None]:
    return (x.value, x.tangent) if isinstance(x, Dual) else (x, None)


def _number(tangent: Scalar | None) -> Scalar:
    return 0.0 if tangent is None else tangent


def _sum(a: Scalar | None, b: Scalar | None) -> Scalar | None:
    if a is None or b is None:
        return b if a is None else a
    return a + b


def _difference(a: Scalar | None, b: Scalar | None) -> Scalar | None:
    if a is None or b is None:
        return a if b is None else -b
    return a - b


def _product(tangent: Scalar | None, factor: Scalar) -> Scalar | None:
    return None if tangent is None else tangent * factor
