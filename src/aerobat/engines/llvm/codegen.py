"""Code generation: a loop in LLVM's intermediate language, over all ticks of all vehicles.

DERIVATION.md, beside this file, explains where values are computed, and why the results are bitwise
reproducible.

A value is one number for all vehicles or, where vehicles differ, a vector with a lane for each of `width`
vehicles. No operation is fused or reordered, and the exponential is written out in plain operations.
Therefore neither the machine, nor the width, nor the size of a batch changes a bit of the results.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from itertools import compress, count
from typing import Any

from llvmlite import ir

from aerobat.engines.llvm.arithmetic import CODE, INTEGER, LOGICAL, NUMBER, exponential, filled, shaped
from aerobat.engines.llvm.packing import ARRAYS, COUNTS, InputKind, Layout
from aerobat.engines.traced_loop import TracedLoop
from aerobat.engines.tracing import Operation


def module(loop: TracedLoop, layout: Layout) -> str:
    """Return the text of a module with the functions `init` and `scan`.

    Their arguments are the addresses of ARRAYS, and COUNTS.
    """
    whole = ir.Module("aerobat")
    arguments = [ir.PointerType()] * len(ARRAYS) + [INTEGER] * len(COUNTS)
    signature = ir.FunctionType(ir.VoidType(), arguments)
    _Codegen(loop, layout, ir.Function(whole, signature, "init")).emit_init()
    _Codegen(loop, layout, ir.Function(whole, signature, "scan")).emit_scan()
    return str(whole)


class _Codegen:
    """Generator of one function."""

    def __init__(self, loop: TracedLoop, layout: Layout, function: ir.Function) -> None:
        self._loop = loop
        self._layout = layout
        self._arguments = dict(zip((*ARRAYS, *COUNTS), function.args, strict=True))
        self._builder = ir.IRBuilder(function.append_basic_block())
        self._values: dict[int, Any] = {}  # values by their numbers in the trace
        # address, type and alignment of values that are not loaded yet
        self._unloaded: dict[int, tuple[Any, Any, int | None]] = {}
        self._widened: dict[Any, Any] = {}

    def emit_init(self) -> None:
        """Emit the first carry of each block of lanes, one block after another."""
        loop = self._loop
        with self._blocks() as lane:
            self._load_parameters(lane)
            self._load_inputs(INTEGER(0), lane)
            self._compute(loop.initialization)
            self._store_carry(self._wide(loop.first_carry), lane)
        self._builder.ret_void()

    def emit_scan(self) -> None:
        """Emit blocks of lanes, one after another, each through all ticks."""
        b, loop = self._builder, self._loop
        with self._blocks() as lane:
            self._load_parameters(lane)
            self._compute(loop.prologue)
            carry = {}
            for index, number in enumerate(loop.carry):
                address = self._block_address("carry", len(loop.carry), index, lane)
                value = b.load(address, typ=self._wide_type(NUMBER), align=8)
                carry[number] = self._slot(self._as_logical(value) if loop.is_logical(number) else value)
            with self._counting(INTEGER(0), self._arguments["ticks"], 1) as tick:
                self._tick(carry, tick, lane)
            after = [b.load(slot, typ=slot.allocated_type) for slot in carry.values()]
            self._store_carry(after, lane)
        b.ret_void()

    def _blocks(self) -> AbstractContextManager[Any]:
        return self._counting(self._arguments["begin"], self._arguments["end"], self._layout.width)

    def _tick(self, carry: Mapping[int, Any], tick: Any, lane: Any) -> None:
        loop = self._loop
        self._unloaded |= {number: (slot, slot.allocated_type, None) for number, slot in carry.items()}
        self._load_inputs(tick, lane)
        piecewise_constant = list(compress(loop.inputs, self._layout.piecewise_constant))
        invariant = loop.loop_invariant(piecewise_constant)
        self._refresh(piecewise_constant, invariant, tick)
        held = set(invariant)
        stored = self._compute_guarded([number for number in loop.body if number not in held], carry)
        self._log(tick, lane)
        following = [pair for pair in zip(loop.carry, loop.next_carry, strict=True) if pair[0] not in stored]
        values = self._wide(then for _, then in following)
        for (now, _), value in zip(following, values, strict=True):
            self._builder.store(value, carry[now])

    def _refresh(self, piecewise_constant: Sequence[int], invariant: Sequence[int], tick: Any) -> None:
        """Recompute the loop-invariant values at the first tick and after changes of their inputs."""
        b = self._builder
        columns = self._layout.shared_columns
        shared = compress(self._loop.inputs, self._layout.shared_inputs)
        column = {number: index for index, number in enumerate(shared)}
        begins = b.icmp_signed("==", tick, INTEGER(0))
        changed = begins
        before = b.select(begins, tick, b.sub(tick, INTEGER(1)))
        for number in piecewise_constant:
            address = self._address("shared inputs", before, columns, column[number], None)
            was = b.load(address, typ=INTEGER, align=8)  # as bits, because 0.0 and -0.0 compare equal
            changed = b.or_(changed, b.icmp_signed("!=", b.bitcast(self._value(number), INTEGER), was))
        with self._where(changed, invariant):
            self._compute(invariant)

    def _compute_guarded(self, numbers: Sequence[int], carry: Mapping[int, Any]) -> set[int]:
        """Compute the values of a tick; those guarded by a shared condition only where it holds.

        Returns the parts of the carry that are already stored there.
        """
        loop = self._loop
        blocks = loop.guarded_blocks(numbers, compress(loop.inputs, self._layout.shared_inputs))
        stored = loop.stored_early(blocks)
        early = {now for parts in stored for now in parts}
        merged = {then for now, then in zip(loop.carry, loop.next_carry, strict=True) if now in early}
        blocks = [replace(each, numbers=tuple(n for n in each.numbers if n not in merged)) for each in blocks]
        at_the_end = {*loop.next_carry, *loop.outputs} - merged
        for i, block in enumerate(blocks):
            if block.guard is None:
                self._compute(block.numbers)
                continue
            later = (loop.trace.operations[n].arguments for each in blocks[i + 1 :] for n in each.numbers)
            used = at_the_end.union(*later)
            kept = [number for number in block.numbers if number in used]
            with self._where(self._value(block.guard), kept):
                self._compute(block.numbers)
                for now, value in zip(stored[i], self._wide(stored[i].values()), strict=True):
                    self._builder.store(value, carry[now])
        return early

    @contextmanager
    def _where(self, condition: Any, kept: Sequence[int]) -> Iterator[None]:
        """Context of code that runs where a condition holds; `kept` values are kept from tick to tick."""
        b, widened, values, slots = self._builder, dict(self._widened), dict(self._values), {}
        with b.if_then(condition):
            yield
            for number in kept:
                slots[number] = self._slot(self._values[number])
        self._widened, self._values = widened, values  # values made inside are not defined outside
        self._unloaded |= {number: (slot, slot.allocated_type, None) for number, slot in slots.items()}

    def _log(self, tick: Any, lane: Any) -> None:
        """Store the outputs at logged ticks, with true and false as 1 and 0."""
        b, stride = self._builder, self._arguments["log_stride"]
        outputs = self._wide(self._loop.outputs)
        last = b.icmp_signed("==", b.add(tick, INTEGER(1)), self._arguments["ticks"])
        due = b.icmp_signed("==", b.srem(tick, stride), INTEGER(0))
        with b.if_then(b.or_(due, last)):
            row = b.sdiv(b.add(tick, b.sub(stride, INTEGER(1))), stride)
            for column, value in enumerate(outputs):
                address = self._address("outputs", row, len(outputs), column, lane)
                b.store(self._as_number(value), address, align=8)

    def _store_carry(self, values: Sequence[Any], lane: Any) -> None:
        """Store wide values into the next carry, with true and false as 1 and 0."""
        for column, value in enumerate(values):
            address = self._block_address("next carry", len(values), column, lane)
            self._builder.store(self._as_number(value), address, align=8)

    def _compute(self, numbers: Iterable[int]) -> None:
        operations = self._loop.trace.operations
        for number in numbers:
            operation = operations[number]
            if operation.name == "constant":
                self._values[number] = _constant(operation.content)
            elif operation.name != "input":
                arguments = [self._value(i) for i in operation.arguments]
                if any(map(_is_wide, arguments)):
                    arguments = [self._widen(argument) for argument in arguments]
                self._values[number] = self._apply(operation, arguments)

    def _apply(self, operation: Operation, arguments: Sequence[Any]) -> Any:
        """Return the result of an operation on arguments that are all wide or all scalar."""
        b = self._builder
        match operation.name, arguments:
            case "add", (x, y):
                return b.fadd(x, y)
            case "subtract", (x, y):
                return b.fsub(x, y)
            case "multiply", (x, y):
                return b.fmul(x, y)
            case "divide", (x, y):
                return b.fdiv(x, y)
            case "negate", (x,):
                return b.fneg(x)
            case "sqrt", (x,):
                return b.call(self._square_root(x.type), [x])
            case "exp", (x,):
                return exponential(b, x)
            case "minimum", (x, y):
                return b.select(b.fcmp_ordered("<", x, y), x, y)
            case "maximum", (x, y):
                return b.select(b.fcmp_ordered(">", x, y), x, y)
            case "less", (x, y):
                return b.fcmp_ordered("<", x, y)
            case "less_equal", (x, y):
                return b.fcmp_ordered("<=", x, y)
            case "and", (x, y):
                return b.and_(x, y)
            case "select", (condition, x, y):
                return b.select(condition, x, y)
        raise NotImplementedError(operation.name)

    def _square_root(self, type_: Any) -> Any:
        suffix = f"v{type_.count}f64" if isinstance(type_, ir.VectorType) else "f64"
        signature = ir.FunctionType(type_, [type_])
        return self._builder.module.declare_intrinsic(f"llvm.sqrt.{suffix}", (), signature)

    def _load_parameters(self, lane: Any) -> None:
        """Register the parameters, to be loaded where they are first needed."""
        flags = self._layout.shared_parameters
        counts = {True: sum(flags), False: len(flags) - sum(flags)}
        columns = {True: count(), False: count()}
        for number, shared in zip(self._loop.parameters, flags, strict=True):
            column = next(columns[shared])
            if shared:
                address = self._address("shared parameters", INTEGER(0), counts[shared], column, None)
                self._unloaded[number] = (address, NUMBER, 8)
            else:
                address = self._block_address("parameters", counts[shared], column, lane)
                self._unloaded[number] = (address, self._wide_type(NUMBER), 8)

    def _load_inputs(self, tick: Any, lane: Any) -> None:
        """Register the inputs of one tick, to be loaded where they are first needed."""
        layout = self._layout
        rows = {kind: self._row(kind, tick, lane) for kind in {*layout.inputs} if not kind.shared}
        columns: dict[InputKind | str, Iterator[int]] = defaultdict(count)
        for number, kind in zip(self._loop.inputs, layout.inputs, strict=True):
            column = next(columns["shared" if kind.shared else kind])
            if kind.shared:
                address = self._address("shared inputs", tick, layout.shared_columns, column, None)
                self._unloaded[number] = (address, NUMBER, 8)
                continue
            array, row = rows[kind]
            element = CODE if kind.coded else NUMBER
            place = self._builder.add(row, INTEGER(column * layout.width))
            address = self._builder.gep(self._arguments[array], [place], source_etype=element)
            self._unloaded[number] = (address, self._wide_type(element), 2 if kind.coded else 8)

    def _row(self, kind: InputKind, tick: Any, lane: Any) -> tuple[str, Any]:
        """Return the array of a kind of inputs, and the index of its first entry in a block at a tick."""
        b, layout = self._builder, self._layout
        array = "codes" if kind.coded else "inputs"
        if kind.held is None:
            columns = INTEGER(layout.inputs.count(kind))
            block, row = b.mul(self._arguments["ticks"], columns), b.mul(tick, columns)
        else:
            array = f"held {array}"
            column = sum(layout.shared_inputs) + layout.held_kinds.index(kind)
            address = self._address("shared inputs", tick, layout.shared_columns, column, None)
            block = self._arguments[f"{array} rows"]
            row = b.fptosi(b.load(address, typ=NUMBER, align=8), INTEGER)
        return array, b.add(b.mul(lane, block), b.mul(row, INTEGER(layout.width)))

    def _address(self, array: str, row: Any, columns: int, column: int, lane: Any | None) -> Any:
        """Return the address of array[row, column], or of array[row, column, lane]."""
        b = self._builder
        place = b.add(b.mul(row, INTEGER(columns)), INTEGER(column))
        if lane is not None:
            place = b.add(b.mul(place, self._arguments["lanes"]), lane)
        return b.gep(self._arguments[array], [place], source_etype=NUMBER)

    def _block_address(self, array: str, columns: int, column: int, lane: Any) -> Any:
        """Return the address of array[block, column] in an array (blocks, columns, width)."""
        b = self._builder
        place = b.add(b.mul(lane, INTEGER(columns)), INTEGER(column * self._layout.width))
        return b.gep(self._arguments[array], [place], source_etype=NUMBER)

    @contextmanager
    def _counting(self, begin: Any, end: Any, step: int) -> Iterator[Any]:
        """Context whose code runs for begin, begin + step, ..., below end."""
        b = self._builder
        slot = self._slot(begin)
        test, body, after = (b.append_basic_block() for _ in range(3))
        b.branch(test)
        b.position_at_end(test)
        index = b.load(slot, typ=INTEGER)
        b.cbranch(b.icmp_signed("<", index, end), body, after)
        b.position_at_end(body)
        yield index
        b.store(b.add(index, INTEGER(step)), slot)
        b.branch(test)
        b.position_at_end(after)

    def _slot(self, value: Any) -> Any:
        """Return a stack slot that is initialized with a value."""
        with self._builder.goto_entry_block():
            slot = self._builder.alloca(value.type)
        self._builder.store(value, slot)
        return slot

    def _wide(self, numbers: Iterable[int]) -> list[Any]:
        return [self._widen(self._value(number)) for number in numbers]

    def _value(self, number: int) -> Any:
        """Return a value, loaded now if it is not known yet."""
        if number not in self._values:
            address, type_, alignment = self._unloaded[number]
            value = self._builder.load(address, typ=type_, align=alignment)
            self._values[number] = self._entry(value) if shaped(type_, CODE) == type_ else value
        return self._values[number]

    def _entry(self, code: Any) -> Any:
        """Return the table's entry at an index, in each lane."""
        b, place = self._builder, self._builder.zext(code, shaped(code.type, INTEGER))
        if not _is_wide(code):
            return b.load(b.gep(self._arguments["table"], [place], source_etype=NUMBER), typ=NUMBER, align=8)
        table = self._widen(self._arguments["table"])
        addresses = b.gep(table, [place], source_etype=NUMBER)
        wide, every = self._wide_type(NUMBER), filled(self._wide_type(LOGICAL), LOGICAL(1))
        arguments = (addresses, ir.IntType(32)(8), every, ir.Constant(wide, ir.Undefined))
        signature = ir.FunctionType(wide, [argument.type for argument in arguments])
        name = f"llvm.masked.gather.v{wide.count}f64.v{wide.count}p0"
        return b.call(b.module.declare_intrinsic(name, (), signature), arguments)

    def _widen(self, value: Any) -> Any:
        """Return a value with a lane for each vehicle."""
        width, b = self._layout.width, self._builder
        if _is_wide(value) or width == 1:
            return value
        wide = self._wide_type(value.type)
        if isinstance(value, ir.Constant):
            return filled(wide, value)
        if value not in self._widened:
            lane = b.insert_element(ir.Constant(wide, ir.Undefined), value, INTEGER(0))
            first = ir.Constant(ir.VectorType(ir.IntType(32), width), None)
            self._widened[value] = b.shuffle_vector(lane, lane, first)
        return self._widened[value]

    def _wide_type(self, type_: Any) -> Any:
        return ir.VectorType(type_, self._layout.width) if self._layout.width > 1 else type_

    def _as_number(self, value: Any) -> Any:
        """Return true and false as 1 and 0."""
        if shaped(value.type, LOGICAL) != value.type:
            return value
        return self._builder.uitofp(value, shaped(value.type, NUMBER))

    def _as_logical(self, value: Any) -> Any:
        """Return 1 and 0 as true and false."""
        return self._builder.fcmp_ordered("!=", value, filled(value.type, NUMBER(0.0)))


def _constant(content: Any) -> Any:
    return LOGICAL(int(content)) if isinstance(content, bool) else NUMBER(content)


def _is_wide(value: Any) -> bool:
    return isinstance(value.type, ir.VectorType)
