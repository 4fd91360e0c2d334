"""Measures at one instant of a motion, in which limits are linear: wrench, its rate and magnitudes.

Everything is written in scalar components. A motion is given in axes near the body's. The smallest rotation
takes these axes to the body's. This is exact for the body's own axes, and exact to first order for axes near
them.
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels import flatness, unequal_drag
from aerobat.kernels.ops import Matrix, Ops, Scalar, Vector
from aerobat.kernels.unequal_drag import BodyMotion
from aerobat.kernels.vectors import add, add_scaled, dot, scale

# [rad²/s²] added to the square of a rate, so that the rate of a body at rest is differentiable
RATE_SMOOTHING = 1e-12


class InertiaAndDrag(NamedTuple):
    """Mass, inertia and drag of a vehicle."""

    mass: Scalar  # [kg]
    inertia: Matrix  # [kg·m²]
    lateral_drag: Scalar  # [1/s] per mass, across the thrust axis
    axial_drag: Scalar  # [1/s] per mass, along the axis minus across it
    unequal: Vector | None  # [1/s] per mass along body x, y and z, where x and y differ


def measures(ops: Ops, airframe: InertiaAndDrag, motion: BodyMotion, up: Vector) -> tuple[Scalar, ...]:
    """Return the measures in the order of `limits.quantity`: wrench (4), its rate (4), |f|, |ω|, upright.

    Args:
        ops: The arithmetic of the engine.
        airframe: Mass, inertia and drag.
        motion: Gravity, airspeed and the derivatives of position from acceleration on.
        up: The vertical, in the axes of the motion.
    """
    if airframe.unequal is not None:
        demand = unequal_drag.demand(ops.sqrt, airframe.mass, airframe.inertia, airframe.unequal, motion)
        rate = ops.sqrt(dot(demand.omega, demand.omega) + RATE_SMOOTHING)
        return *demand.wrench, *demand.rate, demand.specific_thrust, rate, dot(demand.b3, up)
    drag, v, a = airframe.lateral_drag, motion.airspeed, motion.acceleration
    f = add(add_scaled(a, drag, v), motion.weight)
    rates = (
        add_scaled(rate, drag, below)
        for rate, below in ((motion.jerk, a), (motion.snap, motion.jerk), (motion.crackle, motion.snap))
    )
    norm = ops.sqrt(dot(f, f))
    f1, f2, f3 = rates
    b3, r1, r2, r3 = (scale(1.0 / norm, vector) for vector in (f, f1, f2, f3))
    turning = flatness.turning(b3, r1, r2, r3)
    omega, omega_dot, angular_jerk = ((*flatness.tilted(b3, vector), 0.0) for vector in turning)
    thrust = flatness.collective(airframe.mass, airframe.axial_drag, norm, b3, v)
    thrust_rate = flatness.collective_rate(airframe.mass, airframe.axial_drag, b3, (norm, f1), (v, a))
    moment, moment_rate = flatness.moment_and_rate(airframe.inertia, omega, omega_dot, angular_jerk)
    rate = ops.sqrt(dot(turning[0], turning[0]) + RATE_SMOOTHING)
    return thrust, *moment, thrust_rate, *moment_rate, norm, rate, dot(b3, up)
