"""The swath of a body through a gate's plane, tick by tick: how far it reached across and up.

What counts is the stay about the plane in which the gate is crossed: from when the body, or the centre within
the gate's depth, comes to the plane until both have left it. A body that comes into the plane beside the
opening, and is in it without a break until it is through, has met the frame, however thin that is.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates.section import (
    BoundingEllipsoid,
    GateFrame,
    PlanePoint,
    farthest,
    fraction_of_farthest,
    gap,
    section,
)
from aerobat.kernels.gates.snapshot import Snapshot, between
from aerobat.kernels.ops import Ops, Scalar, Vector, magnitude, select_tree
from aerobat.kernels.vectors import dot, subtract


class Extreme(NamedTuple):
    """A point of the body in a gate's plane, from the centre of the opening, and when."""

    time: Scalar  # [s] infinite where there is none
    point: PlanePoint


class Swath(NamedTuple):
    """The farthest that a body reached in a gate's plane."""

    widest: Extreme  # along the lateral, to either side
    highest: Extreme  # along the upright, up or down


class SwathProgress(NamedTuple):
    """A body about a gate's plane so far."""

    gap: Scalar  # [m] between body and plane, negative where they meet
    is_about: Scalar  # 1 while the vehicle is about the plane
    is_crossing: Scalar  # 1 while that stay is the one in which the gate is crossed
    stay: Swath  # of this stay, none where there is none
    crossing: Swath  # of the one in which the gate is crossed


NOWHERE = Extreme(inf, PlanePoint(0.0, 0.0))
NO_SWATH = Swath(NOWHERE, NOWHERE)


def init() -> SwathProgress:
    """Progress before the first tick."""
    return SwathProgress(inf, 0.0, 0.0, NO_SWATH, NO_SWATH)


def step(
    ops: Ops,
    progress: SwathProgress,
    parameters: tuple[GateFrame, Scalar, BoundingEllipsoid],
    snapshots: tuple[Snapshot, Snapshot],
    counted: tuple[Scalar, Scalar],
    crosses: Scalar,
    passed: Scalar,
) -> SwathProgress:
    """Progress a tick later.

    Args:
        ops: of the arithmetic.
        progress: before the tick.
        parameters: the gate's axes, the depth [m] about its plane, and what encloses the vehicle.
        snapshots: the last tick's and this one's, positions from the opening's centre.
        counted: true where there was a last tick, and where this one counts.
        crosses: 1 where the centre crosses the plane between them.
        passed: true where with this tick the stay, this or the last, has become the one that counts.
    """
    frame, depth, ellipsoid = parameters
    now = snapshots[1]
    gap_now = gap(ops, section(ops, ellipsoid, frame, now.position, now.q_world_body))
    distance = magnitude(ops, dot(now.position, frame.normal))
    is_about = counted[1] & (ops.minimum(gap_now, distance - depth) <= 0.0)
    met, here = swept_between(ops, frame, ellipsoid, snapshots, (progress.gap, gap_now), crosses)
    before = select_tree(ops, progress.is_about > 0.5, progress.stay, NO_SWATH)
    stay = _wider(ops, counted[0] & counted[1] & met, here, before)
    is_crossing = ops.select(passed, 1.0, progress.is_crossing) > 0.5
    return SwathProgress(
        gap_now,
        ops.select(is_about, 1.0, 0.0),
        ops.select(is_crossing & is_about, 1.0, 0.0),
        stay,
        select_tree(ops, is_crossing, stay, progress.crossing),
    )


def swept_between(
    ops: Ops,
    frame: GateFrame,
    ellipsoid: BoundingEllipsoid,
    snapshots: tuple[Snapshot, Snapshot],
    gaps: tuple[Scalar, Scalar],
    crosses: Scalar,
) -> tuple[Scalar, Swath]:
    """True where the body meets the plane between two ticks, and the farthest that it reaches there.

    Where it reaches the farthest is said by the attitude at the second tick, how far by the one there.

    Args:
        ops: of the arithmetic.
        frame: the gate's axes.
        ellipsoid: what encloses the vehicle.
        snapshots: at both ticks, positions from the opening's centre.
        gaps: between body and plane at both [m].
        crosses: 1 where the centre crosses the plane between them.
    """
    before, behind = gaps
    meets = ops.minimum(before, behind) <= 0.0
    changes = meets & (ops.maximum(before, behind) > 0.0)
    edge = before / ops.select(changes, before - behind, 1.0)
    comes, leaves = changes & (before > 0.0), changes & (behind > 0.0)
    within = ops.select(comes, edge, 0.0), ops.select(leaves, edge, 1.0)
    normal, lateral, up = frame
    extremes = (
        _extreme(ops, (normal, along, beside), ellipsoid, snapshots, within)
        for along, beside in ((lateral, up), (up, lateral))
    )
    return ops.select(meets, 1.0, crosses) > 0.5, Swath(*extremes)


def _extreme(
    ops: Ops,
    directions: tuple[Vector, Vector, Vector],
    ellipsoid: BoundingEllipsoid,
    snapshots: tuple[Snapshot, Snapshot],
    within: tuple[Scalar, Scalar],
) -> Extreme:
    """The farthest along the second of the directions, within fractions of the way between two ticks."""
    last, now = snapshots
    way = subtract(now.position, last.position)
    there = section(ops, ellipsoid, directions, now.position, now.q_world_body)
    change = dot(way, directions[0]), dot(way, directions[1])
    at = between(last, now, fraction_of_farthest(ops, there, change, within))
    here = section(ops, ellipsoid, directions, at.position, at.q_world_body)
    return Extreme(at.time, farthest(ops, here))


def _wider(ops: Ops, condition: Scalar, a: Swath, b: Swath) -> Swath:
    """Of both extremes the farther, `a`'s only where the condition holds."""
    return Swath(*(_farther(ops, condition, p, q) for p, q in zip(a, b, strict=True)))


def _farther(ops: Ops, condition: Scalar, a: Extreme, b: Extreme) -> Extreme:
    is_farther = magnitude(ops, a.point.along) > magnitude(ops, b.point.along)
    return select_tree(ops, condition & is_farther, a, b)
