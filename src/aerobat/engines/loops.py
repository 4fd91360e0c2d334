"""A scan as operations: what is computed once for a vehicle, and what at every tick."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from aerobat.engines.engine import Init, Step
from aerobat.engines.tracing import Symbol, Trace, TraceOps
from aerobat.engines.trees import Tree, leaves, refilled


@dataclass(frozen=True, eq=False)
class Loop:
    """Values of a trace, by their numbers: the carry is `first`, and after each tick `following`.

    Parts of the carry on which no output depends are left out. Loops with the same listing are equal, so
    that an engine compiles them once.
    """

    trace: Trace
    parameters: tuple[int, ...]
    inputs: tuple[int, ...]
    carry: tuple[int, ...]  # as a tick finds it
    first: tuple[int, ...]  # from parameters and the first tick's inputs
    following: tuple[int, ...]
    outputs: tuple[int, ...]
    told: Tree  # what a tick tells, its leaves the outputs' symbols

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Loop) and self._listing == other._listing

    def __hash__(self) -> int:
        return hash(self._listing)

    def __str__(self) -> str:
        """A listing: every value, what the carry becomes, what is told."""
        return self._listing

    @cached_property
    def _listing(self) -> str:
        carried = zip(self.carry, self.first, self.following, strict=True)
        lines = [f"%{now} is first %{first}, then %{then}" for now, first, then in carried]
        return "\n".join([str(self.trace), *lines, "told: " + " ".join(f"%{i}" for i in self.outputs)])

    @cached_property
    def before(self) -> list[int]:
        """The values to compute before the first tick, in order."""
        once = self.trace.needed(self.first)
        once |= {number for number in self._each_tick if number not in self._ticking}
        return sorted(once)

    @cached_property
    def during(self) -> list[int]:
        """The values to compute at every tick, in order."""
        return sorted(self._each_tick & self._ticking)

    def lasting(self, steady: Iterable[int]) -> list[int]:
        """The values of `during` that change only when these inputs do, in order."""
        known = {*steady, *(number for number in self.before if number not in self._ticking)}
        found = []
        for number in self.during:
            arguments = self.trace.operations[number].arguments
            if arguments and known.issuperset(arguments):
                known.add(number)
                found.append(number)
        return found

    @cached_property
    def _each_tick(self) -> set[int]:
        return self.trace.needed((*self.following, *self.outputs))

    @cached_property
    def _ticking(self) -> set[int]:
        """What inputs and carry change."""
        changing = {*self.inputs, *self.carry}
        for number, operation in enumerate(self.trace.operations):
            if not changing.isdisjoint(operation.arguments):
                changing.add(number)
        return changing


def traced(init: Init, step: Step, parameters: Tree, inputs: Tree) -> Loop:
    """The loop that `init` and `step` make for trees of such a structure; see `engine.Scan`."""
    trace = Trace()
    ops = TraceOps(trace)
    given, row = _symbols(trace, parameters, "parameter"), _symbols(trace, inputs, "input")
    first = init(ops, given, row)
    begun = [trace.symbol(leaf) for leaf in leaves(first)]
    logical = [trace.operations[symbol.number].logical for symbol in begun]
    carry = [trace.input(f"carry {i}", kind) for i, kind in enumerate(logical)]
    following, told = step(ops, given, refilled(first, iter(carry)), row)
    told = refilled(told, (trace.symbol(leaf) for leaf in leaves(told)))
    then = [trace.symbol(leaf) for leaf in leaves(following)]
    kept = _kept(trace, _numbers(carry), _numbers(then), _numbers(leaves(told)))
    return Loop(
        trace=trace,
        parameters=_numbers(leaves(given)),
        inputs=_numbers(leaves(row)),
        carry=_numbers(carry[i] for i in kept),
        first=_numbers(begun[i] for i in kept),
        following=_numbers(then[i] for i in kept),
        outputs=_numbers(leaves(told)),
        told=told,
    )


def _symbols(trace: Trace, tree: Tree, name: str) -> Tree:
    return refilled(tree, (trace.input(f"{name} {i}") for i, _ in enumerate(leaves(tree))))


def _numbers(symbols: Iterable[Symbol]) -> tuple[int, ...]:
    return tuple(symbol.number for symbol in symbols)


def _kept(trace: Trace, carry: Sequence[int], following: Sequence[int], outputs: Sequence[int]) -> list[int]:
    """The parts of the carry on which the outputs depend, sooner or later."""
    kept: set[int] = set()
    while True:
        needed = trace.needed((*outputs, *(following[i] for i in kept)))
        more = {i for i, number in enumerate(carry) if number in needed}
        if more == kept:
            return sorted(kept)
        kept = more
