"""Differential flatness in scalar components: from a specific thrust to body rates, moment and thrust.

Let v be the velocity relative to the air, f = a + g e3 + (d/m) v with its derivatives, n = |f| and b3 = f/n.
Then

    ω = b3 × f'/n,   ω' = b3 × f''/n − 2 (b3·f'/n) ω     no spin about b3, in any axes of f;
    M = J ω' + ω × J ω                                   body axes;
    T = m (n + (d_z − d)/m b3·v).

ω' is b3 × b3'', so the component of b3'' along b3 and n'' cancel. Only `tilted`, which changes to axes
relative to the upright ones, divides by 1 + b3_z.
"""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.kernels.ops import Matrix, Scalar, Vector
from aerobat.kernels.vectors import add, add_scaled, cross, dot, scale, transform


def specific_thrust(
    weight: Scalar, drag: Scalar, airspeed: Scalar, acceleration: Scalar, jerk: Scalar, snap: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """Return f, f' and f'', from components or from whole vectors of an engine that adds and scales them."""
    return acceleration + drag * airspeed + weight, jerk + drag * acceleration, snap + drag * jerk


def body_rates(b3: Vector, jerk: Vector, snap: Vector) -> tuple[Vector, Vector]:
    """Return ω [rad/s] and ω' [rad/s²] of a body that keeps b3 along f; `jerk` is f'/n, `snap` f''/n.

    The arguments f, f'/n² and f''/n² give the same result.
    """
    omega = cross(b3, jerk)
    return omega, add_scaled(cross(b3, snap), -2.0 * dot(b3, jerk), omega)


def spun(omega: Vector, omega_dot: Vector, yaw: Sequence[Scalar]) -> tuple[Vector, Vector]:
    """Return ω and ω' of a body that also yaws about b3, from its rates across b3, in body axes.

    `yaw` is the yaw rate [rad/s] and its derivative [rad/s²].
    """
    (x, y, _), (dx, dy, _), (rate, acceleration) = omega, omega_dot, yaw
    return (x, y, rate), (dx + rate * y, dy - rate * x, acceleration)


def tilted(b3: Vector, across: Vector) -> tuple[Scalar, Scalar]:
    """Return components x, y of a vector `across` b3, in axes tilted from e3 to b3 without twist."""
    share = across[2] / (1.0 + b3[2])
    return across[0] - b3[0] * share, across[1] - b3[1] * share


def moment(inertia: Matrix, omega: Vector, omega_dot: Vector) -> Vector:
    """Return the moment J ω' + ω × Jω [N·m] of a body's rates; body axes."""
    return add(transform(inertia, omega_dot), cross(omega, transform(inertia, omega)))


def collective(mass: Scalar, axial_drag: Scalar, norm: Scalar, b3: Vector, airspeed: Vector) -> Scalar:
    """Return the collective thrust [N] for a specific thrust of norm `norm`, plus the axial drag."""
    return mass * (norm + axial_drag * dot(b3, airspeed))


def turning(b3: Vector, jerk: Vector, snap: Vector, crackle: Vector) -> tuple[Vector, Vector, Vector]:
    """Return ω and ω' of `body_rates`, and ω'' [rad/s³] along the body's axes; `crackle` is f'''/n.

    ω'' is the derivative of the components of ω' in axes that turn with ω. The rate of a moment then follows
    from its components.
    """
    omega, omega_dot = body_rates(b3, jerk, snap)
    world = add(cross(jerk, snap), cross(b3, crackle))
    world = add_scaled(world, -2.0 * (dot(jerk, jerk) + dot(b3, snap)), omega)
    world = add_scaled(world, -4.0 * dot(b3, jerk), omega_dot)
    return omega, omega_dot, add_scaled(world, -1.0, cross(omega, omega_dot))


def moment_and_rate(
    inertia: Matrix, omega: Vector, omega_dot: Vector, angular_jerk: Vector
) -> tuple[Vector, Vector]:
    """Return `moment` and its derivative J ω'' + ω' × J ω + ω × J ω' [N·m/s]; body axes."""
    momentum, momentum_rate = transform(inertia, omega), transform(inertia, omega_dot)
    gyroscopic = add(cross(omega_dot, momentum), cross(omega, momentum_rate))
    rate = add(transform(inertia, angular_jerk), gyroscopic)
    return add(momentum_rate, cross(omega, momentum)), rate


def collective_rate(
    mass: Scalar, axial_drag: Scalar, b3: Vector, thrust: tuple[Scalar, Vector], air: tuple[Vector, Vector]
) -> Scalar:
    """Return the derivative of `collective` [N/s], from |f| and f', and airspeed and acceleration."""
    norm, thrust_jerk = thrust
    airspeed, acceleration = air
    along = dot(b3, thrust_jerk)
    turning = scale(1.0 / norm, add_scaled(thrust_jerk, -along, b3))
    return mass * (along + axial_drag * (dot(turning, airspeed) + dot(b3, acceleration)))
