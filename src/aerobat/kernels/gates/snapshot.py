"""A vehicle at an instant, and between two."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Quaternion, Scalar, Vector
from aerobat.kernels.vectors import add_scaled, subtract


class Snapshot(NamedTuple):
    """A vehicle at an instant."""

    time: Scalar  # [s]
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    q_world_body: Quaternion  # between two ticks not quite of unit length


def relative(snapshot: Snapshot, centre: Vector) -> Snapshot:
    """The snapshot with its position from a centre."""
    return snapshot._replace(position=subtract(snapshot.position, centre))


def between(a: Snapshot, b: Snapshot, fraction: Scalar) -> Snapshot:
    """The snapshot at a fraction of the way from one to another, straight."""
    w, x, y, z = (p + fraction * (q - p) for p, q in zip(a.q_world_body, b.q_world_body, strict=True))
    return Snapshot(
        a.time + fraction * (b.time - a.time),
        add_scaled(a.position, fraction, subtract(b.position, a.position)),
        add_scaled(a.velocity, fraction, subtract(b.velocity, a.velocity)),
        (w, x, y, z),
    )
