"""The passage of a gate's plane, tick by tick, with straight motion between ticks."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from aerobat.kernels.gates import swath
from aerobat.kernels.gates.section import BoundingEllipsoid, GatePlane
from aerobat.kernels.gates.snapshot import Snapshot, Transition, interpolated, relative_to_moving
from aerobat.kernels.gates.swath import SwathProgress
from aerobat.kernels.ops import Ops, Scalar, magnitude, select_tree
from aerobat.kernels.vectors import ZERO, dot


class GateProgress(NamedTuple):
    """The progress of a flight at a gate's plane; positions are relative to the opening's centre."""

    latest: Snapshot  # the last crossing in the direction of passage
    crossing: Snapshot  # the crossing nearest to the planned time among those followed by a passage
    backward: Scalar  # [s] the crossing against the direction nearest to the planned time, infinite if none
    max_distance: Scalar  # [m] beyond the plane, over ticks in the window; −infinite before the window
    min_distance: Scalar  # [m] likewise
    swath: SwathProgress  # swath of the body through the plane


def init(gate: tuple[GatePlane, BoundingEllipsoid]) -> GateProgress:
    """Return the progress before the first tick."""
    never = Snapshot(inf, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
    return GateProgress(never, never, inf, -inf, inf, swath.init(len(gate[0].directions)))


def step(
    ops: Ops,
    progress: GateProgress,
    gate: tuple[GatePlane, BoundingEllipsoid],
    transition: Transition,
) -> GateProgress:
    """Return the progress a tick later, at a gate's plane; its ellipsoid is () for an unknown body."""
    plane, _ = gate
    last, now, _, counts = transition
    last, now = (relative_to_moving(ops, each, plane.centre, plane.motion) for each in (last, now))
    before, behind = dot(last.position, plane.normal), dot(now.position, plane.normal)
    both = transition.is_counted
    forward = both & (before <= 0.0) & (behind > 0.0)
    back = both & (before > 0.0) & (behind <= 0.0)
    crosses = ops.select(forward, 1.0, ops.select(back, 1.0, 0.0))
    fraction = -before / ops.select(crosses > 0.5, behind - before, 1.0)
    here = interpolated(last, now, fraction)
    latest = select_tree(ops, forward, here, progress.latest)
    is_passing = (behind > 0.0) & (behind < plane.depth) & (latest.time < inf)
    off_time = magnitude(ops, latest.time - plane.planned)
    nearer = off_time < magnitude(ops, progress.crossing.time - plane.planned)
    passed = counts & (behind >= plane.depth) & (off_time <= plane.window) & nearer
    back_off_time = magnitude(ops, here.time - plane.planned)
    nearer_back = back_off_time < magnitude(ops, progress.backward - plane.planned)
    in_window = counts & (magnitude(ops, now.time - plane.planned) <= plane.window)
    swept = progress.swath
    if plane.directions:
        seen = transition._replace(last=last, now=now)
        swept = swath.step(ops, swept, gate, seen, crosses, (is_passing, passed))
    return GateProgress(
        latest,
        select_tree(ops, passed, latest, progress.crossing),
        ops.select(back & (back_off_time <= plane.window) & nearer_back, here.time, progress.backward),
        ops.select(in_window, ops.maximum(progress.max_distance, behind), progress.max_distance),
        ops.select(in_window, ops.minimum(progress.min_distance, behind), progress.min_distance),
        swept,
    )
