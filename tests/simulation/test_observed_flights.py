"""A flight that a filter saw tells what it saw, in its series, its file, its score and its report."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.reporting.facts import facts
from aerobat.simulation.flight import SERIES

LAB = ab.load_dispersion("lab")
OBSERVED = {one.name for one in SERIES if one.part == "observer"}


@pytest.fixture(scope="module")
def line() -> ab.Plan:
    return ab.plan("line", ab.Miqp(order=4), "agile-quad")


def with_outage(begin: float, duration: float) -> ab.Dispersion:
    capture = replace(LAB.motion_capture, outage=ab.Outage(begin, duration), dropout=0.0, outlier=0.0)
    return replace(LAB, motion_capture=capture)


def test_what_is_observed_is_kept_saved_and_picked_and_only_where_a_filter_flew(
    line: ab.Plan, tmp_path: Path
) -> None:
    batch = ab.fly(line, conditions="lab", seed=2, flights=2)
    assert set(batch.series) >= OBSERVED
    one = batch[1]
    one.save(tmp_path / "flight.npz")
    assert ab.load_flight(tmp_path / "flight.npz") == one
    alone = ab.fly(line, conditions="lab", seed=2, flights=range(1, 2))[0]
    np.testing.assert_allclose(alone.observed_position, one.observed_position, atol=1e-9)
    assert not set(ab.fly(line).series) & OBSERVED
    assert ab.score(ab.fly(line), line).observer is None


def test_the_filter_s_errors_are_small_beside_what_the_vehicle_is_off_its_path(line: ab.Plan) -> None:
    flight = ab.fly(line, conditions=replace(LAB, motion_capture=ab.MotionCapture()), seed=2)
    found = ab.score(flight, line)
    assert found.observer is not None
    assert found.observer.rms_position_error_m < 0.002 < found.max_position_error_m
    assert found.observer.rms_attitude_error_deg < 0.3


@pytest.mark.parametrize(("begin", "duration"), [(0.3, 0.5), (0.5, 0.2)])
def test_an_outage_is_flown_by_the_imu_and_said_with_its_times(
    begin: float, duration: float, line: ab.Plan
) -> None:
    found = ab.score(ab.fly(line, conditions=with_outage(begin, duration), seed=1), line)
    assert found.outcome.is_success
    assert found.observer is not None
    assert found.observer.coasted
    assert found.observer.longest_without_pose_s == pytest.approx(duration, abs=0.03)
    (said,) = (fact.words for fact in facts(found) if fact.label == "observer")
    assert f"no poses from {begin - 0.01:.2f}" in said
    assert "the IMU alone" in said


def test_without_an_outage_nothing_is_said_of_one(line: ab.Plan) -> None:
    found = ab.score(ab.fly(line, conditions="lab", seed=1), line)
    (said,) = (fact.words for fact in facts(found) if fact.label == "observer")
    assert "IMU" not in said


def test_commands_that_come_a_period_late_cost_nothing_where_the_model_is_right(line: ab.Plan) -> None:
    """The controller looks ahead by its own model, to set-points of when its commands take effect."""
    late = replace(ab.load_dispersion("none"), control_rate=500.0, computation_delay=0.002)
    errors = [ab.score(ab.fly(line, conditions=c), line).max_position_error_m for c in ("none", late)]
    assert errors[1] < errors[0] + 5e-4


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == "field" else n for n in ab.dispersion_names()]
)
def test_all_conditions_that_come_along_can_be_flown_in(name: str, line: ab.Plan) -> None:
    assert ab.score_flights(line, conditions=name, flights=3).is_finite.all()


def test_a_delay_of_part_of_a_period_is_flown_as_long_as_it_is(line: ab.Plan) -> None:
    """Without sensors too, whose ticks would tell; what fits no ticks is refused."""
    none = ab.load_dispersion("none")
    delays = (0.0, 0.003, 0.01)
    slow = [ab.fly(line, conditions=replace(none, control_rate=100.0, computation_delay=d)) for d in delays]
    assert len({flight.thrusts.tobytes() for flight in slow}) == len(delays)
    with pytest.raises(ab.SpecError, match=r"^computation_delay must be a whole number of ticks"):
        ab.fly(line, conditions=replace(LAB, computation_delay=0.0015))
    with pytest.raises(ab.SpecError, match=r"^computation_delay must be at most a period"):
        ab.fly(line, conditions=replace(LAB, computation_delay=0.003))
