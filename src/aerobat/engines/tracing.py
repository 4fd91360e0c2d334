"""Tracing: a kernel is run once on symbols and recorded as a flat list of operations.

Values are numbered in the order of their computation. Constant folding and common sub-expression elimination
never change a bit of a result. A kernel that branches on a value cannot be traced; the error names its line.
"""

from __future__ import annotations

import math
import operator
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "negate": operator.neg,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "minimum": min,
    "maximum": max,
    "less": operator.lt,
    "less_equal": operator.le,
    "and": operator.and_,
    "select": lambda condition, x, y: x if condition else y,
}
_COMMUTATIVE = {"add", "multiply", "and"}
_LOGICAL = {"less", "less_equal", "and"}
_OF_LOGICAL = {"and", "select"}  # operations that accept logical values; all others take numbers


class BranchError(TypeError):
    """A kernel needed the value of a symbol, which does not exist during tracing."""


@dataclass(frozen=True)
class Operation:
    """One value of a trace: an input, a constant, or a function of earlier values."""

    name: str  # input, constant, or one of FUNCTIONS
    arguments: tuple[int, ...] = ()  # the numbers of earlier values
    content: float | bool | str = ""  # a constant's value, an input's name
    logical: bool = False  # whether the value is true or false instead of a number

    def __str__(self) -> str:
        """Return the operation as it stands in a listing."""
        if self.name in ("input", "constant"):
            return f"{self.name} {self.content}"
        return f"{self.name} {' '.join(f'%{i}' for i in self.arguments)}"


@dataclass
class Trace:
    """A record of the operations on symbols, and the arithmetic by which kernels are recorded."""

    operations: list[Operation] = field(default_factory=list)
    _numbers: dict[Any, int] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return a listing with one line for each value."""
        return "\n".join(f"%{i} = {operation}" for i, operation in enumerate(self.operations))

    def input(self, name: str, logical: bool = False) -> Symbol:
        """Return a new symbol."""
        return Symbol(self, self._number("input", (), name, logical))

    def symbol(self, value: Any) -> Symbol:
        """Return a symbol unchanged, or a number as a constant."""
        if isinstance(value, Symbol):
            return value
        logical = isinstance(value, bool)
        content = value if logical else float(value)
        return Symbol(self, self._number("constant", (), content, logical))

    def apply(self, name: str, *arguments: Any) -> Symbol:
        """Return a function of symbols and numbers; as numbers, logical values count as 1 and 0."""
        numbers = tuple([self.symbol(argument).number for argument in arguments])
        known = [self.operations[number] for number in numbers]
        if name not in _OF_LOGICAL and any(operation.logical for operation in known):
            numbers = tuple([self._as_number(number) for number in numbers])
            known = [self.operations[number] for number in numbers]
        constants = [operation.name == "constant" for operation in known]
        if all(constants):
            return self.symbol(FUNCTIONS[name](*(operation.content for operation in known)))
        unchanged = _unchanged(name, numbers, known) if any(constants) or name == "select" else None
        if unchanged is not None:
            return Symbol(self, unchanged)
        if name in _COMMUTATIVE:
            numbers = tuple(sorted(numbers))
        logical = name in _LOGICAL or (name == "select" and known[1].logical)
        return Symbol(self, self._number(name, numbers, "", logical))

    def sqrt(self, x: Any) -> Symbol:
        """Return the square root."""
        return self.apply("sqrt", x)

    def exp(self, x: Any) -> Symbol:
        """Return the exponential."""
        return self.apply("exp", x)

    def minimum(self, x: Any, y: Any) -> Symbol:
        """Return the smaller of two."""
        return self.apply("minimum", x, y)

    def maximum(self, x: Any, y: Any) -> Symbol:
        """Return the larger of two."""
        return self.apply("maximum", x, y)

    def select(self, condition: Any, x: Any, y: Any) -> Symbol:
        """Return `x` if the condition holds, else `y`."""
        return self.apply("select", condition, x, y)

    def needed(self, roots: Iterable[int], unless: int | None = None) -> set[int]:
        """Return the values from which `roots` are computed, including `roots`.

        Args:
            roots: the values to compute.
            unless: a condition that is assumed to be false, so that selections by it take their second value.
        """
        found: set[int] = set()
        waiting = list(roots)
        while waiting:
            number = waiting.pop()
            if number not in found:
                found.add(number)
                arguments = self.operations[number].arguments
                selects = self.operations[number].name == "select" and arguments[0] == unless
                waiting.extend(arguments[::2] if selects else arguments)
        return found

    def _as_number(self, number: int) -> int:
        symbol = Symbol(self, number)
        return (self.apply("select", symbol, 1.0, 0.0) if self.operations[number].logical else symbol).number

    def _number(
        self, name: str, arguments: tuple[int, ...], content: float | bool | str, logical: bool
    ) -> int:
        # 0.0 and -0.0 are equal, True and 1.0 too: repr distinguishes them
        key = (name, arguments, repr(content) if name == "constant" else content)
        number = self._numbers.setdefault(key, len(self.operations))
        if number == len(self.operations):
            self.operations.append(Operation(name, arguments, content, logical))
        return number


def _unchanged(name: str, numbers: Sequence[int], known: Sequence[Operation]) -> int | None:
    """Return the argument that always equals the function's value, if there is one."""
    match name, [operation.content if operation.name == "constant" else None for operation in known]:
        case ("multiply" | "divide", [_, 1.0]) | ("and", [_, True]):
            return numbers[0]
        case ("multiply", [1.0, _]) | ("and", [True, _]) | ("select", [True, _, _]):
            return numbers[1] if name == "select" or name in _COMMUTATIVE else None
        case ("select", [False, _, _]):
            return numbers[2]
    if name == "select" and numbers[1] == numbers[2]:
        return numbers[1]
    return None


