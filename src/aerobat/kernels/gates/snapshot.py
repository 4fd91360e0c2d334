"""The state of a vehicle at an instant, and interpolation between two instants."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, Quaternion, Scalar, Vector
from aerobat.kernels.vectors import add_scaled, subtract


class Snapshot(NamedTuple):
    """The state of a vehicle at an instant."""

    time: Scalar  # [s]
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    q_world_body: Quaternion  # interpolated attitudes are not of unit length


class Transition(NamedTuple):
    """A vehicle at the last tick and at this tick; its motion between them is straight."""

    last: Snapshot
    now: Snapshot
    follows: Scalar  # whether there was a last tick
    counts: Scalar  # whether this tick counts

    @property
    def is_counted(self) -> Scalar:
        """True where the motion between the ticks counts."""
        return self.follows & self.counts


class VelocityJump(NamedTuple):
    """An instant at which the velocity of a place jumps."""

    time: Scalar  # [s]
    change: Vector  # [m/s]


class PlaceMotion(NamedTuple):
    """The motion of a place from its initial position."""

    velocity: Vector  # [m/s] before all jumps
    velocity_jumps: tuple[VelocityJump, ...]


def relative_to_moving(
    ops: Ops, snapshot: Snapshot, centre: Vector, motion: PlaceMotion | tuple[()]
) -> Snapshot:
    """Return the snapshot relative to a centre, which moves by `motion` (() for a fixed one)."""
    seen = relative(snapshot, centre)
    if not motion:
        return seen
    position = add_scaled(seen.position, -snapshot.time, motion.velocity)
    velocity = subtract(seen.velocity, motion.velocity)
    for jump in motion.velocity_jumps:
        since = ops.maximum(snapshot.time - jump.time, 0.0)
        position = add_scaled(position, -since, jump.change)
        velocity = add_scaled(velocity, ops.select(since > 0.0, -1.0, 0.0), jump.change)
    return seen._replace(position=position, velocity=velocity)


def relative(snapshot: Snapshot, centre: Vector) -> Snapshot:
    """Return the snapshot with its position relative to a fixed centre."""
    return snapshot._replace(position=subtract(snapshot.position, centre))


def interpolated(a: Snapshot, b: Snapshot, fraction: Scalar) -> Snapshot:
    """Return the linear interpolation at a fraction of the way between two snapshots."""
    w, x, y, z = (p + fraction * (q - p) for p, q in zip(a.q_world_body, b.q_world_body, strict=True))
    return Snapshot(
        a.time + fraction * (b.time - a.time),
        add_scaled(a.position, fraction, subtract(b.position, a.position)),
        add_scaled(a.velocity, fraction, subtract(b.velocity, a.velocity)),
        (w, x, y, z),
    )
