"""A traced loop: the prologue, which depends only on parameters, and the body, computed at every tick."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree, tree_leaves, tree_unflatten
from aerobat.engines.tracing import Symbol, Trace

MIN_GUARDED = 32  # smallest number of operations for which a branch pays off


@dataclass(frozen=True)
class GuardedBlock:
    """Values that are computed together: always, or only where a condition (`guard`) holds."""

    guard: int | None
    numbers: tuple[int, ...]  # in the order of computation


@dataclass(frozen=True, eq=False)
class TracedLoop:
    """A loop as values of a trace, by their numbers; `next_carry` replaces the carry after each tick.

    Parts of the carry that no output depends on are left out. Loops with the same listing are equal, so an
    engine compiles them once.
    """

    trace: Trace
    parameters: tuple[int, ...]
    inputs: tuple[int, ...]
    carry: tuple[int, ...]  # at the start of a tick
    first_carry: tuple[int, ...]  # from the parameters and the inputs of the first tick
    next_carry: tuple[int, ...]
    outputs: tuple[int, ...]
    carry_tree: Tree  # a leaf for each part of the carry, () for parts that are left out
    row: Tree  # row of a tick, with the outputs' symbols as leaves

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TracedLoop) and self._listing == other._listing

    def __hash__(self) -> int:
        return hash(self._listing)

    def __str__(self) -> str:
        """Return a listing: every value, the carry's updates, and the outputs."""
        return self._listing

    @cached_property
    def _listing(self) -> str:
        carried = zip(self.carry, self.first_carry, self.next_carry, strict=True)
        lines = [f"%{now} is first %{first}, then %{then}" for now, first, then in carried]
        return "\n".join([str(self.trace), *lines, "output: " + " ".join(f"%{i}" for i in self.outputs)])

    @cached_property
    def initialization(self) -> list[int]:
        """The values to compute for the first carry, in order."""
        return sorted(self.trace.needed(self.first_carry))

    @cached_property
    def prologue(self) -> list[int]:
        """The values that ticks use and that are the same at all ticks, in order."""
        return sorted(self._each_tick - self._changing)

    @cached_property
    def body(self) -> list[int]:
        """The values to compute at every tick, in order."""
        return sorted(self._each_tick & self._changing)

    def loop_invariant(self, piecewise_constant: Iterable[int]) -> list[int]:
        """Return the values of `body` that change only when these inputs change, in order."""
        known = {*piecewise_constant, *self.prologue}
        found = []
        for number in self.body:
            arguments = self.trace.operations[number].arguments
            if arguments and known.issuperset(arguments):
                known.add(number)
                found.append(number)
        return found

    def guarded_blocks(self, numbers: Sequence[int], shared: Iterable[int]) -> list[GuardedBlock]:
        """Return the values of `numbers` in blocks; some blocks are guarded by a shared condition.

        Only selections by that condition use the values of a guarded block. Where the condition does not
        hold, these values are not computed, and no selection uses them.

        Args:
            numbers: values, in order.
            shared: inputs that all vehicles computed at once share.
        """
        guards = self._guards(numbers, {*shared})
        waiting, blocks = list(numbers), []
        while waiting:
            missing = set(waiting)
            for guard in (None, *dict.fromkeys(guards.values())):
                block = []
                for number in waiting:
                    arguments = self.trace.operations[number].arguments
                    if guards.get(number) == guard and missing.isdisjoint(arguments):
                        block.append(number)
                        missing.discard(number)
                waiting = [number for number in waiting if number in missing]
                if block:
                    blocks.append(GuardedBlock(guard, tuple(block)))
        return blocks

    def _guards(self, numbers: Sequence[int], shared: set[int]) -> dict[int, int]:
        """Return, for each value that is needed only under a condition, that condition."""
        operations = self.trace.operations
        conditions = {operations[n].arguments[0] for n in numbers if operations[n].name == "select"}
        roots = (*self.next_carry, *self.outputs)
        guards: dict[int, int] = {}
        for condition in sorted(conditions):
            decided_by = {i for i in operations[condition].arguments if operations[i].name != "constant"}
            if not decided_by or not shared.issuperset(decided_by):
                continue
            always = self.trace.needed(roots, unless=condition)
            only = [n for n in numbers if operations[n].arguments and n not in always and n not in guards]
            if len(only) >= MIN_GUARDED:
                guards |= dict.fromkeys(only, condition)
        return guards

    def stored_early(self, blocks: Sequence[GuardedBlock]) -> list[dict[int, int]]:
        """Return, for each block, the parts of the carry that can be updated in it, with their new values.

        These are the parts that otherwise keep their values, and that nothing uses after the block.
        """
        place = {number: i for i, block in enumerate(blocks) for number in block.numbers}
        users: dict[int, set[int]] = {}
        for number in place:
            for argument in self.trace.operations[number].arguments:
                users.setdefault(argument, set()).add(number)
        used_at_the_end = {*self.outputs, *self.next_carry}
        found: list[dict[int, int]] = [{} for _ in blocks]
        for now, then in zip(self.carry, self.next_carry, strict=True):
            operation = self.trace.operations[then]
            if operation.name != "select" or operation.arguments[2] != now:
                continue
            guard, chosen, _ = operation.arguments
            block = place.get(chosen, -1)
            if block < 0 or blocks[block].guard != guard:
                continue
            is_used_later = any(place[user] > block for user in users[now] - {then})
            is_needed = then in users or then in self.outputs or now in used_at_the_end
            is_needed = is_needed or self.next_carry.count(then) > 1
            if not is_used_later and not is_needed:
                found[block][now] = chosen
        return found

    def is_logical(self, number: int) -> bool:
        """Return True for a value that is true or false instead of a number."""
        return self.trace.operations[number].logical

    @cached_property
    def _each_tick(self) -> set[int]:
        return self.trace.needed((*self.next_carry, *self.outputs))

    @cached_property
    def _changing(self) -> set[int]:
        """The values that depend on inputs or carry."""
        changing = {*self.inputs, *self.carry}
        for number, operation in enumerate(self.trace.operations):
            if not changing.isdisjoint(operation.arguments):
                changing.add(number)
        return changing


