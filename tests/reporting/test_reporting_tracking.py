"""The tracking page shows reference, actual, the vehicle's limits, and saturation as it was."""

from functools import lru_cache

import numpy as np
import pytest

import aerobat as ab
from aerobat.reporting.panels.timelines import fit_to_limits
from aerobat.vehicle import wrench
from paper.signals import at_limit, wrench_limits
from paper.tracking import tracking_figure
from reporting_cases import batch_of, require_legible, simulated
from shared_plans import shared_plan

pytestmark = pytest.mark.filterwarnings("error")  # drawing warns of nothing
VEHICLE = ab.load_vehicle("section-v")
PROBLEM = ab.load_problem("section-v")
POSITIONS = ("x [m]", "z [m]")
VELOCITIES = ("$v_x$ [m/s]", "$v_z$ [m/s]")


@lru_cache
def section_v(stop_after=None):
    plan = ab.plan(PROBLEM, ab.MinSnap(stop_after=stop_after), VEHICLE)
    return plan, ab.fly(plan.trajectory, VEHICLE)


@lru_cache
def page_of(stop_after=None):
    plan, flight = section_v(stop_after)
    return tracking_figure(plan, VEHICLE, flight), plan, flight


def panels(figure, label):
    return [axes for axes in figure.axes if axes.get_ylabel() == label]


def lines(axes, count):
    """The reference series, the actual one, and the levels of the limits, all dashed."""
    reference, flight, *others = axes.get_lines()
    limits = [line for line in others if len(line.get_ydata()) == 2]
    assert all(line.get_linestyle() == "--" for line in limits)
    assert len(limits) == count
    return reference.get_data(), flight.get_data(), sorted(line.get_ydata()[0] for line in limits)


def rotor_panels(figure, count):
    return figure.axes[-count:]


def shaded(axes):
    """Spans of time with a shade [s], (k, 2)."""
    boxes = [p.get_extents() for c in axes.collections if c.get_zorder() == 0.3 for p in c.get_paths()]
    return np.array([[box.x0, box.x1] for box in boxes]).reshape(-1, 2)


@pytest.mark.slow
@pytest.mark.parametrize("stop_after", [None, 6])
def test_no_text_of_section_v_lies_over_another_or_beyond_the_page(stop_after, monkeypatch):
    require_legible(page_of(stop_after)[0], monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "vehicle"),
    [
        ("flip-roll", "agile-quad"),
        ("half-flip", "agile-quad"),
        ("line", "agile-quad"),
        ("flip-roll", "hexarotor"),
    ],
)
def test_no_text_lies_over_another_or_beyond_the_page(problem, vehicle, monkeypatch):
    plan, flight = shared_plan(problem, vehicle), simulated(problem, vehicle)
    require_legible(tracking_figure(plan, ab.load_vehicle(vehicle), flight), monkeypatch)


@pytest.mark.parametrize("stop_after", [None, 6])
def test_motion_is_the_flight_s_beside_the_plan_s(stop_after):
    figure, plan, flight = page_of(stop_after)
    for labels, derivative, truth in (
        (POSITIONS, 0, flight.states.position),
        (VELOCITIES, 1, flight.states.velocity),
    ):
        for label, axis in zip(labels, (0, 2), strict=True):
            (reference_times, reference), (actual_times, given), _ = lines(panels(figure, label)[0], 0)
            np.testing.assert_allclose(
                reference, plan.trajectory.evaluate(reference_times, derivative)[:, axis], atol=1e-9
            )
            np.testing.assert_array_equal(actual_times, flight.times)
            np.testing.assert_array_equal(given, truth[:, axis])


def test_what_does_not_move_is_left_out():
    labels = {axes.get_ylabel() for axes in page_of()[0].axes}
    assert {*POSITIONS, *VELOCITIES, "$M_y$ [N·m]"} <= labels
    assert not {"y [m]", "$v_y$ [m/s]", "$M_x$ [N·m]", "$M_z$ [N·m]"} & labels


def test_thrust_and_moment_are_drawn_with_what_rotors_within_their_limits_can_give():
    figure, _, flight = page_of(4)
    given, arm = wrench(VEHICLE, flight.thrusts), 0.3
    _, (_, thrust), limits = lines(panels(figure, "thrust [N]")[0], 2)
    np.testing.assert_allclose(thrust, given.thrust)
    np.testing.assert_allclose(limits, [4 * -0.2, 4 * 18.0])
    _, (_, moment), limits = lines(panels(figure, "$M_y$ [N·m]")[0], 2)
    np.testing.assert_allclose(moment, given.moment_body[:, 1])
    np.testing.assert_allclose(limits, [-18.2 * arm, 18.2 * arm])


