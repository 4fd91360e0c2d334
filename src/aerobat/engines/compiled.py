"""Kernels as machine code: traced once, compiled by LLVM in a moment, vehicles side by side on all cores."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import repeat
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from aerobat.arrays import Array
from aerobat.engines.emitting import ARRAYS, COUNTS, Layout, module
from aerobat.engines.engine import Engine, Init, Step, told
from aerobat.engines.loops import Loop, traced
from aerobat.engines.trees import Tree, leaves, refilled

REGISTERS = 2  # of vehicles side by side, so that one need not wait for another's result
RARE = 16  # ticks, of which an input that is called steady changes at most at one
FEW = 4  # vehicles, up to which they fly one by one

Function = Callable[..., None]


def scan(
    init: Init, step: Step, parameters: Tree, inputs: Tree, every: int = 1, threads: int | None = None
) -> Tree:
    """The loop over time of all vehicles, by default on all cores; see `engine.Scan`."""
    given, rows = leaves(parameters), leaves(inputs)
    vehicles, ticks = len(given[0]), len(rows[0])
    width = 1 if vehicles <= FEW else REGISTERS * _lanes()
    same = tuple(bool((leaf == leaf[0]).all()) for leaf in given)
    layout = Layout(width, same, tuple(leaf.ndim == 1 for leaf in rows), tuple(map(_steady, rows)))
    loop, function = _program(init, step, _bare(parameters), _bare(inputs), layout)
    lanes = -(-vehicles // width) * width
    outputs = np.empty((len(told(ticks, every)), len(loop.outputs), lanes))
    arrays = (
        np.array([leaf[0] for leaf, one in zip(given, same, strict=True) if one]),
        _laned([leaf for leaf, one in zip(given, same, strict=True) if not one], lanes),
        np.array([leaf for leaf in rows if leaf.ndim == 1]).T.copy(),
        _laned([leaf for leaf in rows if leaf.ndim == 2], lanes),
        outputs,
    )
    _run(function, arrays, (lanes, ticks, every), width, threads or len(os.sched_getaffinity(0)))
    return _answer(loop, outputs[..., :vehicles])


@lru_cache(maxsize=32)
def _program(init: Init, step: Step, parameters: Tree, inputs: Tree, layout: Layout) -> tuple[Loop, Function]:
    """A loop and its machine code, for bare trees; once for functions that are the same."""
    loop = traced(init, step, parameters, inputs)
    return loop, compiled(loop, layout)


def _bare(tree: Tree) -> Tree:
    """The tree without its numbers."""
    return refilled(tree, repeat(0))


@lru_cache(maxsize=32)
def compiled(loop: Loop, layout: Layout) -> Function:
    """A loop as a function of the addresses of ARRAYS, and COUNTS."""
    return _linked(module(loop, layout))


def _lanes() -> int:
    """How many numbers of float64 a register of this processor holds."""
    return 8 if llvm.get_host_cpu_features().get("avx512f") else 4


def machine() -> llvm.TargetMachine:
    """The machine that this runs on, with all that its processor can do."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=2, jit=True
    )


def _linked(text: str) -> Function:
    code = llvm.create_mcjit_compiler(llvm.parse_assembly(text), machine())
    code.finalize_object()
    signature = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * len(ARRAYS), *[ctypes.c_int64] * len(COUNTS))
    function: Any = signature(code.get_function_address("loop"))
    function.code = code  # lives as long as what calls it
    return function  # type: ignore[no-any-return]


def _run(
    function: Function, arrays: Sequence[Array], counts: tuple[int, ...], width: int, threads: int
) -> None:
    """All lanes, shared among threads in whole blocks; a thread holds no lock of Python's while it flies."""
    blocks = counts[0] // width
    shares = min(threads, blocks)
    cuts = [width * (blocks * k // shares) for k in range(shares + 1)]
    addresses = [array.ctypes.data for array in arrays]
    if shares == 1:
        function(*addresses, *counts, *cuts)
        return
    with ThreadPoolExecutor(shares) as pool:
        list(pool.map(lambda begin, end: function(*addresses, *counts, begin, end), cuts, cuts[1:]))


def _steady(leaf: Array) -> bool:
    """Whether an input is the same for all vehicles and, most of the time, the same as the tick before."""
    bits = np.ascontiguousarray(leaf, dtype=np.float64).view(np.int64)  # 0.0 and -0.0 are equal
    return leaf.ndim == 1 and int(np.count_nonzero(bits[1:] != bits[:-1])) <= len(leaf) // RARE


def _laned(leaves_: Sequence[Array], lanes: int) -> Array:
    """Leaves (..., vehicles) as (..., leaf, lanes); lanes too many repeat the last vehicle."""
    if not leaves_:
        return np.zeros(0)
    stacked = np.stack(leaves_, axis=-2)
    spare = np.repeat(stacked[..., -1:], lanes - stacked.shape[-1], axis=-1)
    return np.ascontiguousarray(np.concatenate([stacked, spare], axis=-1))


def _answer(loop: Loop, outputs: Array) -> Tree:
    """(rows, outputs, vehicles) -> the outputs' tree with leaves (vehicles, rows)."""
    kinds = (loop.trace.operations[number].logical for number in loop.outputs)
    series = (outputs[:, i].T for i in range(len(loop.outputs)))
    return refilled(loop.told, (x != 0.0 if logical else x for x, logical in zip(series, kinds, strict=True)))


ENGINE = Engine("compiled", scan)
