"""The filter's kernel against the textbook in dense matrices, and against its own nonlinear equations."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.floats import FloatOps
from aerobat.engines.pytree import tree_leaves, tree_map
from aerobat.engines.tracing import Trace
from aerobat.estimation.replay import filter_loop
from aerobat.kernels import ekf
from aerobat.kernels.ekf import EkfParameters, EkfState, ImuSample, NominalState, Pose
from aerobat.kernels.ekf.covariance import ErrorState, error_state, pack, unpack
from aerobat.kernels.ekf.fusion import pose_innovation, position_then, rotation_then
from aerobat.kernels.ekf.prediction import transition
from aerobat.kernels.ekf.states import Anchor
from aerobat.kernels.quaternions import exp_of_small
from ekf_flights import STRIDE, measured_hover
from suites import examples

PARAMETERS = EkfParameters(
    gravity=9.81,
    gyro_noise=1e-6,
    accelerometer_noise=4e-4,
    gyro_walk=1e-8,
    accelerometer_walk=1e-6,
    velocity_variance=1e-2,
    gyro_bias_variance=4e-4,
    accelerometer_bias_variance=1e-2,
    position_variance=1e-6,
    attitude_variance=2.7e-5,
    max_nis=27.9,
    max_rejections=5.0,
)
SIGMAS = np.repeat([0.01, 0.1, 0.02, 0.01, 0.1], 3)
GRAVITY = np.array([0.0, 0.0, 9.81])  # [m/s²] upwards: what hovering takes
SEEDS = st.integers(0, 2**32 - 1)


def triple(values: Array) -> Any:
    return tuple(np.asarray(values).tolist())


def random_rows(rng: np.random.Generator) -> Array:
    """A covariance of the usual sizes, all its parts correlated."""
    root = SIGMAS[:, None] * rng.normal(size=(15, 15)) / 15**0.5
    return root @ root.T + np.diag(1e-4 * SIGMAS**2)


def random_state(rng: np.random.Generator, rows: Array | None = None) -> EkfState:
    nominal = NominalState(
        triple(rng.normal(size=3)),
        triple(5.0 * rng.normal(size=3)),
        triple(so3.normalize(rng.normal(size=4))),
        triple(0.02 * rng.normal(size=3)),
        triple(0.1 * rng.normal(size=3)),
    )
    state = ekf.init(PARAMETERS, Pose(nominal.position, nominal.q_world_body))
    rows = random_rows(rng) if rows is None else rows
    return state._replace(
        nominal=nominal,
        covariance=pack(rows.tolist()),
        anchor=Anchor(nominal.velocity, nominal.q_world_body, 0.0),
    )


def random_sample(rng: np.random.Generator) -> ImuSample:
    return ImuSample(triple(rng.normal(0, 10, 3)), triple(rng.normal(0, 15, 3)))


def displaced(nominal: NominalState, error: Array) -> NominalState:
    """The true state that is so far from the nominal one."""
    part = error_state(error.tolist())
    q = so3.multiply(nominal.q_world_body, so3.exp(part.rotation))
    others = [
        triple(np.add(value, change))
        for value, change in zip(nominal, part, strict=True)
        if value is not nominal.q_world_body
    ]
    return NominalState(others[0], others[1], triple(q), others[2], others[3])


def error_of(true: NominalState, nominal: NominalState) -> Array:
    """The inverse of `displaced`."""
    rotation = so3.box_minus(true.q_world_body, nominal.q_world_body)
    parts = [np.subtract(a, b) for a, b in zip(true, nominal, strict=True) if len(a) == 3]
    return np.concatenate([parts[0], parts[1], rotation, parts[2], parts[3]])


def skew(a: Array) -> Array:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def dense_transition(before: EkfState, after: EkfState, elapsed: float) -> Array:
    """Solà's, section 5.4, with the mean specific force that the nominal states moved by."""
    R = so3.axes(before.nominal.q_world_body)
    R_after = so3.axes(after.nominal.q_world_body)
    gained = np.subtract(after.nominal.velocity, before.nominal.velocity) + elapsed * GRAVITY
    F = np.eye(15)
    F[0:3, 3:6] = elapsed * np.eye(3)
    F[3:6, 6:9] = -R @ skew(R.T @ gained)
    F[3:6, 12:15] = -R * elapsed
    F[6:9, 6:9] = R_after.T @ R
    F[6:9, 9:12] = -elapsed * np.eye(3)
    return F


