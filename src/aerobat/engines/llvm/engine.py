"""Kernels as machine code: traced once, compiled by LLVM, with vehicles side by side on all cores."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import compress
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import (
    CompiledLoop,
    Engine,
    Init,
    Step,
    available_cores,
    expanded,
    logged_ticks,
    read_only,
    tick_count,
)
from aerobat.engines.llvm.code_cache import cached_code
from aerobat.engines.llvm.codegen import module
from aerobat.engines.llvm.packing import ARRAYS, COUNTS, Layout, PackedInputs, Packing, input_kinds
from aerobat.engines.pytree import Tree, piecewise_constant_leaves, tree_leaves, tree_map, tree_unflatten
from aerobat.engines.traced_loop import TracedLoop, trace_loop

REGISTERS = 2  # registers of vehicles side by side, so that one need not wait for another's result
# [bytes] that a block of two registers may keep from tick to tick: half of a first-level cache
MAX_BLOCK_STATE = 24_000
MAX_SCALAR_VEHICLES = 4  # up to this number, vehicles are simulated one by one

Function = Callable[..., None]
_UNUSED = np.zeros(0)


class MachineLoop(CompiledLoop):
    """A loop as machine code, with its vehicles' parameters; by default run on all cores."""

    def __init__(
        self, init: Init, step: Step, parameters: Tree, inputs: Tree, threads: int | None = None
    ) -> None:
        leaves = [np.asarray(leaf, dtype=np.float64) for leaf in tree_leaves(parameters)]
        vehicles = len(leaves[0])
        equal = [bool((leaf == leaf[0]).all()) for leaf in leaves]
        bare_inputs = _bare(expanded(inputs))
        self._loop = _traced(init, step, _bare(parameters), bare_inputs)
        width = 1 if vehicles <= MAX_SCALAR_VEHICLES else _width(equal.count(False) + len(self._loop.carry))
        kinds = input_kinds(inputs)
        constant = zip(piecewise_constant_leaves(bare_inputs), kinds, strict=True)
        layout = Layout(
            width,
            shared_parameters=tuple(equal),
            inputs=kinds,
            piecewise_constant=tuple(changes_seldom and kind.shared for changes_seldom, kind in constant),
        )
        self._packing = Packing(layout, vehicles)
        self._init, self._scan = machine_code(self._loop, layout)
        self._parameters = (
            np.array([leaf[0] for leaf in compress(leaves, equal)]),
            self._packing.pad_lanes([leaf for leaf, one in zip(leaves, equal, strict=True) if not one]),
        )
        self._latest: tuple[Tree, Array] = (None, _UNUSED)
        self._addresses = [*map(address, self._parameters)]
        self._cuts = _thread_cuts(self._packing.blocks, threads or available_cores(), width)
        self._logical = [i for i, n in enumerate(self._loop.carry) if self._loop.is_logical(n)]
        self._logical_outputs = [i for i, n in enumerate(self._loop.outputs) if self._loop.is_logical(n)]

    def init(self, inputs: Tree) -> Tree:
        """Return the first carry; see `CompiledLoop.init`."""
        return self._run(self._init, self._packing.inputs(inputs, 1), _UNUSED, _UNUSED, 1, 1)

    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """Run some ticks; see `CompiledLoop.scan`."""
        ticks = tick_count(inputs)
        rows = len(logged_ticks(ticks, log_stride))
        after, outputs = self._advanced(carry, self._packing.inputs(inputs, ticks), rows, ticks, log_stride)
        return after, self._row(outputs.transpose(1, 2, 0))

    def step(self, carry: Tree, inputs: Tree) -> tuple[Tree, Tree]:
        """Run one tick; see `CompiledLoop.step`."""
        after, outputs = self._advanced(carry, self._packing.inputs(inputs, 1), 1, 1, 1)
        return after, self._row(outputs[0])

    def _advanced(
        self, carry: Tree, inputs: PackedInputs, rows: int, ticks: int, log_stride: int
    ) -> tuple[Tree, Array]:
        """Return the next carry, and the outputs (rows, o, vehicles)."""
        latest, packed = self._latest  # most scans continue where the last one ended
        before = packed if carry is latest else self._packing.pad_lanes(tree_leaves(carry))
        outputs = np.empty((rows, len(self._loop.outputs), self._packing.lanes))
        after = self._run(self._scan, inputs, before, outputs, ticks, log_stride)
        return after, outputs[..., : self._packing.vehicles]

    def _row(self, series: Array) -> Tree:
        """Return outputs (o, vehicles, ...) as a row's tree."""
        leaves = list(series)
        for index in self._logical_outputs:
            leaves[index] = leaves[index] != 0.0
        return tree_unflatten(self._loop.row, leaves)

    def _unpacked(self, carry: Array) -> Tree:
        """Return a carry (blocks, c, width) as a tree of read-only leaves (vehicles,)."""
        carry.flags.writeable = False
        leaves = [read_only(leaf) for leaf in self._packing.unpad_lanes(carry)]
        for index in self._logical:
            leaves[index] = read_only(leaves[index] != 0.0)
        tree = tree_unflatten(self._loop.carry_tree, leaves)
        self._latest = (tree, carry)
        return tree

    def _run(
        self,
        function: Function,
        inputs: PackedInputs,
        before: Array,
        outputs: Array,
        ticks: int,
        log_stride: int,
    ) -> Tree:
        """Run all lanes, in whole blocks for each thread without Python's lock; return the next carry."""
        after = np.empty((self._packing.blocks, len(self._loop.carry), self._packing.layout.width))
        arguments = [*self._addresses, *map(address, (*inputs.arrays, before, after, outputs))]
        arguments += [self._packing.lanes, ticks, *inputs.rows, log_stride]
        if len(self._cuts) == 2:
            function(*arguments, *self._cuts)
        else:
            pool = _pool(len(self._cuts) - 1)
            list(pool.map(lambda begin, end: function(*arguments, begin, end), self._cuts, self._cuts[1:]))
        return self._unpacked(after)


