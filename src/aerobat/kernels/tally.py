"""What a flight comes to, added up tick by tick: errors, saturation, divergence, the passage of a gate."""

from __future__ import annotations

from functools import reduce
from math import inf
from operator import add as plus
from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Quaternion, Scalar, Vector
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import ZERO, add_scaled, angle_between, dot, subtract

_TINY = 1e-30  # [m²] keeps 0/0 away, in single precision too


class Asked(NamedTuple):
    """What a tick is judged by."""

    time: Scalar  # [s]
    position: Vector  # [m]
    q_world_body: Quaternion
    seeking: Scalar  # 1 around the planned passage of the gate, 0 elsewhere


class Bounds(NamedTuple):
    """What a flight is judged by."""

    farthest: Scalar  # [m²] of squared position error, beyond which a vehicle has diverged
    gate: Vector  # [m] the centre of its opening


class Near(NamedTuple):
    """A vehicle next to the gate."""

    time: Scalar  # [s]
    offset: Vector  # [m] from the gate's centre
    velocity: Vector  # [m/s]
    q_world_body: Quaternion  # between two ticks not quite of unit length


class Tally(NamedTuple):
    """A flight so far. The last tick that counts is the first beyond the farthest, if there is one."""

    flying: Scalar  # 1 until the vehicle has diverged, then 0
    sound: Scalar  # 0 once something was not a number
    stop: Scalar  # [s] when it diverged
    ticks: Scalar  # that count
    max_square: Scalar  # [m²] of the position error
    sum_square: Scalar  # [m²]
    max_angle: Scalar  # [rad] of the attitude error
    sum_square_angle: Scalar  # [rad²]
    saturated: Scalar  # ticks
    sought: Scalar  # 1 if the gate was sought at the last tick
    last: Near  # the vehicle then
    nearest: Near  # to the gate's centre on the way so far, straight between ticks
    nearest_square: Scalar  # [m²] infinite while it was not sought


def init() -> Tally:
    """Nothing yet."""
    nowhere = Near(0.0, ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
    return Tally(1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nowhere, nowhere, inf)


def step(
    ops: Ops,
    bounds: Bounds,
    tally: Tally,
    body: Body,
    actuation: tuple[PerRotor, PerRotor],
    saturated: Scalar,
    asked: Asked,
) -> Tally:
    """One tick more, with what rotors give and are told [N]."""
    finite = _finite(body, actuation)
    counts = ops.select(finite, tally.flying, 0.0)
    counted = counts > 0.5
    error = subtract(body.position, asked.position)
    square = dot(error, error)
    angle = angle_between(ops, body.q_world_body, asked.q_world_body)
    going = ops.select(square <= bounds.farthest, counts, 0.0)
    ended = (tally.flying > 0.5) & (going < 0.5)
    now = Near(asked.time, subtract(body.position, bounds.gate), body.velocity, body.q_world_body)
    seeking = ops.select(counted, asked.seeking, 0.0)
    nearest, nearest_square = _nearest(ops, tally, now, seeking)
    return Tally(
        flying=going,
        sound=ops.select(ended & (counts < 0.5), 0.0, tally.sound),
        stop=ops.select(ended, asked.time, tally.stop),
        ticks=tally.ticks + counts,
        max_square=ops.select(counted, ops.maximum(tally.max_square, square), tally.max_square),
        sum_square=tally.sum_square + ops.select(counted, square, 0.0),
        max_angle=ops.select(counted, ops.maximum(tally.max_angle, angle), tally.max_angle),
        sum_square_angle=tally.sum_square_angle + ops.select(counted, angle * angle, 0.0),
        saturated=tally.saturated + ops.select(saturated, counts, 0.0),
        sought=seeking,
        last=now,
        nearest=nearest,
        nearest_square=nearest_square,
    )


def _nearest(ops: Ops, tally: Tally, now: Near, seeking: Scalar) -> tuple[Near, Scalar]:
    """The nearest of all sought, with the piece from the last tick to this one."""
    since = _either(ops, tally.sought > 0.5, tally.last, now)
    change = subtract(now.offset, since.offset)
    share = -dot(since.offset, change) / ops.maximum(dot(change, change), _TINY)
    share = ops.minimum(ops.maximum(share, 0.0), 1.0)
    here = _between(since, now, share)
    square = dot(here.offset, here.offset)
    nearer = (seeking > 0.5) & (square < tally.nearest_square)
    return _either(ops, nearer, here, tally.nearest), ops.select(nearer, square, tally.nearest_square)


def _between(a: Near, b: Near, share: Scalar) -> Near:
    return Near(
        a.time + share * (b.time - a.time),
        add_scaled(a.offset, share, subtract(b.offset, a.offset)),
        add_scaled(a.velocity, share, subtract(b.velocity, a.velocity)),
        _mixed(a.q_world_body, b.q_world_body, share),
    )


def _mixed(p: Quaternion, q: Quaternion, share: Scalar) -> Quaternion:
    w, x, y, z = (a + share * (b - a) for a, b in zip(p, q, strict=True))
    return w, x, y, z


def _either(ops: Ops, condition: Scalar, a: Near, b: Near) -> Near:
    """`a` where the condition holds, else `b`."""
    return Near(
        ops.select(condition, a.time, b.time),
        *(
            tuple(ops.select(condition, x, y) for x, y in zip(p, q, strict=True))
            for p, q in zip(a[1:], b[1:], strict=True)
        ),
    )


def _finite(body: Body, actuation: tuple[PerRotor, PerRotor]) -> Scalar:
    """Whether everything is a number: zero times it is then zero."""
    numbers = (x for part in (*body, *actuation) for x in part)
    return reduce(plus, (0.0 * x for x in numbers)) <= 0.0