def linear_transition(state: EkfState) -> Array:
    """The kernel's own, applied to every unit error."""
    columns = []
    for unit in np.eye(15):
        error = error_state(unit.tolist())
        for part, change in transition(FloatOps, PARAMETERS, state):
            error = error._replace(**{part: change(error)})
        columns.append(np.concatenate(error))
    return np.array(columns).T


@given(SEEDS, st.floats(1e-4, 5e-3))
@examples(60)
def test_the_covariance_is_predicted_as_by_dense_matrices(seed: int, elapsed: float) -> None:
    rng = np.random.default_rng(seed)
    before = random_state(rng)
    moved = ekf.propagate(FloatOps, PARAMETERS, before, random_sample(rng), elapsed)
    after = ekf.predict_covariance(FloatOps, PARAMETERS, moved)
    F = dense_transition(before, after, elapsed)
    noise = np.repeat([0.0, 4e-4, 1e-6, 1e-8, 1e-6], 3) * elapsed
    wanted = F @ np.array(unpack(before.covariance)) @ F.T + np.diag(noise)
    scale = np.outer(SIGMAS, SIGMAS)
    np.testing.assert_allclose(np.array(unpack(after.covariance)) / scale, wanted / scale, rtol=0, atol=1e-12)


@given(SEEDS, st.floats(0.0, 0.03))
@examples(60)
def test_a_pose_is_fused_as_by_dense_matrices(seed: int, age: float) -> None:
    """The gain of six measurements at once, Joseph's form, and the normalized innovation squared."""
    rng = np.random.default_rng(seed)
    state = random_state(rng)
    nominal, P = state.nominal, np.array(unpack(state.covariance))
    past_q = so3.multiply(nominal.q_world_body, so3.exp(0.2 * rng.normal(size=3)))
    past = Pose(triple(rng.normal(size=3)), triple(past_q))
    y = np.concatenate([0.003 * rng.normal(size=3), 0.01 * rng.normal(size=3)])
    R_then, R_now = so3.axes(past_q), so3.axes(nominal.q_world_body)
    turn = so3.exp(R_then.T @ R_now @ y[3:])
    y[3:] = R_now.T @ R_then @ (2.0 * turn[1:])  # the chord for the arc
    pose = Pose(triple(past.position + y[:3]), triple(so3.multiply(past_q, turn)))

    H = np.zeros((6, 15))
    H[:3, 0:3] = H[3:, 6:9] = np.eye(3)
    H[:3, 3:6], H[3:, 9:12] = -age * np.eye(3), age * np.eye(3)
    noise = np.diag(np.repeat([1e-6, 2.7e-5], 3))
    S = H @ P @ H.T + noise
    K = P @ H.T @ np.linalg.inv(S)
    keep = np.eye(15) - K @ H

    fused = ekf.fuse(FloatOps, PARAMETERS._replace(max_nis=1e9), state, pose, past, age)
    np.testing.assert_allclose(error_of(fused.nominal, nominal) / SIGMAS, K @ y / SIGMAS, rtol=0, atol=1e-8)
    scale = np.outer(SIGMAS, SIGMAS)
    wanted = keep @ P @ keep.T + K @ noise @ K.T
    np.testing.assert_allclose(np.array(unpack(fused.covariance)) / scale, wanted / scale, rtol=0, atol=1e-9)
    assert fused.nis == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-8)
    assert (fused.accepted, fused.rejections, fused.since_pose) == (1.0, 0.0, age)


@given(SEEDS)
@examples(20)
def test_the_covariance_over_five_samples_at_once_is_nearly_that_of_one_after_another(seed: int) -> None:
    """To a few percent of the spread even while turning at 20 rad/s: it need not be predicted each time."""
    rng = np.random.default_rng(seed)
    each = at_once = random_state(rng)
    sample = random_sample(rng)
    for _ in range(5):
        each = ekf.propagate(FloatOps, PARAMETERS, each, sample, 1e-3)
        each = ekf.predict_covariance(FloatOps, PARAMETERS, each)
        at_once = ekf.propagate(FloatOps, PARAMETERS, at_once, sample, 1e-3)
    at_once = ekf.predict_covariance(FloatOps, PARAMETERS, at_once)
    assert at_once.nominal == each.nominal
    sigmas = np.sqrt(np.diag(np.array(unpack(each.covariance))))
    difference = np.array(unpack(at_once.covariance)) - np.array(unpack(each.covariance))
    assert np.abs(difference / np.outer(sigmas, sigmas)).max() < 0.02


