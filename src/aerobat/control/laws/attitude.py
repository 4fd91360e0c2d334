"""Shared steps of the laws: the attitude error, and the moment that corrects it."""

from __future__ import annotations

from aerobat.control.law import Seen
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import ReferencePoint, reference_moment
from aerobat.kernels.ops import Axes, Ops, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.vectors import add, add_scaled, cross, dot, norm, scale, subtract, transform

_MIN_NORM = 1e-3  # [m/s²], or [-] of unit vectors: shorter vectors have no usable direction


def axes_along(ops: Ops, thrust: Vector, reference: ReferencePoint) -> Axes:
    """Return axes with the third along a specific thrust [m/s²] and the first near the reference's.

    The reference's axes are returned where the thrust vanishes or lies along its first axis.
    """
    first, second, third = axes(reference.q_world_body)
    b3 = scale(1.0 / ops.maximum(norm(ops, thrust), _MIN_NORM), thrust)
    lateral = cross(b3, first)
    size = norm(ops, lateral)
    b2 = scale(1.0 / ops.maximum(size, _MIN_NORM), lateral)
    b1 = cross(b2, b3)
    determined = (norm(ops, thrust) > _MIN_NORM) & (size > _MIN_NORM)
    return select_tree(ops, determined, (b1, b2, b3), (first, second, third))


def rotation_error(body_axes: Axes, desired: Axes) -> Vector:
    """Return e_R = ½ (R_dᵀ R − Rᵀ R_d)^∨, sin θ about the axis from the desired attitude; body axes."""
    b1, b2, b3 = (cross(wanted, own) for wanted, own in zip(desired, body_axes, strict=True))
    return to_body(body_axes, scale(0.5, add(add(b1, b2), b3)))


def attitude_feedback(
    ops: Ops, model: ControllerModel, seen: Seen, desired: Axes, attitude_gain: float, rate_gain: float
) -> Vector:
    """Return −k_R e_R − k_Ω e_Ω [rad/s²] in body axes, with gains that the vehicle's rotors allow.

    Args:
        ops: The operations of an engine.
        model: The model of the vehicle; its own gains limit the two gains below.
        seen: The body and the reference.
        desired: The desired body axes.
        attitude_gain: k_R divided by the inertia [1/s²].
        rate_gain: k_Ω divided by the inertia [1/s].
    """
    body_axes = axes(seen.body.q_world_body)
    e_r = rotation_error(body_axes, desired)
    e_omega = subtract(seen.body.omega_body, to_body(body_axes, seen.reference.omega))
    k_r = ops.minimum(attitude_gain, 0.5 * model.gains.stiffness)
    k_omega = ops.minimum(rate_gain, model.gains.damping)
    return scale(-1.0, add_scaled(scale(k_r, e_r), k_omega, e_omega))


def moment_for(
    model: ControllerModel, body_axes: Axes, reference: ReferencePoint, acceleration: Vector
) -> Vector:
    """Return the moment [N·m, body] of the reference plus that of an angular acceleration [rad/s²]."""
    inertia = model.airframe.mass_properties.inertia
    return add(reference_moment(inertia, body_axes, reference), transform(inertia, acceleration))


def collective(model: ControllerModel, body_axes: Axes, thrust: Vector) -> Scalar:
    """Return the collective thrust [N] for the component of a specific thrust along the body's third axis."""
    return model.airframe.mass_properties.mass * dot(thrust, body_axes[2])
