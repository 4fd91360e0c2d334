"""A flight about a place that it is to come near, tick by tick, straight between ticks."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates.snapshot import Snapshot, between, relative
from aerobat.kernels.ops import Ops, Scalar, Vector, clip, magnitude, select_tree
from aerobat.kernels.vectors import ZERO, dot, subtract


class Target(NamedTuple):
    """A place to come near at a time."""

    centre: Vector  # [m]
    planned: Scalar  # [s]
    window: Scalar  # [s] by which the approach may be earlier or later


class Approach(NamedTuple):
    """The nearest that a flight has come so far."""

    square: Scalar  # [m²] of the distance, infinite before the window
    time: Scalar  # [s]
    velocity: Vector  # [m/s]


def init(target: Target) -> Approach:
    """Before the first tick."""
    return Approach(inf, inf, ZERO)


def _nearest(ops: Ops, last: Snapshot, now: Snapshot) -> Approach:
    """The nearest between two snapshots, positions from the place."""
    way = subtract(now.position, last.position)
    square = dot(way, way)
    toward = -dot(last.position, way) / ops.select(square > 0.0, square, 1.0)
    here = between(last, now, clip(ops, toward, 0.0, 1.0))
    return Approach(dot(here.position, here.position), here.time, here.velocity)


def step(
    ops: Ops,
    approach: Approach,
    target: Target,
    snapshots: tuple[Snapshot, Snapshot],
    counted: tuple[Scalar, Scalar],
) -> Approach:
    """The nearest a tick later.

    Args:
        ops: of the arithmetic.
        approach: before the tick.
        target: the place.
        snapshots: the last tick's and this one's.
        counted: true where there was a last tick, and where this one counts.
    """
    here = _nearest(ops, *(relative(each, target.centre) for each in snapshots))
    in_window = magnitude(ops, here.time - target.planned) <= target.window
    counts = counted[0] & counted[1] & in_window
    return select_tree(ops, counts & (here.square < approach.square), here, approach)
