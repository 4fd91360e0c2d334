"""Exact derivatives: kernels run on dual numbers, whatever those are made of.

A dual number is a value and its tangent along one direction. Kernels never ask what their numbers are, so an
engine that runs a kernel runs its derivative too: the loop over time is wrapped, not the engine. Several
directions are several vehicles, side by side.

Where a function has a kink, a tangent is that of one side; at zero the square root's is taken to be zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree, tree_leaves, tree_unflatten
from aerobat.kernels.ops import Ops, Scalar


@dataclass(frozen=True, eq=False, slots=True)
class Dual:
    """A value and its tangent, None where it has none whatever the values are."""

    value: Scalar
    tangent: Scalar | None = None

    __array_ufunc__ = None  # NumPy leaves arithmetic with it to it

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

    def __eq__(self, other: Any) -> Any:
        return self.value == _parts(other)[0]

    def __ne__(self, other: Any) -> Any:
        return self.value != _parts(other)[0]

    __hash__ = object.__hash__

    def __lt__(self, other: Any) -> Any:
        return self.value < _parts(other)[0]

    def __le__(self, other: Any) -> Any:
        return self.value <= _parts(other)[0]

    def __gt__(self, other: Any) -> Any:
        return self.value > _parts(other)[0]

    def __ge__(self, other: Any) -> Any:
        return self.value >= _parts(other)[0]


def dual(x: Any) -> Dual:
    """A dual number as it is; any other without a tangent."""
    return x if isinstance(x, Dual) else Dual(x)


@dataclass(frozen=True)
class DualOps:
    """Arithmetic of dual numbers over that of their parts."""

    ops: Ops

    def sqrt(self, x: Any) -> Dual:
        """The square root."""
        value, tangent = _parts(x)
        root = self.ops.sqrt(value)
        if tangent is None:
            return Dual(root)
        positive = root > 0.0
        rate = 0.5 / self.ops.select(positive, root, 1.0)
        return Dual(root, self.ops.select(positive, rate * tangent, 0.0))

    def exp(self, x: Any) -> Dual:
        """The exponential."""
        value, tangent = _parts(x)
        power = self.ops.exp(value)
        return Dual(power, _product(tangent, power))

    def minimum(self, x: Any, y: Any) -> Dual:
        """The smaller of two; the tangent is the second's where they are equal."""
        x, y = dual(x), dual(y)
        return Dual(self.ops.minimum(x.value, y.value), self._either(x < y, x, y))

    def maximum(self, x: Any, y: Any) -> Dual:
        """The larger of two; the tangent is the second's where they are equal."""
        x, y = dual(x), dual(y)
        return Dual(self.ops.maximum(x.value, y.value), self._either(x > y, x, y))

    def select(self, condition: Any, x: Any, y: Any) -> Dual:
        """`x` if the condition holds, else `y`."""
        condition, x, y = _parts(condition)[0], dual(x), dual(y)
        return Dual(self.ops.select(condition, x.value, y.value), self._either(condition, x, y))

    def _either(self, condition: Any, x: Dual, y: Dual) -> Scalar | None:
        """Tangent of `x` if the condition holds, else that of `y`."""
        if x.tangent is None and y.tangent is None:
            return None
        return self.ops.select(condition, _number(x.tangent), _number(y.tangent))


@lru_cache(maxsize=32)
def differentiated(init: Init, step: Step) -> tuple[Init, Step]:
    """The loop whose rows are pairs: those of the given one, and their tangents along one direction.

    Its parameters are pairs too, (values, tangents), and so are its inputs. Tangents are a tuple with an
    entry for each leaf of the values, from left to right; of parameters and inputs it may be `()`, for none.
    """

    def begin(ops: Ops, parameters: Tree, row: Tree) -> Tree:
        return _apart(init(DualOps(ops), _together(parameters), _together(row)))

    def advance(ops: Ops, parameters: Tree, carry: Tree, row: Tree) -> tuple[Tree, Tree]:
        carry, output = step(DualOps(ops), _together(parameters), _together(carry), _together(row))
        return _apart(carry), _apart(output)

    return begin, advance


def _together(pair: Tree) -> Tree:
    """Values and tangents as dual numbers."""
    values, tangents = pair
    given = (None if isinstance(tangent, tuple) else tangent for tangent in tangents)
    return tree_unflatten(values, map(Dual, tree_leaves(values), given))


def _apart(tree: Tree) -> Tree:
    """Dual numbers as values and tangents."""
    numbers = [value_and_tangent(leaf) for leaf in tree_leaves(tree)]
    return tree_unflatten(tree, (value for value, _ in numbers)), tuple(tangent for _, tangent in numbers)


def value_and_tangent(x: Any) -> tuple[Scalar, Scalar]:
    """Both parts of a number, zero where it has no tangent."""
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