def trace_loop(init: Init, step: Step, parameters: Tree, inputs: Tree) -> TracedLoop:
    """Return the loop of `init` and `step` for trees of these structures; see `engine.Compile`."""
    trace = Trace()
    parameters, inputs = _symbols(trace, parameters, "parameter"), _symbols(trace, inputs, "input")
    first_tree = init(trace, parameters, inputs)
    first = [trace.symbol(leaf) for leaf in tree_leaves(first_tree)]
    kinds = [trace.operations[symbol.number].logical for symbol in first]
    carry = [trace.input(f"carry {i}", logical) for i, logical in enumerate(kinds)]
    next_tree, row = step(trace, parameters, tree_unflatten(first_tree, carry), inputs)
    following = [trace.symbol(leaf) for leaf in tree_leaves(next_tree)]
    row = tree_unflatten(row, [trace.symbol(leaf) for leaf in tree_leaves(row)])
    live = _live_parts(trace, _numbers(carry), _numbers(following), _numbers(tree_leaves(row)))
    return TracedLoop(
        trace=trace,
        parameters=_numbers(tree_leaves(parameters)),
        inputs=_numbers(tree_leaves(inputs)),
        carry=_numbers(carry[i] for i in live),
        first_carry=_numbers(first[i] for i in live),
        next_carry=_numbers(following[i] for i in live),
        outputs=_numbers(tree_leaves(row)),
        carry_tree=tree_unflatten(first_tree, (i if i in live else () for i in range(len(carry)))),
        row=row,
    )


def _symbols(trace: Trace, tree: Tree, name: str) -> Tree:
    return tree_unflatten(tree, (trace.input(f"{name} {i}") for i, _ in enumerate(tree_leaves(tree))))


def _numbers(symbols: Iterable[Symbol]) -> tuple[int, ...]:
    return tuple(symbol.number for symbol in symbols)


def _live_parts(
    trace: Trace, carry: Sequence[int], following: Sequence[int], outputs: Sequence[int]
) -> list[int]:
    """Return the parts of the carry on which the outputs eventually depend."""
    live: set[int] = set()
    while True:
        needed = trace.needed((*outputs, *(following[i] for i in live)))
        more = {i for i, number in enumerate(carry) if number in needed}
        if more == live:
            return sorted(live)
        live = more
