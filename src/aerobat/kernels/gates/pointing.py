"""The angle between a flight's thrust axis and a required direction, tick by tick."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates.snapshot import Snapshot, Transition
from aerobat.kernels.ops import Ops, Scalar, Vector, clip, magnitude, select_tree
from aerobat.kernels.quaternions import axes
from aerobat.kernels.vectors import add_scaled, dot, norm, subtract

_MIN_CURVATURE = 1e-12  # [-] smallest curvature of the cosine; less is rounding


class Direction(NamedTuple):
    """A required direction of the thrust axis at a planned time."""

    up: Vector  # unit vector, world
    planned: Scalar  # [s]
    window: Scalar  # [s] largest deviation from that time


class Pointing(NamedTuple):
    """The smallest angle between the thrust axis and the direction so far."""

    cosine: Scalar  # [-] of the angle between them, −infinite before the window
    time: Scalar  # [s]


def init(direction: Direction) -> Pointing:
    """Return the state before the first tick."""
    return Pointing(-inf, inf)


def _nearest(ops: Ops, direction: Direction, last: Snapshot, now: Snapshot) -> Pointing:
    """Return the smallest angle between two snapshots, with linear motion of the thrust axis between them.

    The cosine (p + q s) / |a + s d|, with the axes a and a + d at both ends, has one extremum in s, in closed
    form.
    """
    before, after = axes(last.q_world_body)[2], axes(now.q_world_body)[2]
    change = subtract(after, before)
    p, q = dot(before, direction.up), dot(change, direction.up)
    square, slope, change_sq = dot(before, before), dot(before, change), dot(change, change)
    curved = p * change_sq - q * slope
    is_curved = magnitude(ops, curved) > _MIN_CURVATURE
    fraction = (q * square - p * slope) / ops.select(is_curved, curved, 1.0)
    fraction = clip(ops, ops.select(is_curved, fraction, 1.0), 0.0, 1.0)
    axis = add_scaled(before, fraction, change)
    cosine, end = dot(axis, direction.up) / norm(ops, axis), p + q
    time = last.time + fraction * (now.time - last.time)
    return select_tree(ops, cosine > end, Pointing(cosine, time), Pointing(end, now.time))


def step(ops: Ops, pointing: Pointing, direction: Direction, transition: Transition) -> Pointing:
    """Return the smallest angle a tick later; attitudes at the ticks are of unit length."""
    here = _nearest(ops, direction, transition.last, transition.now)
    counts = transition.is_counted & (magnitude(ops, here.time - direction.planned) <= direction.window)
    return select_tree(ops, counts & (here.cosine > pointing.cosine), here, pointing)
