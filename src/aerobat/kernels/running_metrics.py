"""Metrics of a flight, accumulated tick by tick: errors, saturation, divergence and gate crossings."""

from __future__ import annotations

from functools import reduce
from math import inf
from operator import add as plus
from typing import NamedTuple

from aerobat.kernels.gates import approach, pointing, progress
from aerobat.kernels.gates.approach import Approach, Target
from aerobat.kernels.gates.pointing import Direction, Pointing
from aerobat.kernels.gates.progress import GateProgress
from aerobat.kernels.gates.section import BoundingEllipsoid, GatePlane
from aerobat.kernels.gates.snapshot import Snapshot, Transition
from aerobat.kernels.ops import Ops, PerRotor, Quaternion, Scalar, Vector
from aerobat.kernels.quaternions import angle_between
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import ZERO, dot, subtract


class Ground(NamedTuple):
    """The ground; a slow vehicle near it has landed, a fast one below it has crashed."""

    height: Scalar  # [m] below which a fast vehicle has hit the ground, −infinite without a ground
    landing_height: Scalar  # [m] below which a slow vehicle has hit the ground
    landing_speed_sq: Scalar  # [m²/s²] largest squared speed of a slow vehicle


class MetricsParameters(NamedTuple):
    """The criteria for a flight."""

    divergence_radius_sq: Scalar  # [m²] largest squared position error before divergence
    path_radius_sq: Scalar  # [m²] largest squared position error on the path
    ground: Ground
    ellipsoid: BoundingEllipsoid  # of the vehicle
    gates: tuple[GatePlane, ...]
    waypoints: tuple[Target, ...]
    attitudes: tuple[Direction, ...]


class RunningMetrics(NamedTuple):
    """Metrics of a flight so far. The first tick beyond the divergence radius is the last that counts."""

    flying: Scalar  # 1 until the vehicle has diverged, then 0
    is_finite: Scalar  # 0 once a value was not finite
    stop: Scalar  # [s] time of the last counted tick, once the vehicle has diverged
    ground_time: Scalar  # [s] first time below the ground, infinite if never
    off_path_time: Scalar  # [s] first time off the path, infinite if never
    ticks: Scalar  # number of counted ticks
    max_square: Scalar  # [m²] of the position error
    sum_square: Scalar  # [m²]
    max_angle: Scalar  # [rad] of the attitude error
    sum_square_angle: Scalar  # [rad²]
    saturated: Scalar  # number of saturated ticks
    last: Snapshot
    gates: tuple[GateProgress, ...]
    waypoints: tuple[Approach, ...]
    attitudes: tuple[Pointing, ...]


def init(parameters: MetricsParameters) -> RunningMetrics:
    """Return the metrics before the first tick of a flight."""
    nowhere = Snapshot(0.0, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
    gates = tuple(progress.init((plane, parameters.ellipsoid)) for plane in parameters.gates)
    waypoints = tuple(approach.init(target) for target in parameters.waypoints)
    attitudes = tuple(pointing.init(direction) for direction in parameters.attitudes)
    never = inf, inf
    none = (0.0,) * 6
    return RunningMetrics(1.0, 1.0, 0.0, *never, *none, nowhere, gates, waypoints, attitudes)


def step(
    ops: Ops,
    parameters: MetricsParameters,
    metrics: RunningMetrics,
    body: Body,
    reference: tuple[Vector, Quaternion],
    actuation: tuple[PerRotor, PerRotor, Scalar],
    time: Scalar,
) -> RunningMetrics:
    """Return the metrics one tick later.

    Args:
        ops: the arithmetic of the engine.
        parameters: the criteria for the flight.
        metrics: the metrics before the tick.
        body: the true state.
        reference: reference position [m] and attitude.
        actuation: rotor thrusts and commands [N], and whether limits changed the commands.
        time: time of the tick [s].
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
    below = counted & (body.position[2] < lowest_height(ops, parameters.ground, body.velocity))
    is_off = counted & (square > parameters.path_radius_sq)
    now = Snapshot(time, *body[:3])
    transition = Transition(metrics.last, now, metrics.ticks > 0.5, counted)
    return RunningMetrics(
        flying=going,
        is_finite=ops.select(ended & (counts < 0.5), 0.0, metrics.is_finite),
        stop=ops.select(ended, ops.select(counted, time, metrics.last.time), metrics.stop),
        ground_time=ops.minimum(metrics.ground_time, ops.select(below, time, inf)),
        off_path_time=ops.minimum(metrics.off_path_time, ops.select(is_off, time, inf)),
        ticks=metrics.ticks + counts,
        max_square=ops.select(counted, ops.maximum(metrics.max_square, square), metrics.max_square),
        sum_square=metrics.sum_square + ops.select(counted, square, 0.0),
        max_angle=ops.select(counted, ops.maximum(metrics.max_angle, angle), metrics.max_angle),
        sum_square_angle=metrics.sum_square_angle + ops.select(counted, angle * angle, 0.0),
        saturated=metrics.saturated + ops.select(saturated, counts, 0.0),
        last=now,
        gates=tuple(
            progress.step(ops, gate, (plane, parameters.ellipsoid), transition)
            for gate, plane in zip(metrics.gates, parameters.gates, strict=True)
        ),
        waypoints=tuple(
            approach.step(ops, latest, target, transition)
            for latest, target in zip(metrics.waypoints, parameters.waypoints, strict=True)
        ),
        attitudes=tuple(
            pointing.step(ops, latest, direction, transition)
            for latest, direction in zip(metrics.attitudes, parameters.attitudes, strict=True)
        ),
    )


def lowest_height(ops: Ops, ground: Ground, velocity: Vector) -> Scalar:
    """Return the height [m] below which a vehicle with a velocity [m/s] has hit the ground."""
    is_slow = dot(velocity, velocity) <= ground.landing_speed_sq
    return ops.select(is_slow, ground.landing_height, ground.height)


def _is_finite(body: Body, thrusts: PerRotor, commands: PerRotor) -> Scalar:
    """Return True while all numbers are finite: zero times them is then zero."""
    numbers = (x for part in (*body, thrusts, commands) for x in part)
    return reduce(plus, (0.0 * x for x in numbers)) <= 0.0
