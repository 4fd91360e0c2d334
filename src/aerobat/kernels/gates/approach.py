"""The nearest approach of a flight to a place, tick by tick, with straight motion between ticks."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates.snapshot import Snapshot, Transition, interpolated, relative
from aerobat.kernels.ops import Ops, Scalar, Vector, clip, magnitude, select_tree
from aerobat.kernels.vectors import ZERO, dot, subtract


class Target(NamedTuple):
    """A place to approach at a planned time."""

    centre: Vector  # [m]
    planned: Scalar  # [s]
    window: Scalar  # [s] largest deviation of the approach from that time


class Approach(NamedTuple):
    """The nearest approach so far."""

    square: Scalar  # [m²] of the distance, infinite before the window
    time: Scalar  # [s]
    velocity: Vector  # [m/s]


def init(target: Target) -> Approach:
    """Return the state before the first tick."""
    return Approach(inf, inf, ZERO)


def _nearest(ops: Ops, last: Snapshot, now: Snapshot) -> Approach:
    """Return the nearest approach between two snapshots with positions relative to the place."""
    displacement = subtract(now.position, last.position)
    square = dot(displacement, displacement)
    fraction = -dot(last.position, displacement) / ops.select(square > 0.0, square, 1.0)
    here = interpolated(last, now, clip(ops, fraction, 0.0, 1.0))
    return Approach(dot(here.position, here.position), here.time, here.velocity)


def step(ops: Ops, approach: Approach, target: Target, transition: Transition) -> Approach:
    """Return the nearest approach a tick later."""
    here = _nearest(ops, *(relative(each, target.centre) for each in (transition.last, transition.now)))
    counts = transition.is_counted & (magnitude(ops, here.time - target.planned) <= target.window)
    return select_tree(ops, counts & (here.square < approach.square), here, approach)
