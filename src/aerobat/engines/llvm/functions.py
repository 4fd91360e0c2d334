"""Traces as machine code of many places at once, along several directions from each.

It is `scan` of a loop without a carry: places are its vehicles, directions its ticks, and what directions do
not change is computed once a place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.llvm.engine import lanes, machine_code
from aerobat.engines.llvm.packing import ARRAYS, InputKind, Layout
from aerobat.engines.traced_loop import TracedLoop
from aerobat.engines.tracing import Symbol

PlaceFunction = Callable[[Array, Array, Array], Array]
_NONE = np.zeros(0)


def place_function(
    shared: Sequence[Symbol], own: Sequence[Symbol], directions: Sequence[Symbol], outputs: Sequence[Symbol]
) -> PlaceFunction:
    """Return the function of a trace from shared values (s,), own (m, w) and directions (t, d) to (t, o, m).

    Args:
        shared: Inputs that are one number for all places.
        own: Inputs of which every place has its own.
        directions: Inputs that all places take in turn, one row after another.
        outputs: What comes out.
    """
    given, turns, found = (tuple(s.number for s in each) for each in ((*shared, *own), directions, outputs))
    loop = TracedLoop(outputs[0].trace, given, turns, (), (), (), found, (), ())
    width, constant = lanes(), (False,) * len(turns)
    places = (True,) * len(shared) + (False,) * len(own)
    layout = Layout(width, places, (InputKind(shared=True),) * len(turns), (), constant)
    _, scan = machine_code(loop, layout)

    def function(shared: Array, own: Array, directions: Array) -> Array:
        blocks = -(-len(own) // width)
        padded = np.concatenate([own, own[:1].repeat(blocks * width - len(own), 0)])
        packed = padded.reshape(blocks, width, -1).swapaxes(1, 2).copy()
        result = np.empty((len(directions), len(found), blocks * width))
        given = dict(zip(ARRAYS, (shared, packed, directions), strict=False)) | {"outputs": result}
        addresses = [given.get(name, _NONE).ctypes.data for name in ARRAYS]
        scan(*addresses, blocks * width, len(directions), 0, 0, 1, 0, blocks * width)
        return result[..., : len(own)]

    return function