@given(SEEDS)
@examples(30)
def test_the_transition_is_the_derivative_of_the_propagation_to_second_order(seed: int) -> None:
    """A tenth of the time, a hundredth of the difference."""
    rng = np.random.default_rng(seed)
    state, sample, step = random_state(rng), random_sample(rng), 1e-6
    differences = []
    for elapsed in (1e-2, 1e-3):
        moved = ekf.propagate(FloatOps, PARAMETERS, state, sample, elapsed)
        columns = []
        for error in step * np.eye(15):
            ends = []
            for signed in (error, -error):
                other = state._replace(nominal=displaced(state.nominal, signed))
                ends.append(ekf.propagate(FloatOps, PARAMETERS, other, sample, elapsed).nominal)
            columns.append((error_of(ends[0], moved.nominal) - error_of(ends[1], moved.nominal)) / (2 * step))
        differences.append(np.abs(np.array(columns).T - linear_transition(moved)).max())
    size = max(1.0, float(np.linalg.norm(sample.specific_force) + np.linalg.norm(sample.omega)))
    assert differences[0] < size**2 * 1e-2**2
    assert differences[1] < size**2 * 1e-3**2 + 1e-8


@given(SEEDS)
@examples(30)
def test_a_late_pose_measures_the_error_of_its_own_time(seed: int) -> None:
    """What it measures of the error now is the error then but for the square of its age."""
    rng = np.random.default_rng(seed)
    state, error = random_state(rng), 1e-4 * rng.normal(size=15)
    past = ekf.pose_of(state)
    true = state._replace(nominal=displaced(state.nominal, error))
    measured = ekf.pose_of(true)
    samples, dt = [random_sample(rng) for _ in range(5)], 1e-3
    for sample in samples:
        state = ekf.propagate(FloatOps, PARAMETERS, state, sample, dt)
        true = ekf.propagate(FloatOps, PARAMETERS, true, sample, dt)
    now = error_state(error_of(true.nominal, state.nominal).tolist())
    age = dt * len(samples)
    y = pose_innovation(FloatOps, state.nominal, measured, past)
    position = [position_then(axis, age)(now) for axis in range(3)]
    rotation = [rotation_then(axis, age)(now) for axis in range(3)]
    size = 1e-4 * 60.0 * age**2  # of error, of specific force and of rate
    np.testing.assert_allclose(position, y[0], rtol=0, atol=4 * size)
    np.testing.assert_allclose(rotation, y[1], rtol=0, atol=4 * size)


def correlation_eigenvalues(state: EkfState) -> Array:
    P = np.array(unpack(state.covariance))
    sigmas = np.sqrt(np.diag(P))
    return np.linalg.eigvalsh(P / np.outer(sigmas, sigmas))


@given(SEEDS)
@examples(25)
def test_the_covariance_stays_positive_definite_whatever_is_measured(seed: int) -> None:
    """Wild samples, poses that agree, outliers and jumps, without noise of the IMU for some."""
    rng = np.random.default_rng(seed)
    quiet = PARAMETERS._replace(
        gyro_noise=0.0, accelerometer_noise=0.0, gyro_walk=0.0, accelerometer_walk=0.0
    )
    parameters = quiet if seed % 3 == 0 else PARAMETERS
    state = random_state(rng)
    for _ in range(120):
        elapsed = float(rng.choice([0.0, 1e-3, 0.02]))
        state = ekf.propagate(FloatOps, parameters, state, random_sample(rng), elapsed)
        state = ekf.predict_covariance(FloatOps, parameters, state)
        past = ekf.pose_of(state)
        size = rng.choice([1e-3, 1e-3, 0.5])
        turned = so3.multiply(past.q_world_body, so3.exp(size * rng.normal(size=3)))
        pose = Pose(triple(past.position + size * rng.normal(size=3)), triple(turned))
        state = ekf.fuse(FloatOps, parameters, state, pose, past, 0.01, bool(rng.random() < 0.5))
        assert correlation_eigenvalues(state).min() > 1e-12
        assert abs(np.linalg.norm(state.nominal.q_world_body) - 1.0) < 1e-14


