"""The nonlinear dynamics of a rigid body (paper, eqs. (3) and (4)), and one step of RK4 along them."""

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
    """Gravity and wind, which act on every body; see `aerobat.environment.Environment`."""

    gravity: Scalar  # [m/s²] along −z
    wind: Vector  # [m/s] velocity of the air, world


class RotorWrench(NamedTuple):
    """Force and moment of the rotors on the body."""

    thrust: Scalar  # [N] along b3
    moment_body: Vector  # [N·m]


def derivative(
    mass_properties: MassProperties, environment: EnvironmentParameters, body: Body, load: RotorWrench
) -> Body:
    """The time derivative of a body's state.

    Eq. (3) in the Hamilton convention, body to world: v' = q ⊗ F ⊗ q* / m − g·e3, with the drag in F, by the
    velocity relative to the wind.
    Eq. (4): ω' = J⁻¹ (M − ω × Jω). Attitude: q' = ½ q ⊗ (0, ω).
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
    """All forces but gravity over mass [m/s²], body axes: what an accelerometer feels at an instant."""
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
    """Thrust and drag [N], body axes."""
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
    """The state after `dt` [s] of classical RK4, under the loads at its start, middle and end.

    Of order four if the loads are exact there; the quaternion is normalised once, at the end.
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
    """The state `dt` [s] along a rate; its position, on which no rate depends, is left behind."""
    w, x, y, z = body.q_world_body
    dw, dx, dy, dz = rate.q_world_body
    return Body(
        body.position,
        add_scaled(body.velocity, dt, rate.velocity),
        (w + dt * dw, x + dt * dx, y + dt * dy, z + dt * dz),
        add_scaled(body.omega_body, dt, rate.omega_body),
    )
