"""Laws of trajectories: exact integration, knots, samples and extremes."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from aerobat.errors import SpecError
from aerobat.trajectory import Trajectory
from suites import examples

seeds = st.integers(0, 2**32 - 1)


def random_trajectory(seed, segments=6, degree=5):
    rng = np.random.default_rng(seed)
    return Trajectory(rng.uniform(0.05, 2.0, segments), rng.normal(size=(segments, degree + 1, 3)))


@given(seed=seeds, order=st.integers(3, 5), intervals=st.integers(1, 30))
def test_inputs_are_integrated_exactly(seed, order, intervals):
    rng = np.random.default_rng(seed)
    initial, inputs, dt = rng.normal(size=(order, 3)), rng.normal(size=(intervals, 3)), rng.uniform(0.05, 0.3)
    trajectory = Trajectory.from_inputs(initial, inputs, dt)
    for k in range(order):
        np.testing.assert_allclose(trajectory.evaluate(0.0, k), initial[k], rtol=1e-12, atol=1e-12)
        scale = 1 + trajectory.peak(k).value
        assert trajectory.jumps(k).max(initial=0.0) <= 1e-12 * scale
    middles = (np.arange(intervals) + 0.5) * dt
    np.testing.assert_allclose(trajectory.evaluate(middles, order), inputs, rtol=1e-9)
    assert trajectory.duration == pytest.approx(intervals * dt, rel=1e-14)
    assert trajectory.degree == order


def test_inputs_lead_where_an_ode_solver_goes():
    rng = np.random.default_rng(3)
    initial, inputs = rng.normal(size=(3, 3)), rng.normal(size=(4, 3))
    trajectory = Trajectory.from_inputs(initial, inputs, 0.25)
    state = initial.ravel()
    for n, jerk in enumerate(inputs):
        rates = lambda t, y, u=jerk: np.concatenate([y[3:], u])  # noqa: E731
        state = solve_ivp(rates, (0.0, 0.25), state, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        for k in range(3):
            np.testing.assert_allclose(
                trajectory.on_segments([1.0], k)[n, 0], state[3 * k : 3 * k + 3], atol=1e-11
            )


@given(seed=seeds, derivative=st.integers(0, 4))
def test_each_derivative_is_the_rate_of_the_one_below(seed, derivative):
    trajectory = random_trajectory(seed)
    h = 1e-5
    s = np.array([0.2, 0.5, 0.8])
    t = (trajectory.knots[:-1, None] + s * trajectory.durations[:, None]).ravel()
    difference = (trajectory.evaluate(t + h, derivative) - trajectory.evaluate(t - h, derivative)) / (2 * h)
    exact = trajectory.evaluate(t, derivative + 1)
    scale = 1 + np.abs(trajectory.on_segments(s, derivative + 3)).max() * h**2
    scale += np.abs(trajectory.on_segments(s, derivative)).max() * 1e-15 / h / 1e-5
    np.testing.assert_allclose(difference, exact, atol=1e-5 * scale, rtol=1e-5)


@given(seed=seeds)
def test_at_a_knot_the_later_segment_counts_and_both_sides_can_be_had(seed):
    trajectory = random_trajectory(seed)
    for k in range(3):
        sides = trajectory.on_segments([0.0, 1.0], k)
        np.testing.assert_array_equal(trajectory.evaluate(trajectory.knots[:-1], k), sides[:, 0])
        np.testing.assert_allclose(trajectory.evaluate(trajectory.duration, k), sides[-1, 1])
        jumps = np.linalg.norm(sides[1:, 0] - sides[:-1, 1], axis=-1)
        np.testing.assert_array_equal(trajectory.jumps(k), jumps)


def test_times_keep_their_shape():
    trajectory = random_trajectory(0)
    t = np.linspace(0.0, trajectory.duration, 12).reshape(3, 4)
    assert trajectory.evaluate(t).shape == (3, 4, 3)
    assert trajectory.evaluate(0.1, 2).shape == (3,)
    assert trajectory.flat(t).snap.shape == (3, 4, 3)
    np.testing.assert_array_equal(trajectory.flat(t).jerk, trajectory.evaluate(t, 3))


@pytest.mark.parametrize("kind", [np.int64, np.uint8])
def test_an_order_of_derivative_is_any_whole_number(kind):
    trajectory = random_trajectory(0)
    np.testing.assert_array_equal(trajectory.evaluate(0.1, kind(4)), trajectory.evaluate(0.1, 4))
    assert trajectory.effort(kind(4)) == trajectory.effort(4)
    for wrong in (True, 2.0, np.float64(2.0), kind(200)):
        with pytest.raises(SpecError, match=r"derivative must be a whole number from 0 to 31"):
            trajectory.evaluate(0.1, wrong)


@pytest.mark.parametrize("outside", [-1e-6, 12.1, np.nan, np.inf])
def test_a_time_outside_is_refused(outside):
    trajectory = random_trajectory(0)
    with pytest.raises(SpecError, match="times must lie in"):
        trajectory.evaluate([0.1, outside])


def test_rounding_beyond_the_ends_is_forgiven():
    trajectory = random_trajectory(0)
    end = trajectory.duration
    np.testing.assert_array_equal(trajectory.evaluate(end + 1e-10), trajectory.evaluate(end))
    np.testing.assert_array_equal(trajectory.evaluate(-1e-10), trajectory.evaluate(0.0))


@given(duration=st.floats(1e-6, 30.0), rate=st.floats(0.1, 1000.0))
def test_samples_are_one_period_apart_and_end_at_the_end(duration, rate):
    times = Trajectory([duration], np.zeros((1, 2, 3))).sample(rate)
    steps = np.diff(times)
    assert times[0] == 0.0
    assert times[-1] == duration
    np.testing.assert_allclose(steps[:-1], 1 / rate, rtol=1e-9)
    assert 0 < steps[-1] <= 1 / rate + 1.1e-9


def test_whole_periods_make_no_extra_sample():
    trajectory = Trajectory.from_inputs(np.zeros((3, 3)), np.ones((20, 3)), 0.1)
    assert len(trajectory.sample(100.0)) == 201


@examples(40)
@given(seed=seeds, degree=st.integers(1, 9), derivative=st.integers(0, 3))
def test_no_sample_exceeds_the_peak_and_the_peak_is_taken(seed, degree, derivative):
    trajectory = random_trajectory(seed, degree=degree)
    peak = trajectory.peak(derivative)
    sampled = np.linalg.norm(trajectory.on_segments(np.linspace(0, 1, 500), derivative), axis=-1).max()
    assert sampled <= peak.value * (1 + 1e-12)
    assert peak.value <= sampled * 1.05 + 1e-12
    if not np.isclose(trajectory.knots, peak.time, atol=1e-9).any():  # at a knot, either side may hold it
        taken = np.linalg.norm(trajectory.evaluate(peak.time, derivative))
        assert taken == pytest.approx(peak.value, rel=1e-9)


@examples(40)
@given(seed=seeds, degree=st.integers(1, 9), derivative=st.integers(0, 4))
def test_no_sample_leaves_the_range_of_its_component_and_both_its_ends_are_taken(seed, degree, derivative):
    trajectory = random_trajectory(seed, degree=degree)
    lowest, highest = trajectory.component_range(derivative)
    assert lowest.shape == highest.shape == (3,)
    sampled = trajectory.on_segments(np.linspace(0.0, 1.0, 401), derivative)
    slack = 1e-12 * (1 + np.abs(sampled).max())
    below, above = sampled.min(axis=(0, 1)) - lowest, highest - sampled.max(axis=(0, 1))
    room = 1e-3 * (highest - lowest) + slack
    for missed in (below, above):
        assert (missed >= -slack).all()
        assert (missed <= room).all()


@given(seed=seeds, gravity=st.floats(0.0, 30.0))
def test_specific_thrust_range_bounds_all_samples(seed, gravity):
    trajectory = random_trajectory(seed)
    thrust = trajectory.on_segments(np.linspace(0, 1, 2000), 2) + np.array([0.0, 0.0, gravity])
    norms = np.linalg.norm(thrust, axis=-1)
    least, largest = trajectory.specific_thrust_range(gravity)
    assert least.value <= norms.min() + 1e-9
    assert norms.min() - least.value <= 1e-2 * norms.max()
    assert norms.max() <= largest.value * (1 + 1e-12)


def test_free_fall_has_no_thrust_and_hover_has_weight():
    fall = Trajectory([2.0], [np.array([[0, 0, 5], [1, 0, 0], [0, 0, -9.81 * 2]])])
    least, largest = fall.specific_thrust_range(9.81)
    assert least.value == largest.value == pytest.approx(0.0, abs=1e-14)
    hover = Trajectory([2.0], np.zeros((1, 1, 3)))
    assert hover.specific_thrust_range(9.81)[0].value == 9.81
    assert hover.peak(0).value == 0.0


@given(seed=seeds, derivative=st.integers(0, 5))
def test_effort_is_the_integral_of_the_squared_derivative(seed, derivative):
    trajectory = random_trajectory(seed, segments=2)
    expected = sum(
        quad(lambda t: np.sum(trajectory.evaluate(t, derivative) ** 2), a, b - 1e-12, epsrel=1e-10)[0]
        for a, b in zip(trajectory.knots[:-1], trajectory.knots[1:], strict=True)
    )
    assert trajectory.effort(derivative) == pytest.approx(expected, rel=1e-7, abs=1e-9)


def test_effort_of_constant_inputs_is_their_sum_of_squares():
    inputs = np.random.default_rng(0).normal(size=(20, 3))
    trajectory = Trajectory.from_inputs(np.zeros((4, 3)), inputs, 0.1)
    assert trajectory.effort(4) == pytest.approx(0.1 * np.sum(inputs**2), rel=1e-12)


def test_arrays_are_copied_and_cannot_be_written():
    durations, coefficients = np.ones(2), np.zeros((2, 3, 3))
    trajectory = Trajectory(durations, coefficients)
    durations[0] = 5.0
    assert trajectory.duration == 2.0
    for array in (trajectory.durations, trajectory.coefficients, trajectory.knots):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        trajectory.durations = durations


@pytest.mark.parametrize(
    ("durations", "coefficients", "named"),
    [
        ([], np.zeros((0, 3, 3)), "durations"),
        ([1.0, 0.0], np.zeros((2, 3, 3)), "durations"),
        ([1.0, -1.0], np.zeros((2, 3, 3)), "durations"),
        ([1.0, np.nan], np.zeros((2, 3, 3)), "durations"),
        ([1.0, np.inf], np.zeros((2, 3, 3)), "durations"),
        (["a"], np.zeros((1, 3, 3)), "durations"),
        ([1.0], np.zeros((2, 3, 3)), "coefficients"),
        ([1.0], np.zeros((1, 3, 2)), "coefficients"),
        ([1.0], np.zeros((3, 3)), "coefficients"),
        ([1.0], np.zeros((1, 0, 3)), "coefficients"),
        ([1.0], np.full((1, 3, 3), np.nan), "coefficients"),
    ],
)
def test_wrong_pieces_are_refused_by_name(durations, coefficients, named):
    with pytest.raises(SpecError, match=named):
        Trajectory(durations, coefficients)


@pytest.mark.parametrize(
    ("initial", "inputs", "dt"),
    [
        (np.zeros((3, 2)), np.zeros((4, 3)), 0.1),
        (np.zeros((3, 3)), np.zeros((0, 3)), 0.1),
        (np.zeros((0, 3)), np.zeros((4, 3)), 0.1),
        (np.zeros((3, 3)), np.zeros((4, 3)), 0.0),
        (np.zeros((3, 3)), np.zeros((4, 3)), np.nan),
        (np.zeros((3, 3)), np.full((4, 3), np.inf), 0.1),
    ],
)
def test_wrong_inputs_are_refused(initial, inputs, dt):
    with pytest.raises(SpecError):
        Trajectory.from_inputs(initial, inputs, dt)


def test_inputs_that_last_too_long_are_refused_with_how_long():
    with pytest.raises(SpecError, match=r"inputs must last 1e\+06 s at most, got 2e\+08 s"):
        Trajectory.from_inputs(np.zeros((3, 3)), np.zeros((2, 3)), 1e8)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_wrong_rates_are_refused(rate):
    with pytest.raises(SpecError, match="rate"):
        random_trajectory(0).sample(rate)
