"""Traced functions as machine code, evaluated at many places at once along several directions each.

A function is the `scan` of a loop without a carry: places are vehicles and directions are ticks. Values that
do not depend on the direction are computed once for each place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement
from operator import mul
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.duals import Dual, DualOps, value_and_tangent
from aerobat.engines.gradient import gradient
from aerobat.engines.llvm.engine import address, lanes, machine_code
from aerobat.engines.llvm.packing import ARRAYS, InputKind, Layout
from aerobat.engines.traced_loop import TracedLoop
from aerobat.engines.tracing import Symbol, Trace
from aerobat.kernels.ops import Ops, Scalar, Vector

PlaceFunction = Callable[[Array, Array, Array], Array]
Kernel = Callable[[Ops, Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]], Sequence[Scalar]]
NO_DIRECTION = np.zeros((1, 0))
_UNUSED = (None,) * (len(ARRAYS) - 4)  # the unused arrays: all but the first three and the last


class SmoothFunctions(NamedTuple):
    """A kernel at places: of shared values (s,), own values (m, w) and directions (t, d), (t, o, m) each.

    Own values are the moving values, then the fixed ones and, for the curvature, the weights of the kernel's
    results.
    """

    values: PlaceFunction  # along NO_DIRECTION
    slopes: PlaceFunction  # along directions of the moving values
    curvature: PlaceFunction  # derivative of the weighted sum's slopes by the moving values


def smooth_functions(
    kernel: Kernel, shared: int, moved: int, fixed: int = 0, squares: bool = False
) -> SmoothFunctions:
    """Return a kernel and two derivatives as machine code.

    Args:
        kernel: A function of the arithmetic, and of the shared, moving and fixed values of a place.
        shared: The number of shared values, the same for all places.
        moved: The number of moving values of a place, by which derivatives are taken.
        fixed: The number of fixed values of a place.
        squares: Whether the curvature includes that of Σ w_ij slope_i slope_j / 2. The weights of the pairs
            follow the other weights, in the order of `combinations_with_replacement`; pairs of unlike slopes
            have one weight.
    """
    trace = Trace()

    def inputs(name: str, count: int) -> list[Symbol]:
        return [trace.input(f"{name} {i}") for i in range(count)]

    common, moving, fixed_symbols = inputs("shared", shared), inputs("moved", moved), inputs("fixed", fixed)
    directions, own = inputs("direction", moved), [*moving, *fixed_symbols]
    along = [*map(Dual, moving, directions)]
    found = kernel(DualOps(trace), [*map(Dual, common)], along, [*map(Dual, fixed_symbols)])
    parts = zip(*map(value_and_tangent, found), strict=True)
    values, slopes = ([trace.symbol(part) for part in each] for each in parts)
    weights = inputs("weight", len(values))
    curvature = gradient(trace.symbol(sum(map(mul, weights, slopes))), moving)
    if squares:
        pairs = [a * b if a is not b else 0.5 * a * b for a, b in combinations_with_replacement(slopes, 2)]
        weights += inputs("pair", len(pairs))
        squared = trace.symbol(sum(map(mul, weights[len(values) :], pairs)))
        curvature = [*map(Symbol.__add__, curvature, gradient(squared, directions))]
    return SmoothFunctions(
        place_function(common, own, (), values),
        place_function(common, own, directions, slopes),
        place_function(common, [*own, *weights], directions, curvature),
    )


def triples(values: Sequence[Scalar]) -> list[Vector]:
    """Return values as vectors of three."""
    return [(values[k], values[k + 1], values[k + 2]) for k in range(0, len(values), 3)]


def place_function(
    shared: Sequence[Symbol], own: Sequence[Symbol], directions: Sequence[Symbol], outputs: Sequence[Symbol]
) -> PlaceFunction:
    """Return the traced function of shared (s,), own (m, w) and direction values (t, d), (t, o, m).

    Args:
        shared: Inputs that are one number for all places.
        own: Inputs that differ between places.
        directions: Inputs that all places take in turn, one row after another.
        outputs: The results.
    """
    given, ticks, found = (tuple(s.number for s in each) for each in ((*shared, *own), directions, outputs))
    loop = TracedLoop(outputs[0].trace, given, ticks, (), (), (), found, (), ())
    width, constant = lanes(), (False,) * len(ticks)
    places = (True,) * len(shared) + (False,) * len(own)
    layout = Layout(width, places, (InputKind(shared=True),) * len(ticks), constant)
    _, scan = machine_code(loop, layout)

    def function(shared: Array, own: Array, directions: Array) -> Array:
        blocks = -(-len(own) // width)
        padding = blocks * width - len(own)
        padded = np.concatenate([own, own[:1].repeat(padding, 0)]) if padding else own
        packed = padded.reshape(blocks, width, -1).swapaxes(1, 2).copy()
        result = np.empty((len(directions), len(found), blocks * width))
        given = map(address, (shared, packed, directions))
        addresses = [*given, *_UNUSED, address(result)]
        scan(*addresses, blocks * width, len(directions), 0, 0, 1, 0, blocks * width)
        return result[..., : len(own)]

    return function