def _binary(name: str, swapped: bool = False) -> Callable[[Symbol, Any], Symbol]:
    def method(self: Symbol, other: Any) -> Symbol:
        return self.trace.apply(name, other, self) if swapped else self.trace.apply(name, self, other)

    return method


class Symbol:
    """A symbolic number: arithmetic with it is recorded."""

    __slots__ = ("number", "trace")
    __array_ufunc__ = None  # makes NumPy use the operators of this class

    def __init__(self, trace: Trace, number: int) -> None:
        self.trace, self.number = trace, number

    __add__, __radd__ = _binary("add"), _binary("add", swapped=True)
    __sub__, __rsub__ = _binary("subtract"), _binary("subtract", swapped=True)
    __mul__, __rmul__ = _binary("multiply"), _binary("multiply", swapped=True)
    __truediv__, __rtruediv__ = _binary("divide"), _binary("divide", swapped=True)
    __and__, __rand__ = _binary("and"), _binary("and", swapped=True)
    __lt__, __gt__ = _binary("less"), _binary("less", swapped=True)
    __le__, __ge__ = _binary("less_equal"), _binary("less_equal", swapped=True)

    def __eq__(self, other: Any) -> Symbol:  # type: ignore[override]
        return self.trace.apply("and", self <= other, self >= other)

    def __ne__(self, other: Any) -> Symbol:  # type: ignore[override]
        return self.trace.apply("select", self == other, False, True)

    __hash__ = object.__hash__

    def __neg__(self) -> Symbol:
        return self.trace.apply("negate", self)

    def __bool__(self) -> bool:
        raise _branch()

    def __float__(self) -> float:
        raise _branch()

    def __iter__(self) -> Iterator[Any]:
        raise _branch()


def _branch() -> BranchError:
    line = traceback.extract_stack(limit=3)[0]
    return BranchError(
        f"{line.filename}, line {line.lineno}: `{line.line}` needs the value of a symbol; "
        "kernels take ops.select where others branch"
    )
