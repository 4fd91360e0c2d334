"""Nonlinear dynamics of a rigid body (paper, eqs. (3) and (4)), and one RK4 step."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Axes, Matrix, Ops, Quaternion, Scalar, Vector
from aerobat.kernels.quaternions import axes, normalize, quaternion_rate, to_body, to_world
from aerobat.kernels.vectors import add_scaled, cross, scale, subtract, transform


class Pose(NamedTuple):
    """Position and attitude at one instant."""

    position: Vector  # [m] world
    q_world_body: Quaternion


class Body(NamedTuple):
    """The state of a rigid body, or its time derivative."""

    position: Vector  # [m] world
    velocity: Vector  # [m/s] world
    q_world_body: Quaternion
    omega_body: Vector  # [rad/s] body


class MassProperties(NamedTuple):
    """Mass, inertia and drag of a rigid body."""

    mass: Scalar  # [kg]
    inertia: Matrix  # [kg·m²] body
    inverse_inertia: Matrix
    drag_body: Vector  # [kg/s]: force_body = −drag_body ∘ airspeed_body


class EnvironmentParameters(NamedTuple):
    """Gravity and wind; see `aerobat.environment.Environment`."""

    gravity: Scalar  # [m/s²] along −z
    wind: Vector  # [m/s] velocity of the air, world


class RotorWrench(NamedTuple):
    """Force and moment of the rotors on the body."""

    thrust: Scalar  # [N] along b3
    moment_body: Vector  # [N·m]


def derivative(
    mass_properties: MassProperties, environment: EnvironmentParameters, body: Body, load: RotorWrench
) -> Body:
    """Return the time derivative of a body's state.

    Eq. (3) in the Hamilton convention, body to world: v' = q ⊗ F ⊗ q* / m − g·e3, where F includes the drag
    at the velocity relative to the wind. Eq. (4): ω' = J⁻¹ (M − ω × Jω). Attitude: q' = ½ q ⊗ (0, ω).
    """
    body_axes = axes(body.q_world_body)
    force_body = _force_body(mass_properties, environment, body_axes, body.velocity, load.thrust)
    ax, ay, az = to_world(body_axes, force_body)
    lightness = 1.0 / mass_properties.mass
    gyroscopic = cross(body.omega_body, transform(mass_properties.inertia, body.omega_body))
    return Body(
        body.velocity,
        (ax * lightness, ay * lightness, az * lightness - environment.gravity),
        quaternion_rate(body.q_world_body, body.omega_body),
        transform(mass_properties.inverse_inertia, subtract(load.moment_body, gyroscopic)),
    )


def specific_force(
    mass_properties: MassProperties, environment: EnvironmentParameters, body: Body, thrust: Scalar
) -> Vector:
    """Return all forces except gravity over mass [m/s²], body axes: the reading of an ideal accelerometer."""
    body_axes = axes(body.q_world_body)
    force_body = _force_body(mass_properties, environment, body_axes, body.velocity, thrust)
    return scale(1.0 / mass_properties.mass, force_body)


def _force_body(
    mass_properties: MassProperties,
    environment: EnvironmentParameters,
    body_axes: Axes,
    velocity: Vector,
    thrust: Scalar,
) -> Vector:
    """Return thrust and drag [N], body axes."""
    u, v, w = to_body(body_axes, subtract(velocity, environment.wind))
    dx, dy, dz = mass_properties.drag_body
    return -dx * u, -dy * v, thrust - dz * w


def step(
    ops: Ops,
    mass_properties: MassProperties,
    environment: EnvironmentParameters,
    body: Body,
    loads: tuple[RotorWrench, RotorWrench, RotorWrench],
    dt: Scalar,
) -> Body:
    """Return the state after a classical RK4 step of `dt` [s] with the loads at its start, middle and end.

    The step is of order four if the loads are exact there. The quaternion is normalised once, at the end.
    """
    start, middle, end = loads
    k1 = derivative(mass_properties, environment, body, start)
    k2 = derivative(mass_properties, environment, _along(body, 0.5 * dt, k1), middle)
    k3 = derivative(mass_properties, environment, _along(body, 0.5 * dt, k2), middle)
    k4 = derivative(mass_properties, environment, _along(body, dt, k3), end)
    sixth = dt / 6.0
    new = Body(
        *(
            tuple(x + sixth * (a + 2.0 * (b + c) + d) for x, a, b, c, d in zip(*components, strict=True))
            for components in zip(body, k1, k2, k3, k4, strict=True)
        )
    )
    return new._replace(q_world_body=normalize(ops, new.q_world_body))


def _along(body: Body, dt: Scalar, rate: Body) -> Body:
    """Return the state `dt` [s] along a rate. Its position is not updated, because no rate depends on it."""
    w, x, y, z = body.q_world_body
    dw, dx, dy, dz = rate.q_world_body
    return Body(
        body.position,
        add_scaled(body.velocity, dt, rate.velocity),
        (w + dt * dw, x + dt * dx, y + dt * dy, z + dt * dz),
        add_scaled(body.omega_body, dt, rate.omega_body),
    )