@lru_cache(maxsize=32)
def _traced(init: Init, step: Step, parameters: Tree, inputs: Tree) -> TracedLoop:
    """Return the loop for trees without numbers; cached by the functions."""
    return trace_loop(init, step, parameters, inputs)


def _bare(tree: Tree) -> Tree:
    """Return the tree without its numbers."""
    return tree_map(lambda leaf: 0, tree)


def address(array: Array) -> int:
    """Return the address of an array's values, three times as fast as `array.ctypes`."""
    return int(array.__array_interface__["data"][0])


@lru_cache(maxsize=32)
def machine_code(loop: TracedLoop, layout: Layout) -> tuple[Function, Function]:
    """Return `init` and `scan` of a loop as functions of the addresses of ARRAYS, and COUNTS."""
    machine = target_machine()
    code = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    code.add_object_file(llvm.ObjectFileRef.from_data(object_code(loop, layout)))
    code.finalize_object()
    signature = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS), *[ctypes.c_int64] * len(COUNTS))
    functions: list[Any] = [signature(code.get_function_address(name)) for name in ("init", "scan")]
    for function in functions:
        function.code = code  # keeps the code alive as long as its functions
    return functions[0], functions[1]


def object_code(loop: TracedLoop, layout: Layout) -> bytes:
    """Return a loop's object code for this machine, compiled or from the cache."""
    features = llvm.get_host_cpu_features().flatten()
    versions = f"llvmlite {llvmlite.__version__}, LLVM {llvm.llvm_version_info}"
    machine = f"{llvm.get_default_triple()} {llvm.get_host_cpu_name()} {features}"
    return cached_code(
        f"{versions}\n{machine}\n{layout}\n{loop}",
        lambda: target_machine().emit_object(llvm.parse_assembly(module(loop, layout))),
    )


@lru_cache(maxsize=4)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not survive a fork


def target_machine() -> llvm.TargetMachine:
    """Return this machine as LLVM's target, with all features of its processor."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
    )


def _width(kept: int) -> int:
    """Return the number of vehicles in a block, each of which keeps `kept` numbers from tick to tick."""
    together = REGISTERS * lanes()
    return together if kept * together * np.float64().nbytes <= MAX_BLOCK_STATE else lanes()


def lanes() -> int:
    """Return the number of float64 values in a register of this processor."""
    return 8 if llvm.get_host_cpu_features().get("avx512f") else 4


def _thread_cuts(blocks: int, threads: int, width: int) -> list[int]:
    """Return the lanes at which the parts of the threads begin and end."""
    parts = min(threads, blocks)
    return [width * (blocks * k // parts) for k in range(parts + 1)]


ENGINE = Engine("compiled", MachineLoop)
