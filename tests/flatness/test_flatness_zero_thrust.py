"""Where thrust vanishes the attitude is undetermined: said so, held, and never NaN."""

import numpy as np
import pytest

from aerobat import so3
from aerobat.flatness import reference
from aerobat.states import STANDARD_GRAVITY
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle

VEHICLE = load_vehicle("agile-quad")
GRAVITY = np.array([0.0, 0.0, STANDARD_GRAVITY])


def through_zero(miss, slope=10.0, gravity=STANDARD_GRAVITY):
    """Thrust (miss, 0, slope (1 − t)) over 2 s: upright, then nearly none at 1 s, then inverted."""
    coefficients = np.zeros((1, 4, 3))
    coefficients[0, 2] = np.array([miss, 0, slope - gravity]) * 2
    coefficients[0, 3] = np.array([0, 0, -slope]) * 8 / 6
    return Trajectory([2.0], coefficients)


@pytest.mark.parametrize("rate", [3.0, 100.0, 500.0])
@pytest.mark.parametrize("miss", [0.0, 1e-9, 5e-3, 9.5e-3])
def test_vanishing_thrust_is_reported_between_samples_too_and_attitude_held(miss, rate):
    found = reference(through_zero(miss), VEHICLE, rate=rate)
    half = np.sqrt((1e-3 * STANDARD_GRAVITY) ** 2 - miss**2) / 10
    (span,) = found.undetermined
    assert span.start == pytest.approx(1 - half, abs=1e-9)
    assert span.end == pytest.approx(1 + half, abs=1e-9)
    q, omega = found.setpoint.q_world_body, found.setpoint.omega_body
    inside = (found.times > span.start) & (found.times < span.end)
    assert np.isfinite(found.rotor_thrusts).all()
    assert (omega[inside] == 0).all()
    np.testing.assert_allclose(so3.thrust_axis(q[0]), [miss / 10, 0, 1], atol=1e-6)
    np.testing.assert_allclose(so3.thrust_axis(q[-1]), [miss / 10, 0, -1], atol=1e-6)


def test_a_near_miss_of_zero_thrust_is_a_fast_flip_about_one_axis():
    for rate in (3.0, 500.0):
        found = reference(through_zero(0.02), VEHICLE, rate=rate)
        assert found.undetermined == ()
        q = found.setpoint.q_world_body
        np.testing.assert_allclose(so3.rotate(q, np.array([0.0, 1.0, 0.0]))[:, 1], 1.0, atol=1e-12)
        assert found.setpoint.omega_body[np.argmin(abs(found.times - 1)), 1] >= 0


def test_free_fall_holds_the_attitude_for_its_whole_span():
    fall = Trajectory.from_inputs(
        np.zeros((3, 3)), [[0, 0, -2 * STANDARD_GRAVITY], [0, 0, 0], [5, 0, 0]], 0.5
    )
    found = reference(fall, VEHICLE, rate=200.0)
    (span,) = found.undetermined
    assert span.start == pytest.approx(0.4995)
    assert span.end == pytest.approx(1.0 + 1e-3 * STANDARD_GRAVITY / 5)
    inside = (found.times >= span.start) & (found.times <= span.end)
    np.testing.assert_allclose(found.setpoint.q_world_body[inside], [[1, 0, 0, 0]] * inside.sum(), atol=1e-12)
    whole = reference(Trajectory([1.0], [np.array([[0, 0, 0], [3, 0, 0], -GRAVITY / 2])]), VEHICLE, rate=50.0)
    assert [(span.start, span.end) for span in whole.undetermined] == [(0.0, 1.0)]
    np.testing.assert_array_equal(whole.setpoint.q_world_body, [[1, 0, 0, 0]] * len(whole.times))


@pytest.mark.parametrize("hundreds", [10, pytest.param(90, marks=pytest.mark.slow)])
def test_thousands_of_random_trajectories_have_no_nan_and_report_zero_thrust(hundreds):
    # back to back, a hundred at a time, three segments each; every fifth passes exactly through zero thrust
    rng = np.random.default_rng(hundreds)
    for _ in range(hundreds):
        coefficients = rng.normal(size=(100, 3, 6, 3)) * np.exp(rng.uniform(-4, 4, (100, 1, 1, 1)))
        durations = rng.uniform(0.05, 1.0, (100, 3))
        zero_at = rng.uniform(0.2, 0.8, (20, 1))
        through = rng.normal(size=(20, 3)) * 30
        square = durations[::5, 1, None] ** 2
        coefficients[::5, 1, 2:] = 0.0
        coefficients[::5, 1, 2] = (-GRAVITY - through * zero_at) * square / 2
        coefficients[::5, 1, 3] = through * square / 6
        trajectory = Trajectory(durations.ravel(), coefficients.reshape(300, 6, 3))
        found = reference(
            trajectory,
            VEHICLE,
            times=np.sort(rng.uniform(0, trajectory.duration, 500)),
        )
        setpoint = found.setpoint
        for array in (
            setpoint.q_world_body,
            setpoint.omega_body,
            setpoint.omega_dot_body,
            found.rotor_thrusts,
        ):
            assert np.isfinite(array).all()
        np.testing.assert_allclose(np.linalg.norm(setpoint.q_world_body, axis=-1), 1.0, atol=1e-12)
        crossings = trajectory.knots[1:-1:3][::5] + zero_at[:, 0] * durations[::5, 1]
        starts, ends = np.array([(span.start, span.end) for span in found.undetermined]).T
        assert ((starts[:, None] <= crossings) & (crossings <= ends[:, None])).any(axis=0).all()