@pytest.mark.parametrize("vehicle", ["agile-quad", "hexarotor", "crazyflie"])
def test_no_thrusts_within_the_limits_give_more_than_the_drawn_wrench_limits(vehicle):
    body, rng = ab.load_vehicle(vehicle), np.random.default_rng(1)
    share = rng.integers(0, 2, (4000, len(body.rotors)))  # the extremes of a linear map are at corners
    reached = wrench(body, body.min_thrusts + share * (body.max_thrusts - body.min_thrusts))
    reached = np.column_stack([reached.thrust, reached.moment_body])
    low, high = wrench_limits(body)
    np.testing.assert_allclose(reached.min(axis=0), low, atol=1e-9)
    np.testing.assert_allclose(reached.max(axis=0), high, atol=1e-9)


@pytest.mark.parametrize("stop_after", [None, 6])
def test_every_rotor_is_drawn_with_its_limits(stop_after):
    figure, plan, flight = page_of(stop_after)
    for i, axes in enumerate(rotor_panels(figure, 4)):
        (reference_times, reference), (_, given), limits = lines(axes, 2)
        environment = PROBLEM.environment
        expected = ab.reference(
            plan.trajectory, VEHICLE, times=reference_times, environment=environment
        ).rotor_thrusts
        np.testing.assert_allclose(reference, expected[:, i], atol=1e-9)
        np.testing.assert_array_equal(given, flight.thrusts[:, i])
        np.testing.assert_allclose(limits, [-0.2, 18.0])


def test_saturation_is_shaded_where_it_was():
    figure, _, flight = page_of(4)
    middles = (flight.times[:-1] + flight.times[1:]) / 2

    def within(axes):
        spans = shaded(axes)
        return ((middles[:, None] > spans[:, 0]) & (middles[:, None] < spans[:, 1])).any(axis=1)

    assert flight.saturated[:-1].mean() > 0.5
    for label in (*POSITIONS, *VELOCITIES, "attitude error [°]", "thrust [N]", "$M_y$ [N·m]"):
        np.testing.assert_array_equal(within(panels(figure, label)[0]), flight.saturated[:-1])
    for i, axes in enumerate(rotor_panels(figure, 4)):
        np.testing.assert_array_equal(within(axes), at_limit(flight)[:-1, i])
    assert "saturated" in {text.get_text() for text in panels(figure, "x [m]")[0].get_legend().get_texts()}


def test_nothing_is_shaded_in_a_flight_without_saturation():
    figure, _, flight = page_of()
    assert not flight.saturated.any()
    assert not any(len(shaded(axes)) for axes in figure.axes)
    names = {text.get_text() for text in panels(figure, "x [m]")[0].get_legend().get_texts()}
    assert names == {"reference", "actual", "limits"}


def test_a_flight_that_ends_early_is_marked_where_it_ended():
    figure, plan, flight = page_of(4)
    assert flight.times[-1] < plan.duration
    axes = panels(figure, "z [m]")[0]
    cross = next(line for line in axes.get_lines() if line.get_marker() == "x")
    np.testing.assert_allclose(cross.get_xydata(), [[flight.times[-1], flight.states.position[-1, 2]]])
    assert axes.get_xlim()[1] == pytest.approx(plan.duration)


def test_waypoints_are_marked_on_the_path():
    figure, _, _ = page_of()
    path = figure.axes[0]
    mark = next(line for line in path.get_lines() if line.get_label() == "waypoint 1")
    course = next(c for c in path.collections if c.get_zorder() == 2.0)
    vertices = np.concatenate([p.vertices for p in course.get_paths()])
    assert np.linalg.norm(vertices - mark.get_xydata(), axis=1).min() < 0.03  # [m] on the drawn path


def test_an_axis_stretched_far_beyond_its_limits_is_cut_off_and_says_so():
    axes = page_of.__wrapped__()[0].axes[-1]  # a page of its own, for it is changed
    fit_to_limits(axes, (0.0, 10.0), np.array([-4000.0, 4000.0]))
    assert axes.get_ylim() == pytest.approx((-12.4, 22.4))
    assert "cut off: −4000 to 4000" in {text.get_text() for text in axes.texts}


def test_a_batch_is_refused_in_a_sentence():
    with pytest.raises(ab.SpecError, match=r"flight\[k\]"):
        tracking_figure(shared_plan("line"), ab.load_vehicle("agile-quad"), batch_of("line", 2))
