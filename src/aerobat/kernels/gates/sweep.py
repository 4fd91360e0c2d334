"""The body swept through a gate's plane, tick by tick: how far it reached across the opening and up in it.

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
    plane_gap,
    section_extremes,
)
from aerobat.kernels.gates.snapshot import Snapshot, between
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.vectors import dot


class TimedPoint(NamedTuple):
    """A point of the body in a gate's plane, and when."""

    time: Scalar  # [s] infinite where there is none
    point: PlanePoint


class Sweep(NamedTuple):
    """The farthest that a body reached in a gate's plane."""

    widest: TimedPoint  # from the middle across the opening, on either side
    highest: TimedPoint  # up or down


class SweepProgress(NamedTuple):
    """A body about a gate's plane so far."""

    gap: Scalar  # [m] between body and plane, negative where they meet
    is_about: Scalar  # 1 while the vehicle is about the plane
    is_crossing: Scalar  # 1 while that stay is the one in which the gate is crossed
    stay: Sweep  # of this stay, none where there is none
    crossing: Sweep  # of the one in which the gate is crossed


NO_POINT = TimedPoint(inf, PlanePoint(0.0, 0.0))
NO_SWEEP = Sweep(NO_POINT, NO_POINT)


def init() -> SweepProgress:
    """Progress before the first tick."""
    return SweepProgress(inf, 0.0, 0.0, NO_SWEEP, NO_SWEEP)


def step(
    ops: Ops,
    progress: SweepProgress,
    parameters: tuple[GateFrame, Scalar, BoundingEllipsoid],
    snapshots: tuple[Snapshot, Snapshot],
    counted: tuple[Scalar, Scalar],
    crossing: tuple[Scalar, Scalar],
    passed: Scalar,
) -> SweepProgress:
    """Progress a tick later.

    Args:
        ops: of the arithmetic.
        progress: before the tick.
        parameters: the gate's axes, the depth [m] about its plane, and what encloses the vehicle.
        snapshots: the last tick's and this one's, positions from the opening's centre.
        counted: true where there was a last tick, and where this one counts.
        crossing: 1 where the centre crosses the plane between them, and at which fraction of the way.
        passed: true where with this tick the stay, this or the last, has become the one that counts.
    """
    frame, depth, ellipsoid = parameters
    now = snapshots[1]
    gap = plane_gap(ops, ellipsoid, frame, now.position, now.q_world_body)
    distance = magnitude(ops, dot(now.position, frame.normal))
    is_about = counted[1] & (ops.minimum(gap, distance - depth) <= 0.0)
    met, here = swept_between(ops, frame, ellipsoid, snapshots, (progress.gap, gap), crossing)
    before = _either(ops, progress.is_about > 0.5, progress.stay, NO_SWEEP)
    stay = _wider(ops, counted[0] & counted[1] & met, here, before)
    is_crossing = ops.select(passed, 1.0, progress.is_crossing) > 0.5
    return SweepProgress(
        gap,
        ops.select(is_about, 1.0, 0.0),
        ops.select(is_crossing & is_about, 1.0, 0.0),
        stay,
        _either(ops, is_crossing, stay, progress.crossing),
    )


def swept_between(
    ops: Ops,
    frame: GateFrame,
    ellipsoid: BoundingEllipsoid,
    snapshots: tuple[Snapshot, Snapshot],
    gaps: tuple[Scalar, Scalar],
    crossing: tuple[Scalar, Scalar],
) -> tuple[Scalar, Sweep]:
    """True where the body meets the plane between two ticks, and the farthest that it reaches there.

    It is looked at where it comes into the plane or leaves it, else at the second tick; where it flies
    through from one tick to the next, as its centre crosses.

    Args:
        ops: of the arithmetic.
        frame: the gate's axes.
        ellipsoid: what encloses the vehicle.
        snapshots: at both ticks, positions from the opening's centre.
        gaps: between body and plane at both [m].
        crossing: 1 where the centre crosses the plane between them, and at which fraction of the way.
    """
    before, behind = gaps
    crosses, fraction = crossing
    met, stays = ops.minimum(before, behind) <= 0.0, ops.maximum(before, behind) <= 0.0
    change = ops.select(met, ops.select(stays, 1.0, before - behind), 1.0)
    fraction = ops.select(met, ops.select(stays, 1.0, before / change), fraction)
    here = between(*snapshots, fraction)
    widest, highest = section_extremes(ops, ellipsoid, frame, here.position, here.q_world_body)
    return ops.select(met, 1.0, crosses) > 0.5, Sweep(
        TimedPoint(here.time, widest), TimedPoint(here.time, highest)
    )


def magnitude(ops: Ops, x: Scalar) -> Scalar:
    """|x|."""
    return ops.maximum(x, -x)


def _wider(ops: Ops, condition: Scalar, a: Sweep, b: Sweep) -> Sweep:
    """Of both extremes the farther, `a`'s only where the condition holds."""
    wider = magnitude(ops, a.widest.point.lateral) > magnitude(ops, b.widest.point.lateral)
    higher = magnitude(ops, a.highest.point.up) > magnitude(ops, b.highest.point.up)
    return Sweep(
        _either_point(ops, condition & wider, a.widest, b.widest),
        _either_point(ops, condition & higher, a.highest, b.highest),
    )


def _either(ops: Ops, condition: Scalar, a: Sweep, b: Sweep) -> Sweep:
    """`a` where the condition holds, else `b`."""
    return Sweep(*(_either_point(ops, condition, p, q) for p, q in zip(a, b, strict=True)))


def _either_point(ops: Ops, condition: Scalar, a: TimedPoint, b: TimedPoint) -> TimedPoint:
    lateral, up = (ops.select(condition, x, y) for x, y in zip(a.point, b.point, strict=True))
    return TimedPoint(ops.select(condition, a.time, b.time), PlanePoint(lateral, up))