def settled(seed: int = 3) -> EkfState:
    """A state with correlations, of millimetres."""
    rng = np.random.default_rng(seed)
    state = random_state(rng)
    for _ in range(30):
        state = ekf.propagate(FloatOps, PARAMETERS, state, random_sample(rng), 1e-3)
        state = ekf.predict_covariance(FloatOps, PARAMETERS, state)
        past = ekf.pose_of(state)
        state = ekf.fuse(FloatOps, PARAMETERS, state, past, past, 0.0)
    return state


def test_an_outlier_changes_nothing_but_the_count() -> None:
    state = settled()
    past = ekf.pose_of(state)
    outlier = past._replace(position=triple(np.add(past.position, [0.3, 0.0, 0.0])))
    after = ekf.fuse(FloatOps, PARAMETERS, state, outlier, past, 0.01)
    assert (after.accepted, after.rejections, after.jumps) == (0.0, 1.0, 0.0)
    assert after.nis > PARAMETERS.max_nis
    assert (after.nominal, after.covariance, after.since_pose) == (
        state.nominal,
        state.covariance,
        state.since_pose,
    )
    again = ekf.fuse(FloatOps, PARAMETERS, after, past, past, 0.01)
    assert (again.accepted, again.rejections, again.jumps) == (1.0, 0.0, 0.0)


def test_a_pose_that_stays_where_it_jumped_to_is_believed_at_the_stated_count() -> None:
    """The pose begins anew at the measured one, its velocity's share of the age with it."""
    state = settled()
    age = 0.01
    past = ekf.pose_of(state)
    turn = so3.exp([0.0, np.radians(2.0), 0.0])
    pose = Pose(
        triple(np.add(past.position, [0.05, 0.0, 0.0])), triple(so3.multiply(turn, past.q_world_body))
    )
    kept = state
    for count in range(1, 5):
        kept = ekf.fuse(FloatOps, PARAMETERS, kept, pose, past, age)
        assert (kept.rejections, kept.accepted) == (count, 0.0)
    jumped = ekf.fuse(FloatOps, PARAMETERS, kept, pose, past, age)
    assert (jumped.rejections, jumped.accepted, jumped.jumps) == (0.0, 1.0, 1.0)
    np.testing.assert_allclose(jumped.nominal.position, pose.position, atol=1e-15)
    np.testing.assert_allclose(jumped.nominal.q_world_body, pose.q_world_body, atol=1e-15)
    assert jumped.nominal.velocity == state.nominal.velocity
    P = np.array(unpack(jumped.covariance))
    moving = P[3:6, 3:6]
    np.testing.assert_allclose(P[0:3, 0:3], 1e-6 * np.eye(3) + age**2 * moving, rtol=0, atol=1e-18)
    np.testing.assert_allclose(P[0:3, 3:6], age * moving, rtol=0, atol=1e-18)
    growth = np.diag(moving) - np.diag(np.array(unpack(state.covariance)))[3:6]
    speed = np.linalg.norm(state.nominal.velocity)
    np.testing.assert_allclose(growth, (speed * np.radians(2.0)) ** 2, rtol=1e-3)
    assert correlation_eigenvalues(jumped).min() > 0.0


def test_where_no_pose_arrives_nothing_changes() -> None:
    state = settled()
    nowhere = Pose((np.nan,) * 3, (np.nan,) * 4)
    assert ekf.fuse(FloatOps, PARAMETERS, state, nowhere, nowhere, 0.0, False) == state


@given(SEEDS)
@examples(30)
def test_an_earlier_pose_is_corrected_by_what_is_fused_since(seed: int) -> None:
    """The corrected past, propagated with the corrected velocity and biases, leads to the corrected now."""
    rng = np.random.default_rng(seed)
    then = random_state(rng, 1e-2 * random_rows(rng))
    sample, age = random_sample(rng), 0.01
    now = ekf.propagate(FloatOps, PARAMETERS, then, sample, age)
    error = 1e-2 * SIGMAS * rng.normal(size=15)
    error[9:12] = 0.0  # of what a gyro's bias adds in the age, nothing is said
    corrected = now._replace(nominal=displaced(now.nominal, error))
    back = ekf.carried_back(now, corrected, ekf.pose_of(then), age)
    start = corrected.nominal._replace(
        position=back.position,
        q_world_body=back.q_world_body,
        velocity=triple(np.add(then.nominal.velocity, error[3:6])),
    )
    again = ekf.propagate(FloatOps, PARAMETERS, then._replace(nominal=start), sample, age)
    missed = error_of(again.nominal, corrected.nominal)
    assert np.abs(missed[0:3]).max() < 60.0 * age**2 * np.abs(error).max()
    assert np.abs(missed[6:9]).max() < 1e-12


