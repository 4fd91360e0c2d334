"""Recoveries to a hover from instants of a path: announced, and kept."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.reporting.plain_data import plain, to_json
from aerobat.reporting.report import Report
from shared_plans import shared_plan

LOW = -0.15  # [m] a ground so near under the flip that there is a point of no return


@pytest.fixture(scope="module")
def flip() -> ab.Plan:
    return shared_plan("flip-roll")


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_any_instants_outside_the_span_of_no_return_all_reach_a_hover_above_the_ground(
    flip: ab.Plan, count: int
) -> None:
    announced = ab.recoveries(flip, ground=LOW)
    spans = announced.no_return
    assert spans
    assert all(1.0 < span.start < span.end < 1.9 for span in spans)  # on the way down
    assert f"but not from {spans[0].start:.2f} to {spans[0].end:.2f} s" in str(announced)
    instants = np.sort(np.random.default_rng(5).uniform(0.0, flip.duration, count))
    found = ab.recoveries(flip, times=instants, ground=LOW)
    outside = np.all([(instants <= span.start) | (instants >= span.end) for span in spans], axis=0)
    assert outside.sum() > 0.7 * count
    assert found.possible[outside].all()
    assert not found.possible.all()


@pytest.mark.parametrize(
    ("problem", "vehicle", "instants"),
    [
        ("line", "crazyflie", 100),
        pytest.param("half-flip", "section-v", 400, marks=pytest.mark.slow),
        pytest.param("power-loop", "hexarotor", 400, marks=pytest.mark.slow),
        pytest.param("split-s", "crazyflie", 400, marks=pytest.mark.slow),
    ],
)
def test_whoever_flies_whatever_any_instants_keep_what_is_announced(
    problem: str, vehicle: str, instants: int
) -> None:
    plan = shared_plan(problem, vehicle)
    announced = ab.recoveries(plan)
    assert announced.possible.all()
    assert announced.ground is None
    times = np.sort(np.random.default_rng(6).uniform(0.0, plan.duration, instants))
    found = ab.recoveries(plan, times=times)
    assert found.possible.all()
    # between the instants of the plan's own, up to 1/200 s away, a recovery takes another turn at times:
    # from one instant in a hundred where thrusts jump, without lag
    lags = ab.load_vehicle(vehicle).lags
    assert np.quantile(found.lowest, 0.0 if lags.any() else 0.02) > announced.lowest.min() - 0.3


def test_the_sentence_tells_the_instants_that_were_flown_and_the_time_to_notice(flip: ab.Plan) -> None:
    some = ab.recoveries(flip, times=[0.1, 0.2, 0.25], reaction=0.3)
    told = "given up at any of 3 instants, 100 ms apart at most, and noticed 0.3 s later, it hovers within "
    assert str(some).startswith(told)
    assert "given up at 0.10 s and noticed 0.1 s later" in str(ab.recoveries(flip, times=[0.1]))


def test_a_vehicle_that_flies_to_pieces_is_told_by_numbers_and_never_hovers(flip: ab.Plan) -> None:
    assert flip.vehicle is not None
    inertia = np.diag([*np.diag(flip.vehicle.inertia)[:2], 1e-300])
    found = ab.recoveries(flip, replace(flip.vehicle, inertia=inertia), times=[0.2, 0.5])
    assert not found.possible.any()
    assert np.isfinite(found.lowest).all()
    assert np.isinf(found.durations).all()


def test_the_instants_of_a_long_path_are_few_and_reach_from_its_start_to_its_end(
    flip: ab.Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aerobat.simulation.autopilot.recovery.MAX_INSTANTS", 20)
    found = ab.recoveries(flip)
    assert len(found.times) == 20
    assert (found.times[0], found.times[-1]) == (0.0, flip.duration)
    np.testing.assert_allclose(np.diff(found.times), flip.duration / 19)


def test_a_plan_keeps_its_recoveries_in_its_file_and_in_its_report(
    flip: ab.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weak = ab.recoveries(flip, times=[0.0, 1.4], ground=2.0)
    endless = replace(weak, durations=np.array([0.5, np.inf]))
    for found in (ab.recoveries(flip), endless):
        plan = replace(flip, recoveries=found)
        plan.save(tmp_path / "flip.plan")
        assert ab.load_plan(tmp_path / "flip.plan").recoveries == found
        told = plain(Report(plan))["plan"]["recoveries"]
        assert json.loads(to_json(told)) == told
        assert told["sentence"] == str(found)
    assert told["durations_s"] == [0.5, None]
    assert told["no_return_s"] == [[0.0, 1.4]]


def test_above_ground_it_is_told_how_near_to_it_a_recovery_comes(flip: ab.Plan) -> None:
    low = replace(flip.problem, environment=ab.Environment(ground=LOW))
    found = ab.recoveries(replace(flip, problem=low))
    assert found == ab.recoveries(flip, ground=LOW)
    assert "above the ground, but not from" in str(found)


def test_many_spans_of_no_return_are_told_in_short(flip: ab.Plan) -> None:
    times = np.arange(12.0)
    durations = np.where(times % 2 == 1, np.inf, 1.0)
    found = ab.Recoveries(times, np.zeros(12), np.zeros(12), durations, reaction=0.1, ground=None)
    assert str(found).endswith("but not from 6 spans between 0.00 and 11.00 s, 50 % of the instants")


def test_on_high_ground_and_without_delay_there_is_always_a_way_back(flip: ab.Plan) -> None:
    late, at_once = (ab.recoveries(flip, ground=-3.0, reaction=reaction) for reaction in (0.1, 0.0))
    for found in (late, at_once):
        assert found.no_return == ()
        assert found.possible.all()
        assert (found.height_lost >= 0.0).all()
        assert found.durations.max() < 3.0
    assert at_once.height_lost.max() < late.height_lost.max()


def test_a_hover_is_kept_at_once_and_loses_no_height(flip: ab.Plan) -> None:
    found = ab.recoveries(flip, times=[0.0, flip.duration], ground=-3.0)
    np.testing.assert_allclose(found.durations, 0.0)
    np.testing.assert_allclose(found.height_lost, 0.0, atol=0.01)


@pytest.mark.parametrize("drag", [(0.4, 0.4, 0.2), (0.45, 0.3, 0.1)])
def test_in_wind_a_vehicle_hovers_that_leans_against_its_drag(drag: tuple[float, float, float]) -> None:
    vehicle = replace(ab.load_vehicle("agile-quad"), drag_body=drag)
    windy = ab.Environment(wind=(6.0, 5.0, 0.0))  # [m/s] it leans by 20°
    at_rest = ab.Trajectory([1.0], np.zeros((1, 1, 3)))
    found = ab.recoveries(at_rest, vehicle, times=[0.0, 1.0], environment=windy, ground=-3.0)
    assert found.possible.all()
    assert found.durations.max() < 0.5


def test_where_the_ground_is_too_near_for_all_of_a_path_it_is_said(flip: ab.Plan) -> None:
    found = ab.recoveries(flip, times=[1.4, 1.5], ground=2.0)
    assert str(found) == "from no instant does it come back to a hover above the ground"
    (span,) = found.no_return
    assert (span.start, span.end) == (1.4, 1.5)


def test_an_instant_is_judged_the_same_whatever_flies_beside_it(flip: ab.Plan) -> None:
    together, alone = (ab.recoveries(flip, times=times, ground=-3.0) for times in ([0.3, 0.9, 1.5], [0.9]))
    assert together.lowest[1] == pytest.approx(alone.lowest[0], abs=1e-9)
    assert together.durations[1] == pytest.approx(alone.durations[0])


def test_times_outside_the_path_are_refused(flip: ab.Plan) -> None:
    with pytest.raises(ab.SpecError, match="must lie in"):
        ab.recoveries(flip, times=[5.0])
