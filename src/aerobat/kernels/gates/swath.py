"""The swath of a body through a gate's plane, tick by tick: its largest extents along some directions.

Only the stay at the opening counts during which the gate is crossed. A stay lasts while the body, or its
centre within the gate's depth, is at the plane and near enough to touch the circle around the opening. A body
that enters the plane beside the opening, and stays in it until it is through, has touched the frame, even an
infinitely thin one. Beyond the circle the plane does not count as frame.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates.section import (
    BoundingEllipsoid,
    GatePlane,
    PlaneDirection,
    PlanePoint,
    extent,
    farthest,
    fraction_of_farthest,
    gap,
    section,
)
from aerobat.kernels.gates.snapshot import Snapshot, Transition, interpolated
from aerobat.kernels.ops import Ops, Scalar, Vector, magnitude, select_tree
from aerobat.kernels.vectors import dot, norm, subtract


class Extreme(NamedTuple):
    """A point of the body in a gate's plane, relative to the centre of the opening, and its time."""

    time: Scalar  # [s] infinite where there is no such point
    reach: Scalar  # [m] largest extent; −infinite where there is no such point
    point: PlanePoint  # components along and beside the direction


Swath = tuple[Extreme, ...]  # the farthest points of a body in a gate's plane, one for each direction


class SwathProgress(NamedTuple):
    """The progress of a body through a gate's plane."""

    gap: Scalar  # [m] between body and plane, negative where they meet
    is_about: Scalar  # 1 while the vehicle is at the opening
    is_crossing: Scalar  # 1 during the stay in which the gate is crossed
    stay: Swath  # the extremes of this stay, NOWHERE outside a stay
    crossing: Swath  # the extremes of the stay in which the gate is crossed


NOWHERE = Extreme(inf, -inf, PlanePoint(0.0, 0.0))


def init(directions: int) -> SwathProgress:
    """Return the progress before the first tick, for a number of directions."""
    nothing = directions * (NOWHERE,)
    return SwathProgress(inf, 0.0, 0.0, nothing, nothing)


def step(
    ops: Ops,
    progress: SwathProgress,
    gate: tuple[GatePlane, BoundingEllipsoid],
    transition: Transition,
    crosses: Scalar,
    crossed: tuple[Scalar, Scalar],
) -> SwathProgress:
    """Return the progress a tick later.

    Args:
        ops: the arithmetic of the engine.
        progress: the progress before the tick.
        gate: the gate's plane, and the ellipsoid around the vehicle.
        transition: the vehicle at the last tick and at this one, positions relative to the opening's centre.
        crosses: 1 where the centre crosses the plane between them.
        crossed: two flags: whether the centre has crossed the plane anywhere and is within the depth; and
            whether, with this tick, this stay or the last one has become the one that counts.
    """
    plane, ellipsoid = gate
    is_passing, passed = crossed
    last, now, _, counts = transition
    across = plane.normal, *plane.directions[0][:2]
    gap_now = gap(ops, section(ops, ellipsoid, across, now.position, now.q_world_body))
    distance = magnitude(ops, dot(now.position, plane.normal))
    beside = norm(ops, now.position) - plane.radius - extent(ops, ellipsoid)
    at_plane = counts & (ops.minimum(gap_now, distance - plane.depth) <= 0.0)
    is_about = at_plane & (ops.select(is_passing, 0.0, beside) <= 0.0)
    met, here = swept_between(ops, gate, (last, now), (progress.gap, gap_now), crosses)
    before = select_tree(ops, progress.is_about > 0.5, progress.stay, len(plane.directions) * (NOWHERE,))
    stay = _wider(ops, transition.is_counted & met, here, before)
    is_crossing = ops.select(passed, 1.0, progress.is_crossing) > 0.5
    return SwathProgress(
        gap_now,
        ops.select(is_about, 1.0, 0.0),
        ops.select(is_crossing & at_plane & (beside <= 0.0), 1.0, 0.0),
        stay,
        select_tree(ops, is_crossing, stay, progress.crossing),
    )


def swept_between(
    ops: Ops,
    gate: tuple[GatePlane, BoundingEllipsoid],
    snapshots: tuple[Snapshot, Snapshot],
    gaps: tuple[Scalar, Scalar],
    crosses: Scalar,
) -> tuple[Scalar, Swath]:
    """Return True where the body meets the plane between two ticks, and its farthest points there.

    The attitude at the second tick determines the time of the extremes, the attitude at that time their size.

    Args:
        ops: the arithmetic of the engine.
        gate: the gate's plane, and the ellipsoid around the vehicle.
        snapshots: the snapshots at both ticks, positions relative to the opening's centre.
        gaps: distances between body and plane at both ticks [m].
        crosses: 1 where the centre crosses the plane between the ticks.
    """
    before, behind = gaps
    meets = ops.minimum(before, behind) <= 0.0
    changes = meets & (ops.maximum(before, behind) > 0.0)
    edge = before / ops.select(changes, before - behind, 1.0)
    comes, leaves = changes & (before > 0.0), changes & (behind > 0.0)
    within = ops.select(comes, edge, 0.0), ops.select(leaves, edge, 1.0)
    plane, ellipsoid = gate
    extremes = tuple(
        _extreme(ops, plane.normal, each, ellipsoid, snapshots, within) for each in plane.directions
    )
    return ops.select(meets, 1.0, crosses) > 0.5, extremes


def _extreme(
    ops: Ops,
    normal: Vector,
    direction: PlaneDirection,
    ellipsoid: BoundingEllipsoid,
    snapshots: tuple[Snapshot, Snapshot],
    within: tuple[Scalar, Scalar],
) -> Extreme:
    """Return the farthest point along a direction, within fractions of the way between two ticks.

    Args:
        ops: the arithmetic of the engine.
        normal: normal of the plane.
        direction: direction in the plane.
        ellipsoid: the ellipsoid around the vehicle.
        snapshots: the snapshots at both ticks, positions relative to the opening's centre.
        within: the smallest and the largest fraction.
    """
    last, now = snapshots
    directions = normal, direction.along, direction.beside
    displacement = subtract(now.position, last.position)
    end_section = section(ops, ellipsoid, directions, now.position, now.q_world_body)
    change = dot(displacement, directions[0]), dot(displacement, directions[1])
    fraction = fraction_of_farthest(ops, end_section, change, within, direction.both_ways)
    at = interpolated(last, now, fraction)
    here = section(ops, ellipsoid, directions, at.position, at.q_world_body)
    point = farthest(ops, here, direction.both_ways)
    reach = ops.select(direction.both_ways > 0.5, magnitude(ops, point.along), point.along)
    distance = ops.sqrt(point.along * point.along + point.beside * point.beside)
    return Extreme(at.time, ops.select(direction.radial > 0.5, distance, reach), point)


def _wider(ops: Ops, condition: Scalar, a: Swath, b: Swath) -> Swath:
    """Return the farther of each pair of extremes; `a`'s only where the condition holds."""
    return tuple(select_tree(ops, condition & (p.reach > q.reach), p, q) for p, q in zip(a, b, strict=True))
