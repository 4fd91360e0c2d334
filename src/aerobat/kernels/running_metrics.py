"""Metrics of a flight, added up tick by tick: errors, saturation, divergence, the approach of each gate."""

from __future__ import annotations

from functools import reduce
from math import inf
from operator import add as plus
from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Quaternion, Scalar, Vector
from aerobat.kernels.quaternions import angle_between
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import ZERO, add_scaled, dot, subtract

_TINY = 1e-30  # [m²] keeps 0/0 away, in single precision too


class MetricsInput(NamedTuple):
    """The instant of a tick."""

    time: Scalar  # [s]
    in_gate_window: tuple[Scalar, ...]  # for each gate 1 around its planned passage, 0 elsewhere


class MetricsParameters(NamedTuple):
    """Criteria by which a flight is judged."""

    divergence_radius_sq: Scalar  # [m²] of squared position error, beyond which a vehicle has diverged
    ground: Scalar  # [m] height, −infinity where there is none
    gates: tuple[Vector, ...]  # [m] the centres of their openings


class Snapshot(NamedTuple):
    """A vehicle at an instant."""

    time: Scalar  # [s]
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    q_world_body: Quaternion  # between two ticks not quite of unit length


class GateApproach(NamedTuple):
    """The nearest approach to a gate's centre so far, straight between ticks."""

    in_window: Scalar  # 1 if the last tick was in the window
    nearest: Snapshot  # its position is the offset [m] from the gate's centre
    distance_sq: Scalar  # [m²] infinite before the window


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
    gates: tuple[GateApproach, ...]


def init(gates: int) -> RunningMetrics:
    """Metrics before the first tick of a flight through so many gates."""
    nowhere = Snapshot(0.0, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
    approach = GateApproach(0.0, nowhere, inf)
    return RunningMetrics(1.0, 1.0, 0.0, inf, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nowhere, gates * (approach,))


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
            _approached(ops, approach, metrics.last, now, gate, ops.select(counted, in_window, 0.0))
            for approach, gate, in_window in zip(
                metrics.gates, parameters.gates, inputs.in_gate_window, strict=True
            )
        ),
    )


def _approached(
    ops: Ops, approach: GateApproach, last: Snapshot, now: Snapshot, gate: Vector, in_window: Scalar
) -> GateApproach:
    """The nearest of all in the window, with the piece from the last tick to this one."""
    now = now._replace(position=subtract(now.position, gate))
    last = last._replace(position=subtract(last.position, gate))
    since = _either(ops, approach.in_window > 0.5, last, now)
    change = subtract(now.position, since.position)
    fraction = -dot(since.position, change) / ops.maximum(dot(change, change), _TINY)
    fraction = ops.minimum(ops.maximum(fraction, 0.0), 1.0)
    here = _between(since, now, fraction)
    square = dot(here.position, here.position)
    nearer = (in_window > 0.5) & (square < approach.distance_sq)
    nearest = _either(ops, nearer, here, approach.nearest)
    return GateApproach(in_window, nearest, ops.select(nearer, square, approach.distance_sq))


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
