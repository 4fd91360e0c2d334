"""Fusion of measured poses, possibly late, with outlier rejection and detection of jumps."""

from __future__ import annotations

from collections.abc import Callable

from aerobat.kernels.ekf.covariance import (
    Correction,
    ErrorState,
    Rows,
    add_diagonal,
    correct,
    pack,
    transform_part,
    uncorrelated,
    unpack,
)
from aerobat.kernels.ekf.prediction import anchored
from aerobat.kernels.ekf.states import EkfParameters, EkfState, NominalState
from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, conjugate, exp_of_small, multiply, normalize, to_body, to_world
from aerobat.kernels.rigid_body import Pose
from aerobat.kernels.vectors import ZERO, add, add_scaled, dot, scale, subtract

_NONE = ErrorState(ZERO, ZERO, ZERO, ZERO, ZERO)


def fuse(
    ops: Ops,
    parameters: EkfParameters,
    state: EkfState,
    measured: Pose,
    past: Pose,
    age: Scalar,
    arrived: Scalar = True,
) -> EkfState:
    """Return the state after a measured pose, or the unchanged state where none has arrived.

    The error at the exposure is the present error mapped back: δp − T δv and, in present body axes, δθ + T
    δb_g. The noise of the IMU during the age T is neglected. A pose whose normalized innovation squared
    exceeds `max_nis` is rejected. The `max_rejections`-th rejection in a row counts as a jump: the filter
    restarts at that pose. The covariance must be predicted to the present (`predict_covariance`).

    Args:
        ops: the arithmetic of the engine.
        parameters: parameters of the filter.
        state: the present state, when the pose arrives.
        measured: the pose measured at its exposure.
        past: the filter's own pose at the exposure: `pose_of` the state then, `carried_back` by later
            fusions.
        age: T [s] from the exposure to now.
        arrived: False where no pose has arrived.
    """
    innovation = pose_innovation(ops, state.nominal, measured, past)
    correction = _correction(parameters, unpack(state.covariance), innovation, age)
    accepted = state._replace(
        nominal=_injected(ops, state.nominal, correction.error), covariance=pack(correction.rows)
    )
    restarted = _restarted(ops, parameters, state, innovation, measured, past, age)
    consistent = correction.nis <= parameters.max_nis
    count = ops.select(consistent, 0.0, state.rejections + 1.0)
    fused = ops.select(consistent, True, count >= parameters.max_rejections)
    chosen = select_tree(ops, consistent, accepted, restarted)
    after = anchored(
        chosen._replace(
            since_pose=age,
            rejections=0.0,
            jumps=ops.select(consistent, state.jumps, state.jumps + 1.0),
            nis=correction.nis,
            accepted=1.0,
        )
    )
    rejected = anchored(state._replace(rejections=count, nis=correction.nis, accepted=0.0))
    return select_tree(ops, arrived, select_tree(ops, fused, after, rejected), anchored(state))


def carried_back(before: EkfState, after: EkfState, past: Pose, age: Scalar) -> Pose:
    """Return an earlier pose of the filter, corrected by a later fusion.

    This is needed for an exposure whose measurement arrives after the fusion of another measurement.

    Args:
        before: the state before the fusion.
        after: the state after it.
        past: the pose at the exposure, as estimated at that time.
        age: time from the exposure to the fusion [s].
    """
    old, new = before.nominal, after.nominal
    shift = add_scaled(subtract(new.position, old.position), -age, subtract(new.velocity, old.velocity))
    rotation = multiply(new.q_world_body, conjugate(old.q_world_body))
    return Pose(add(past.position, shift), multiply(rotation, past.q_world_body))


def pose_innovation(ops: Ops, nominal: NominalState, measured: Pose, past: Pose) -> tuple[Vector, Vector]:
    """Return measured minus predicted position [m], world, and rotation [rad], in present body axes."""
    w, x, y, z = multiply(conjugate(past.q_world_body), measured.q_world_body)
    rotation = scale(ops.select(w < 0.0, -2.0, 2.0), (x, y, z))
    world = to_world(axes(past.q_world_body), rotation)
    return subtract(measured.position, past.position), to_body(axes(nominal.q_world_body), world)


def _correction(
    parameters: EkfParameters, rows: Rows, innovation: tuple[Vector, Vector], age: Scalar
) -> Correction:
    """Return the correction by six scalar updates in sequence, as their noises are independent."""
    correction = Correction(_NONE, rows, 0.0)
    for axis in range(3):
        measured = position_then(axis, age)
        correction = correct(correction, measured, innovation[0][axis], parameters.position_variance)
    for axis in range(3):
        measured = rotation_then(axis, age)
        correction = correct(correction, measured, innovation[1][axis], parameters.attitude_variance)
    return correction


def position_then(axis: int, age: Scalar) -> Callable[[ErrorState], Scalar]:
    """Return the position error along an axis `age` [s] ago, as a function of the present error."""
    return lambda error: error.position[axis] - age * error.velocity[axis]


def rotation_then(axis: int, age: Scalar) -> Callable[[ErrorState], Scalar]:
    """Return the attitude error about a present body axis `age` [s] ago, from the present error."""
    return lambda error: error.rotation[axis] + age * error.gyro_bias[axis]


def _injected(ops: Ops, nominal: NominalState, error: ErrorState) -> NominalState:
    """Return the nominal state with the mean of the error injected.

    The correction also turns the axes of the remaining attitude error by half of it, which is neglected:
    usually a thousandth, and 2 % when the hand-over between camera systems is corrected.
    """
    q = multiply(nominal.q_world_body, exp_of_small(error.rotation))
    return NominalState(
        add(nominal.position, error.position),
        add(nominal.velocity, error.velocity),
        normalize(ops, q),
        add(nominal.gyro_bias, error.gyro_bias),
        add(nominal.accelerometer_bias, error.accelerometer_bias),
    )


def _restarted(
    ops: Ops,
    parameters: EkfParameters,
    state: EkfState,
    innovation: tuple[Vector, Vector],
    measured: Pose,
    past: Pose,
    age: Scalar,
) -> EkfState:
    """Return the state with its pose restarted at the measured one, propagated from its exposure to now.

    If the frame of the measurements turned by δ, velocity and gravity are turned too. The variances of the
    velocity and, as gravity is known, of the accelerometer bias are increased accordingly.
    """
    nominal, angle_sq = state.nominal, dot(innovation[1], innovation[1])
    rotation = multiply(measured.q_world_body, conjugate(past.q_world_body))
    new = nominal._replace(
        position=add(nominal.position, innovation[0]),
        q_world_body=normalize(ops, multiply(rotation, nominal.q_world_body)),
    )
    rows = uncorrelated(unpack(state.covariance), "position", parameters.position_variance)
    rows = uncorrelated(rows, "rotation", parameters.attitude_variance)
    variances = {
        "velocity": angle_sq * dot(nominal.velocity, nominal.velocity),
        "accelerometer_bias": angle_sq * parameters.gravity * parameters.gravity,
    }
    rows = add_diagonal(rows, variances)
    rows = transform_part(rows, "position", lambda e: add_scaled(e.position, age, e.velocity))
    rows = transform_part(rows, "rotation", lambda e: add_scaled(e.rotation, -age, e.gyro_bias))
    return state._replace(nominal=new, covariance=pack(rows))
