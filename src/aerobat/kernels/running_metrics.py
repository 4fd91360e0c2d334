"""Metrics of a flight, added up tick by tick: errors, saturation, divergence, the crossing of each gate."""

from __future__ import annotations

from functools import reduce
from math import inf
from operator import add as plus
from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Quaternion, Scalar, Vector
from aerobat.kernels.quaternions import angle_between
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import ZERO, add_scaled, dot, subtract


class MetricsInput(NamedTuple):
    """The instant of a tick."""

    time: Scalar  # [s]


class GatePlane(NamedTuple):
    """A gate as a plane to be crossed at a time."""

    centre: Vector  # [m]
    normal: Vector  # direction of passage, a unit vector
    planned: Scalar  # [s] when it is to be crossed
    window: Scalar  # [s] by which the crossing may be earlier or later
    depth: Scalar  # [m] beyond the plane that makes a crossing a passage


class MetricsParameters(NamedTuple):
    """Criteria by which a flight is judged."""

    divergence_radius_sq: Scalar  # [m²] of squared position error, beyond which a vehicle has diverged
    ground: Scalar  # [m] height, −infinity where there is none
    gates: tuple[GatePlane, ...]


class Snapshot(NamedTuple):
    """A vehicle at an instant."""

    time: Scalar  # [s]
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    q_world_body: Quaternion  # between two ticks not quite of unit length


class GateProgress(NamedTuple):
    """A flight before and behind a gate's plane so far, straight between ticks; offsets as positions."""

    latest: Snapshot  # the last crossing in the direction of passage
    beyond: Scalar  # 1 since that crossing, until it comes back
    crossing: Snapshot  # of those after which it got far enough beyond, the nearest to the planned instant
    backward: Scalar  # [s] the crossing against the direction next to that instant, infinite if there is none
    max_distance: Scalar  # [m] beyond the plane, of ticks in the window; −infinite before it
    min_distance: Scalar  # [m] likewise


class RunningMetrics(NamedTuple):
    """A flight so far. The last tick that counts is the first beyond the divergence radius, if any is."""

    flying: Scalar  # 1 until the vehicle has diverged, then 0
    is_finite: Scalar  # 0 once something was not a number
    stop: Scalar  # [s] the last tick that counts, once it has diverged
    ground_time: Scalar  # [s] when it was below ground first, infinite if never
    ticks: Scalar  # that count
    max_square: Scalar  # [m²] of the position error
    sum_square: Scalar  # [m²]
    max_angle: Scalar  # [rad] of the attitude error
    sum_square_angle: Scalar  # [rad²]
    saturated: Scalar  # ticks
    last: Snapshot
    gates: tuple[GateProgress, ...]


