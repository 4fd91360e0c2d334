"""Motion capture by two camera systems: poses with noise, a misfit between systems, outliers and gaps."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import multiply, normalize, rotate
from aerobat.kernels.rigid_body import Body, Pose
from aerobat.kernels.vectors import add, add_scaled, dot, scale, subtract


class PoseSample(NamedTuple):
    """A measured pose, or a gap."""

    pose: Pose
    is_valid: Scalar  # 1, or 0 for a gap


class HandOffParameters(NamedTuple):
    """The plane at which the second system takes over, and the misfit there."""

    point: Vector  # [m] of the plane
    normal: Vector  # unit vector towards the second system
    offset: Pose  # offset of the second system's axes, turned about the point
    warp: Vector  # [m] displacement at the plane, in both systems
    inverse_depth: Scalar  # [1/m] inverse of the distance over which the warp fades


class MocapParameters(NamedTuple):
    """Errors of a motion capture."""

    position_noise: Scalar  # [m]
    attitude_noise: Scalar  # [rad]
    dropout: Scalar  # [-]
    outlier: Scalar  # [-]
    outlier_size: Scalar  # [m]
    outage: tuple[Scalar, Scalar]  # [s] start and end
    hand_off: HandOffParameters
    first_error: tuple[Vector, Vector]  # [m], [rad] errors of the pose before the flight


class MocapInput(NamedTuple):
    """Time and random numbers of a sample."""

    time: Scalar  # [s] since the flight's start
    position: Vector  # standard normals
    attitude: Vector  # standard normals
    outlier: Vector  # standard normals
    chance: Scalar  # uniform in [0, 1)


def first_pose(ops: Ops, parameters: MocapParameters, body: Body) -> Pose:
    """Return the pose known before the flight, with its own error."""
    seen = as_seen(ops, parameters.hand_off, Pose(body.position, body.q_world_body))
    return _with_errors(ops, seen, *parameters.first_error)


def sample(ops: Ops, parameters: MocapParameters, body: Body, inputs: MocapInput) -> PoseSample:
    """Return the measured pose of a body."""
    seen = as_seen(ops, parameters.hand_off, Pose(body.position, body.q_world_body))
    is_outlier = 1.0 - parameters.outlier <= inputs.chance  # gaps are at the other end of the range
    mistaken = ops.select(is_outlier, parameters.outlier_size, 0.0)
    error = add_scaled(scale(parameters.position_noise, inputs.position), mistaken, inputs.outlier)
    pose = _with_errors(ops, seen, error, scale(parameters.attitude_noise, inputs.attitude))
    begin, end = parameters.outage
    is_out = (begin <= inputs.time) & (inputs.time < end)
    is_taken = ops.select(parameters.dropout <= inputs.chance, 1.0, 0.0)
    return PoseSample(pose, ops.select(is_out, 0.0, is_taken))


def as_seen(ops: Ops, hand_off: HandOffParameters, pose: Pose) -> Pose:
    """Return the noise-free measured pose: of the second system beyond the plane, warped near it."""
    from_point = subtract(pose.position, hand_off.point)
    distance = dot(hand_off.normal, from_point)
    moved = add(
        add(hand_off.point, rotate(hand_off.offset.q_world_body, from_point)), hand_off.offset.position
    )
    turned = multiply(hand_off.offset.q_world_body, pose.q_world_body)
    seen = select_tree(ops, distance > 0.0, Pose(moved, turned), pose)
    depths = distance * hand_off.inverse_depth
    position = add_scaled(seen.position, ops.exp(-0.5 * depths * depths), hand_off.warp)
    return seen._replace(position=position)


def _with_errors(ops: Ops, pose: Pose, position: Vector, attitude: Vector) -> Pose:
    """Return the pose with small errors [m] world and [rad] about body axes."""
    small_rotation = normalize(ops, (1.0, *scale(0.5, attitude)))
    return Pose(add(pose.position, position), multiply(pose.q_world_body, small_rotation))
