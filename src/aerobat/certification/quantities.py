"""What is certified: rotor thrusts, collective thrust, tilt, body rate and moment, as analytic functions.

Magnitudes are squared and the tilt is taken by its cosine, so that no kink spoils interpolation; the
`ExtremumQuery` turns them into what people read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Side
from aerobat.certification.enclosure.queries import ExtremumQuery, angle, both_sides, root
from aerobat.certification.envelope import Envelope
from aerobat.flatness.reference import wrench_for
from aerobat.vehicle import Vehicle, mixer, rotor_thrusts


@dataclass(frozen=True)
class MagnitudeBounds:
    """Bounds of, or errors in, what the quantities are made of; all (...)."""

    thrust: Array  # [N]
    upright: Array  # of the cosine of the tilt [-]
    omega: Array  # [rad/s]
    omega_dot: Array  # [rad/s²]


def values(vehicle: Vehicle, curve: Array, omega: Array, omega_dot: Array) -> Array:
    """Rotor thrusts, collective thrust, cos tilt, |ω|², |M|², (..., n + 4).

    `curve` holds v, f, f', f'' (..., 4, 3), world; ω and ω' (..., 3) are in body axes.
    """
    airspeed, thrust = curve[..., 0, :], curve[..., 1:, :]
    wrench = wrench_for(thrust, airspeed, omega, omega_dot, vehicle)
    upright = thrust[..., 0, 2] / np.linalg.norm(thrust[..., 0, :], axis=-1)
    others = [wrench.thrust, upright, _square(omega), _square(wrench.moment_body)]
    return np.concatenate([rotor_thrusts(vehicle, wrench), np.stack(others, axis=-1)], axis=-1)


def bounds(vehicle: Vehicle, sizes: MagnitudeBounds) -> Array:
    """The largest absolute values that `values` can have for arguments of these sizes, (..., n + 4)."""
    moment = _inertia(vehicle) * (sizes.omega_dot + sizes.omega**2)
    return _stacked(vehicle, sizes.thrust, moment, sizes.upright, sizes.omega**2, moment**2)


def errors(vehicle: Vehicle, sizes: MagnitudeBounds, of: MagnitudeBounds) -> Array:
    """What small errors `of` the arguments do to `values`, (..., n + 4)."""
    size = _inertia(vehicle) * (sizes.omega_dot + sizes.omega**2)
    moment = _inertia(vehicle) * (of.omega_dot + 2 * sizes.omega * of.omega)
    squares = 2 * sizes.omega * of.omega, 2 * size * moment
    return _stacked(vehicle, of.thrust, moment, of.upright, *squares)


def scales(vehicle: Vehicle) -> Array:
    """What counts as large, (n + 4,): the rotors' ranges and the moments that use them up."""
    ranges = vehicle.max_thrusts - vehicle.min_thrusts
    moment = float((ranges / np.linalg.norm(mixer(vehicle)[:, 1:], axis=1)).max())
    return np.concatenate([ranges, [ranges.sum(), 0.01, 1.0, moment**2]])


def questions(vehicle: Vehicle, envelope: Envelope) -> list[ExtremumQuery]:
    """What a certificate asks of the columns of `values`."""
    count, low, high = len(vehicle.rotors), vehicle.min_thrusts, vehicle.max_thrusts
    asked = [q for i in range(count) for q in both_sides(f"rotor {i}", "N", i, low[i], high[i])]
    return [
        *asked,
        *both_sides("thrust", "N", count, low.sum(), high.sum()),
        ExtremumQuery("tilt", "rad", Side.MAX, envelope.tilt, count + 1, -1, angle),
        ExtremumQuery("body rate", "rad/s", Side.MAX, envelope.body_rate, count + 2, 1, root),
        ExtremumQuery("moment", "N·m", Side.MAX, envelope.moment, count + 3, 1, root),
    ]


def _stacked(vehicle: Vehicle, thrust: Array, moment: Array, *others: Array) -> Array:
    inverse = mixer(vehicle)
    per_thrust, per_moment = np.abs(inverse[:, 0]), np.linalg.norm(inverse[:, 1:], axis=1)
    rotors = thrust[..., None] * per_thrust + moment[..., None] * per_moment
    return np.concatenate([rotors, np.stack([thrust, *others], axis=-1)], axis=-1)


def _inertia(vehicle: Vehicle) -> float:
    """The largest principal moment of inertia."""
    return float(np.linalg.norm(vehicle.inertia, 2))


def _square(vectors: Array) -> Array:
    return np.asarray(np.sum(vectors**2, axis=-1))