def init(gates: int) -> RunningMetrics:
    """Metrics before the first tick of a flight through so many gates."""
    nowhere = Snapshot(0.0, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
    never = nowhere._replace(time=inf)
    progress = GateProgress(never, 0.0, never, inf, -inf, inf)
    return RunningMetrics(1.0, 1.0, 0.0, inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nowhere, gates * (progress,))


def step(
    ops: Ops,
    parameters: MetricsParameters,
    metrics: RunningMetrics,
    body: Body,
    reference: tuple[Vector, Quaternion],
    actuation: tuple[PerRotor, PerRotor, Scalar],
    inputs: MetricsInput,
) -> RunningMetrics:
    """Metrics one tick later.

    Args:
        ops: of the arithmetic.
        parameters: what the flight is judged by.
        metrics: before the tick.
        body: the true state.
        reference: position [m] and attitude that are tracked.
        actuation: thrusts and commands of the rotors [N], and true where limits changed the commands.
        inputs: the instant.
    """
    position, q_world_body = reference
    thrusts, commands, saturated = actuation
    counts = ops.select(_is_finite(body, thrusts, commands), metrics.flying, 0.0)
    counted = counts > 0.5
    error = subtract(body.position, position)
    square = dot(error, error)
    angle = angle_between(ops, body.q_world_body, q_world_body)
    going = ops.select(square <= parameters.divergence_radius_sq, counts, 0.0)
    ended = (metrics.flying > 0.5) & (going < 0.5)
    below = counted & (body.position[2] < parameters.ground)
    now = Snapshot(inputs.time, *body[:3])
    return RunningMetrics(
        flying=going,
        is_finite=ops.select(ended & (counts < 0.5), 0.0, metrics.is_finite),
        stop=ops.select(ended, ops.select(counted, inputs.time, metrics.last.time), metrics.stop),
        ground_time=ops.minimum(metrics.ground_time, ops.select(below, inputs.time, inf)),
        ticks=metrics.ticks + counts,
        max_square=ops.select(counted, ops.maximum(metrics.max_square, square), metrics.max_square),
        sum_square=metrics.sum_square + ops.select(counted, square, 0.0),
        max_angle=ops.select(counted, ops.maximum(metrics.max_angle, angle), metrics.max_angle),
        sum_square_angle=metrics.sum_square_angle + ops.select(counted, angle * angle, 0.0),
        saturated=metrics.saturated + ops.select(saturated, counts, 0.0),
        last=now,
        gates=tuple(
            _progress(ops, progress, plane, (metrics.last, now), (metrics.ticks > 0.5, counted))
            for progress, plane in zip(metrics.gates, parameters.gates, strict=True)
        ),
    )


def _progress(
    ops: Ops,
    progress: GateProgress,
    plane: GatePlane,
    snapshots: tuple[Snapshot, Snapshot],
    counted: tuple[Scalar, Scalar],
) -> GateProgress:
    """Progress a tick later.

    Args:
        ops: of the arithmetic.
        progress: before the tick.
        plane: the gate's.
        snapshots: the last tick's and this one's.
        counted: true where there was a last tick, and where this one counts.
    """
    last, now = (one._replace(position=subtract(one.position, plane.centre)) for one in snapshots)
    before, behind = dot(last.position, plane.normal), dot(now.position, plane.normal)
    both = counted[0] & counted[1]
    forward = both & (before <= 0.0) & (behind > 0.0)
    back = both & (before > 0.0) & (behind <= 0.0)
    change = ops.select(forward, behind - before, ops.select(back, behind - before, 1.0))
    here = _between(last, now, -before / change)
    latest = _either(ops, forward, here, progress.latest)
    beyond = ops.select(forward, 1.0, ops.select(back, 0.0, progress.beyond))
    off_time = _magnitude(ops, latest.time - plane.planned)
    nearer = off_time < _magnitude(ops, progress.crossing.time - plane.planned)
    passed = counted[1] & (beyond > 0.5) & (behind >= plane.depth) & (off_time <= plane.window) & nearer
    back_off_time = _magnitude(ops, here.time - plane.planned)
    nearer_back = back_off_time < _magnitude(ops, progress.backward - plane.planned)
    in_window = counted[1] & (_magnitude(ops, now.time - plane.planned) <= plane.window)
    return GateProgress(
        latest,
        beyond,
        _either(ops, passed, latest, progress.crossing),
        ops.select(back & (back_off_time <= plane.window) & nearer_back, here.time, progress.backward),
        ops.select(in_window, ops.maximum(progress.max_distance, behind), progress.max_distance),
        ops.select(in_window, ops.minimum(progress.min_distance, behind), progress.min_distance),
    )


def _magnitude(ops: Ops, x: Scalar) -> Scalar:
    return ops.maximum(x, -x)


def _between(a: Snapshot, b: Snapshot, fraction: Scalar) -> Snapshot:
    w, x, y, z = (p + fraction * (q - p) for p, q in zip(a.q_world_body, b.q_world_body, strict=True))
    return Snapshot(
        a.time + fraction * (b.time - a.time),
        add_scaled(a.position, fraction, subtract(b.position, a.position)),
        add_scaled(a.velocity, fraction, subtract(b.velocity, a.velocity)),
        (w, x, y, z),
    )


def _either(ops: Ops, condition: Scalar, a: Snapshot, b: Snapshot) -> Snapshot:
    """`a` where the condition holds, else `b`."""
    return Snapshot(
        ops.select(condition, a.time, b.time),
        *(
            tuple(ops.select(condition, x, y) for x, y in zip(p, q, strict=True))
            for p, q in zip(a[1:], b[1:], strict=True)
        ),
    )


def _is_finite(body: Body, thrusts: PerRotor, commands: PerRotor) -> Scalar:
    """True while everything is a number: zero times it is then zero."""
    numbers = (x for part in (*body, thrusts, commands) for x in part)
    return reduce(plus, (0.0 * x for x in numbers)) <= 0.0