def operations(function: Any, *trees: Any) -> int:
    """Operations that a compiler sees of a kernel."""
    trace = Trace()
    symbols = [tree_map(lambda _: trace.input(f"{len(trace.operations)}"), tree) for tree in trees]
    results = tree_leaves(function(trace, *symbols))
    needed = trace.needed([trace.symbol(result).number for result in results])
    return sum(trace.operations[number].name not in ("input", "constant") for number in needed)


def test_a_sample_takes_a_fifth_of_the_operations_of_dense_matrices() -> None:
    """Two products of 15 x 15 matrices take 13 000 or, from symmetry, 6500."""
    state, sample = settled(), ImuSample((0.0,) * 3, (0.0,) * 3)

    def predicted(ops: Any, parameters: Any, state: Any, sample: Any, elapsed: Any) -> Any:
        moved = ekf.propagate(ops, parameters, state, sample, elapsed)
        return ekf.predict_covariance(ops, parameters, moved)

    pose = ekf.pose_of(state)
    assert operations(predicted, PARAMETERS, state, sample, 0.0) < 1300
    assert operations(ekf.fuse, PARAMETERS, state, pose, pose, 0.0) < 2900


@given(st.floats(0.0, 1.0), SEEDS)
def test_the_series_of_the_quaternion_is_exact_for_small_rotations_and_near_for_others(
    angle: float, seed: int
) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    phi = angle * axis / np.linalg.norm(axis)
    near = 4e-16 if angle <= 0.2 else 1e-9
    np.testing.assert_allclose(exp_of_small(triple(phi)), so3.exp(phi), rtol=0, atol=near)


@pytest.mark.slow
def test_engines_agree_on_poses_outliers_and_a_jump() -> None:
    parameters, inputs = measured_hover()
    init, step = filter_loop(2)
    rows = []
    for name in ("floats", "compiled"):
        loop = choose(name, 3, 60).compile(init, step, parameters, first_row(inputs))
        rows.append(loop.scan(loop.init(first_row(inputs)), inputs)[1])
    assert rows[0].jumps.max() > 0.0
    assert rows[0].accepted.min() == 0.0
    for one, other in zip(tree_leaves(rows[0]), tree_leaves(rows[1]), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_on_arrays_of_jax_the_numbers_are_those_of_floats() -> None:
    """Operation by operation: XLA takes a minute to compile so many."""
    parameters, inputs = measured_hover(latency=1)
    ticks = STRIDE + 1  # until the first pose arrives
    init, step = filter_loop(2)
    ops = SimpleNamespace(
        sqrt=jnp.sqrt, exp=jnp.exp, minimum=jnp.minimum, maximum=jnp.maximum, select=jnp.where
    )
    with jax.enable_x64(True):
        on_jax = tree_map(jnp.asarray, parameters)
        carry = init(ops, on_jax, first_row(inputs))
        for tick in range(ticks):
            row = tree_map(lambda leaf, tick=tick: jnp.asarray(leaf[tick]), inputs)
            carry, state = step(ops, on_jax, carry, row)
    loop = choose("floats", 3, ticks).compile(init, step, parameters, first_row(inputs))
    first = tree_map(lambda leaf: leaf[:ticks], inputs)
    rows = loop.scan(loop.init(first_row(inputs)), first)[1]
    assert np.asarray(state.nis).min() > 0.0
    for one, other in zip(tree_leaves(rows), tree_leaves(state), strict=True):
        np.testing.assert_allclose(one[:, -1], other, rtol=1e-9, atol=1e-12)


def test_error_parts_are_named_in_the_order_of_their_components() -> None:
    assert np.concatenate(error_state(list(range(15)))).tolist() == list(range(15))
    assert ErrorState._fields[2] == "rotation"
