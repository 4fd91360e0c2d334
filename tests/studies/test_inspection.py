"""Inspection: a planted cause is named first, parts add up to the error, axes and clocks do not matter."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import cli, so3
from aerobat.simulation.flight import SERIES
from shared_plans import shared_plan
from suites import examples

PLANS = (("flip-roll", "agile-quad"), ("half-flip", "hexarotor"))
SEEDS = (1, 2, 3)


def planned(number: int) -> ab.Plan:
    problem, vehicle = PLANS[number]
    return shared_plan(problem, vehicle, ab.Miqp(order=5))


def under(plan: ab.Plan, seed: int, **conditions: Any) -> ab.Flight:
    return ab.fly(plan, conditions=ab.Dispersion(**conditions), seed=seed)


def with_rotors(plan: ab.Plan, **factors: float) -> ab.Vehicle:
    assert plan.vehicle is not None
    changed = [
        replace(rotor, **{name: factor * getattr(rotor, name) for name, factor in factors.items()})
        for rotor in plan.vehicle.rotors
    ]
    return replace(plan.vehicle, rotors=tuple(changed))


def handed_over(plan: ab.Plan, seed: int) -> ab.Flight:
    lab = ab.load_dispersion("lab")
    assert lab.motion_capture is not None
    cameras = replace(lab.motion_capture, hand_off=ab.HandOff(translation=0.15))
    return under(plan, seed, imu=lab.imu, motion_capture=cameras, control_rate=500.0)


def with_slow_rotors(plan: ab.Plan, seed: int) -> ab.Flight:
    return ab.fly(plan, with_rotors(plan, lag=1.5 + 0.25 * seed), nominal=plan.vehicle)


def with_late_commands(plan: ab.Plan, seed: int) -> ab.Flight:
    """A flight of slow rotors, with the commands in its log that make rotors as planned for as late."""
    assert plan.vehicle is not None
    flight, lags = with_slow_rotors(plan, seed), plan.vehicle.lags
    led = flight.thrusts + lags * np.gradient(flight.thrusts, flight.times, axis=0)
    late = flight.times + (0.5 + 0.25 * seed) * lags.mean()
    commands = np.stack([np.interp(late, flight.times, each) for each in led.T], axis=1)
    return replace(flight, series={**flight.series, "commands": commands})


def with_an_empty_battery(plan: ab.Plan, seed: int) -> ab.Flight:
    return under(plan, seed, battery=ab.Battery(endurance=30.0, sag=0.45, charge_spread=0.9))


def with_its_battery_moved(plan: ab.Plan, seed: int) -> ab.Flight:
    """The centre of mass is 15 % of an arm off, to one side or another."""
    assert plan.vehicle is not None
    rotors = plan.vehicle.rotors
    off = 0.15 * np.hypot(*rotors[0].position_body[:2]) * np.array([np.cos(seed), np.sin(seed), 0.0])
    moved = tuple(replace(rotor, position_body=rotor.position_body - off) for rotor in rotors)
    return ab.fly(plan, replace(plan.vehicle, rotors=moved), nominal=plan.vehicle)


def with_more_inertia(plan: ab.Plan, seed: int) -> ab.Flight:
    assert plan.vehicle is not None
    heavy = replace(plan.vehicle, inertia=(1.25 + 0.25 * seed) * plan.vehicle.inertia)
    return ab.fly(plan, heavy, nominal=plan.vehicle)


def with_weak_gains(plan: ab.Plan, seed: int) -> ab.Flight:
    frequency = (12.0, 14.0, 16.0)[seed % 3]
    weak = ab.Controller(attitude_frequency=frequency, moment_feedforward=False)
    return ab.fly(plan, controller=weak)


PLANTED: dict[str, Callable[[ab.Plan, int], ab.Flight]] = {
    "start": lambda plan, seed: under(plan, seed, start_position=0.05),
    "vehicle": lambda plan, seed: under(plan, seed, mass=0.1),
    "hand-off": handed_over,
    "saturation": lambda plan, seed: ab.fly(plan, with_rotors(plan, max_thrust=0.55 + 0.05 * seed)),
    "delay": with_late_commands,
    "lag": with_slow_rotors,
    "thrust": with_an_empty_battery,
    "balance": with_its_battery_moved,
    "inertia": with_more_inertia,
    "gains": with_weak_gains,
}


@pytest.mark.parametrize(
    ("cause", "number", "seed"),
    [
        pytest.param(cause, number, seed, marks=() if (number, seed) == (0, 1) else pytest.mark.slow)
        for cause in PLANTED
        for number in range(len(PLANS))
        for seed in SEEDS
    ],
)
def test_a_planted_cause_is_named_first_and_explains_most_of_the_error(
    cause: str, number: int, seed: int
) -> None:
    plan = planned(number)
    found = ab.inspect_flight(PLANTED[cause](plan, seed), plan)
    assert found.cause == cause
    assert found.shares[0].error > 0.7 * found.largest
    # all parts add up: at every time, and along the largest error
    np.testing.assert_allclose(sum(found.errors.values()), found.error, atol=1e-4)
    assert sum(share.error for share in found.shares) == pytest.approx(found.largest, abs=1e-3)


def test_a_rotor_that_has_stopped_is_told_to_give_nothing_and_motor_and_propeller_to_be_looked_at() -> None:
    plan = planned(0)
    assert plan.vehicle is not None
    first, second, *others = plan.vehicle.rotors
    stopped = replace(plan.vehicle, rotors=(first, replace(second, min_thrust=0.0, max_thrust=0.0), *others))
    told = str(ab.inspect_flight(ab.fly(plan, stopped, nominal=plan.vehicle), plan))
    assert told.startswith("rotor 1 gives 0 N where ")
    assert "motor and propeller" in told


@cache
def by_rates() -> tuple[ab.Plan, ab.Flight]:
    plan = shared_plan("half-flip")
    return plan, ab.fly(plan, conditions="lab", flights=range(1), controller="rates")[0]


def changed_log(**series: np.ndarray) -> ab.Flight:
    flight = by_rates()[1]
    return replace(flight, series={**flight.series, **series})


def with_motors_swapped() -> ab.Flight:
    return changed_log(commands=by_rates()[1].commands[:, [0, 2, 1, 3]])


def with_half_the_rates() -> ab.Flight:
    return changed_log(rate_setpoint=2.0 * by_rates()[1].rate_setpoint)


def with_gains_for_more_inertia() -> ab.Flight:
    plan, _ = by_rates()
    assert plan.vehicle is not None
    heavy = replace(plan.vehicle, inertia=2.0 * plan.vehicle.inertia)
    return ab.fly(plan, plan.vehicle, nominal=heavy, controller="rates", rate=1000.0)


def with_twice_the_lag() -> ab.Flight:
    plan, _ = by_rates()
    return ab.fly(plan, with_rotors(plan, lag=2.0), nominal=plan.vehicle, controller="rates", rate=1000.0)


@pytest.mark.parametrize(
    ("cause", "flown", "evidence"),
    [
        ("motor order", with_motors_swapped, "rotor 1 obeys what rotor 2 should"),
        ("rates", with_half_the_rates, r"turns at 0\.5\d? of the rates asked"),
        ("rate gains", with_gains_for_more_inertia, r"gain is [23]\.\d times as large in roll"),
        ("lag", with_twice_the_lag, r"rotor \d takes 4[01] ms to follow, not 20 ms"),
    ],
)
def test_a_fault_of_the_inner_loop_is_named_by_its_log(
    cause: str, flown: Callable[[], ab.Flight], evidence: str
) -> None:
    found = ab.inspect_flight(flown(), by_rates()[0])
    assert found.fault is not None
    assert found.cause == found.fault.cause == cause
    assert re.search(evidence, found.fault.evidence)
    assert found.fault.evidence in f"{found.verdict} {' '.join(found.remarks)}"
    np.testing.assert_allclose(sum(found.errors.values()), found.error, atol=1e-4)


def test_a_flight_by_an_inner_loop_as_set_shows_no_fault_of_it() -> None:
    plan, flight = by_rates()
    assert ab.inspect_flight(flight, plan).fault is None
    assert ab.inspect_flight(ab.fly(plan, controller="rates"), plan).fault is None
    assert ab.inspect_flight(ab.fly(plan), plan).fault is None


def test_rotors_that_do_not_change_tell_no_lag() -> None:
    plan, flight = planned(0), ab.fly(planned(0))
    steady = np.broadcast_to(flight.thrusts.mean(axis=0), flight.thrusts.shape)
    still = replace(flight, series={**flight.series, "thrusts": steady, "commands": steady})
    assert ab.inspect_flight(still, plan).fault is None


@pytest.mark.parametrize("number", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_flight_without_causes_is_told_to_be_without(number: int) -> None:
    found = ab.inspect_flight(ab.fly(planned(number)), planned(number))
    assert found.cause is None
    assert found.verdict.startswith("nothing stands out")
    assert all(abs(share.error) < 1e-3 for share in found.shares)


@pytest.mark.parametrize(
    ("rate", "delay"),
    [
        (100.0, 0.004),
        *(pytest.param(*c, marks=pytest.mark.slow) for c in ((500.0, 0.002), (100.0, 0.01), (50.0, 0.02))),
    ],
)
def test_the_delay_of_commands_is_read_off_the_rotors(rate: float, delay: float) -> None:
    lab = ab.load_dispersion("lab")
    sensors: dict[str, Any] = {"imu": lab.imu, "motion_capture": lab.motion_capture}
    flight = under(planned(0), 1, computation_delay=delay, control_rate=rate, **sensors)
    assert ab.inspect_flight(flight, planned(0)).delay == pytest.approx(delay, abs=1e-3 + 0.05 / rate)


def moved(flight: ab.Flight, yaw: float, by: np.ndarray, later: float) -> ab.Flight:
    """The same flight in other axes, by another clock."""
    turn = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    series = dict(flight.series)
    for one in SERIES:
        if one.name in series and "body" not in one.name and one.shape == (3,):
            series[one.name] = so3.rotate(turn, series[one.name])
        if one.name.endswith("position") and one.name in series:
            series[one.name] = series[one.name] + by
        if one.name.endswith("q_world_body") and one.name in series:
            series[one.name] = so3.multiply(turn, series[one.name])
    series["ends"] = series["ends"] + later
    return replace(flight, times=flight.times + later, series=series)


@cache
def strayed(number: int) -> ab.Flight:
    return under(planned(number), 1, start_position=0.02, mass=0.05)


@cache
def strayed_as_found(number: int) -> ab.Inspection:
    return ab.inspect_flight(strayed(number), planned(number))


@examples(10)
@given(
    number=st.integers(0, 1),
    yaw=st.floats(-3.0, 3.0),
    by=st.tuples(*[st.floats(-20.0, 20.0)] * 3),
    later=st.floats(-5.0, 5.0),
)
def test_other_axes_and_another_clock_change_no_share(
    number: int, yaw: float, by: tuple[float, float, float], later: float
) -> None:
    flight, plan = strayed(number), planned(number)
    there = ab.inspect_flight(moved(flight, yaw, np.array(by), later), plan)
    here = strayed_as_found(number)
    for name, errors in here.errors.items():
        sizes = [np.linalg.norm(series, axis=1) for series in (errors, there.errors[name])]
        np.testing.assert_allclose(*sizes, atol=1e-6)
    assert there.alignment.time_shift == pytest.approx(later, abs=1e-3)
    assert there.alignment.misfit < 1e-3


def test_what_cannot_be_inspected_is_refused_in_a_sentence() -> None:
    plan = planned(0)
    flight = ab.fly(plan)
    with pytest.raises(ab.SpecError, match=r"its path lies .* give the flight's own plan"):
        ab.inspect_flight(flight, planned(1), plan.vehicle)
    with pytest.raises(ab.SpecError, match="hexarotor has 6 rotors and the flight 4"):
        ab.inspect_flight(flight, plan, "hexarotor")
    with pytest.raises(ab.SpecError, match=r"inspect flight\[k\]"):
        ab.inspect_flight(ab.fly(plan, conditions="lab", flights=2), plan)
    rows = slice(0, 5)
    short = {one.name: flight.series[one.name] for one in flight.kinds}
    short = {one.name: short[one.name][rows] if one.over_time else short[one.name] for one in flight.kinds}
    with pytest.raises(ab.SpecError, match="it has 5 rows; a log needs at least 10"):
        ab.inspect_flight(replace(flight, times=flight.times[rows], series=short), plan)


def test_a_logs_silence_about_the_observer_is_said_and_gone_where_it_speaks() -> None:
    plan = planned(0)
    silent = ab.inspect_flight(ab.fly(plan), plan)
    assert any("does not hold what an observer saw" in remark for remark in silent.remarks)
    assert ab.inspect_flight(handed_over(plan, 1), plan).remarks == ()


def test_the_command_says_draws_and_prints_what_the_function_finds(tmp_path: Path, capsys) -> None:
    plan = planned(0)
    flight = PLANTED["start"](plan, 1)
    plan.save(tmp_path / "flip.plan")
    flight.save(tmp_path / "flight.npz")
    found = ab.inspect_flight(flight, plan)
    cli.main(["inspect", str(tmp_path)])
    assert found.verdict in " ".join(capsys.readouterr().out.split())
    assert (tmp_path / "inspect.png").read_bytes().startswith(b"\x89PNG")
    file, figure = str(tmp_path / "flight.npz"), str(tmp_path / "other.png")
    cli.main(["inspect", file, "--plan", str(tmp_path / "flip.plan"), "--figure", figure, "--json"])
    record = json.loads(capsys.readouterr().out)
    assert record["verdict"] == found.verdict
    assert [share["cause"] for share in record["shares"]] == [share.cause for share in found.shares]
    assert (tmp_path / "other.png").exists()


def test_the_figure_draws_each_cause_and_the_main_one_in_red() -> None:
    found = ab.inspect_flight(PLANTED["start"](planned(0), 1), planned(0))
    figure = ab.inspection_figure(found)
    whole, *parts = figure.axes
    np.testing.assert_allclose(whole.lines[0].get_ydata(), 100.0 * np.linalg.norm(found.error, axis=1))
    drawn = [axes.lines[0].get_ydata() for axes in parts]
    np.testing.assert_allclose(sum(drawn), 100.0 * found.error @ found.direction, atol=0.01)
    colours = [axes.lines[0].get_color() for axes in parts]
    assert colours.count(colours[0]) == 1


def test_a_log_without_what_an_observer_saw_does_not_tell_that_from_a_delay() -> None:
    found = ab.inspect_flight(PLANTED["delay"](planned(0), 1), planned(0))
    assert found.cause == "delay"
    assert ("observer" in found.verdict) is not found.observed
    assert "observer" in replace(found, observed=False).verdict
    assert "observer" not in replace(found, observed=True).verdict
