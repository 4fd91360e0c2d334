"""Gains that are found: no worse where sought, judged where they were not, kept with the vehicle."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.control import Controller, named_controller
from aerobat.studies.tune import MAX_FACTOR, TUNED
from shared_plans import GENTLE, shared_plan

WEAK = ab.Dispersion(name="weak", mass=0.03, rotor=0.03, lag=0.1, start_position=0.02, start_velocity=0.02)
FLIGHTS = 20
HALVED = replace(Controller(), **{name: 0.5 * getattr(Controller(), name) for name in TUNED})


@cache
def half_flip() -> ab.Plan:
    return ab.plan(GENTLE, ab.Miqp(order=4, reserve=0.15), "agile-quad")


@cache
def detuned() -> ab.Vehicle:
    return replace(ab.load_vehicle("agile-quad"), controller=HALVED)


@cache
def found() -> ab.Tuning:
    """Gains found for a vehicle whose own were halved."""
    return ab.tune(half_flip(), WEAK, FLIGHTS, vehicle=detuned(), evaluations=64)


@pytest.mark.slow
def test_gains_that_were_halved_are_brought_back_to_what_the_usual_ones_give() -> None:
    usual = ab.tune(half_flip(), WEAK, FLIGHTS, evaluations=1).fresh[0]
    before, after = found().fresh
    assert before.cost > 1.5 * usual.cost  # else there is nothing to bring back
    assert after.cost < usual.cost
    assert found().is_better


@pytest.mark.parametrize("evaluations", [1, 3, pytest.param(8, marks=pytest.mark.slow)])
def test_no_search_is_worse_than_the_start_on_its_own_flights(evaluations: int) -> None:
    tuning = ab.tune(half_flip(), WEAK, FLIGHTS, vehicle=detuned(), evaluations=evaluations)
    before, after = tuning.training
    assert after.cost <= before.cost
    assert tuning.evaluations == evaluations


def test_a_seed_gives_the_same_gains_to_the_last_bit() -> None:
    first, again, other = (
        ab.tune(half_flip(), WEAK, FLIGHTS, seed, vehicle=detuned(), evaluations=5) for seed in (3, 3, 4)
    )
    assert first == again
    assert first.training[0] != other.training[0]


@pytest.mark.slow
def test_gains_are_judged_on_flights_that_the_search_has_not_flown() -> None:
    tuning = found()
    for trial, controller in zip(tuning.fresh, (HALVED, tuning.controller), strict=True):
        flown = ab.score_flights(
            half_flip(),
            detuned(),
            conditions=WEAK,
            seed=0,
            flights=range(FLIGHTS, 2 * FLIGHTS),
            controller=controller,
        )
        np.testing.assert_array_equal(trial.max_position_error_m[0], flown.max_position_error_m)
    assert not np.isin(tuning.fresh[0].max_position_error_m, tuning.training[0].max_position_error_m).any()


def test_gains_stay_within_their_factor_and_others_as_they_are() -> None:
    tuning = ab.tune(
        half_flip(), WEAK, FLIGHTS, vehicle=detuned(), gains=["attitude_frequency"], evaluations=10
    )
    ratio = tuning.controller.attitude_frequency / HALVED.attitude_frequency
    assert 1.0 < ratio <= MAX_FACTOR
    assert replace(tuning.controller, attitude_frequency=HALVED.attitude_frequency) == HALVED


def test_gains_that_are_not_shown_to_be_better_are_not_to_be_had() -> None:
    tuning = ab.tune(half_flip(), WEAK, FLIGHTS, evaluations=1)
    assert tuning.interval == (0.0, 0.0)
    assert not tuning.is_better
    with pytest.raises(ab.SpecError, match=r"^the gains of 'agile-quad' stay as they are: .* no better"):
        tuning.tuned_vehicle  # noqa: B018 - it raises


def test_a_lost_flight_weighs_more_than_any_error() -> None:
    """A hundredth of flights lost costs 5 cm, however small the others' errors are."""
    few = replace(
        found().training[0], max_position_error_m=np.full((1, 100), 0.01), failed=np.zeros((1, 100))
    )
    one_lost = replace(few, failed=np.eye(1, 100))
    assert one_lost.cost - few.cost == pytest.approx(0.05)


@pytest.mark.slow
def test_several_plans_count_alike() -> None:
    line = shared_plan("line", "agile-quad", ab.Miqp(order=4, reserve=0.1))
    both, *each = (
        ab.tune(plans, WEAK, FLIGHTS, vehicle=detuned(), evaluations=1).training[0].cost
        for plans in ([half_flip(), line], half_flip(), line)
    )
    assert both == pytest.approx(np.mean(each))


def test_a_search_ends_with_its_time_and_tells_what_it_tried() -> None:
    told: list[tuple[int, float]] = []
    tuning = ab.tune(
        half_flip(),
        WEAK,
        FLIGHTS,
        vehicle=detuned(),
        time_limit=0.0,
        progress=lambda tried, cost: told.append((tried, cost)),
    )
    assert told == [(1, tuning.training[1].cost)]
    assert tuning.controller == HALVED


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"gains": ["position_gian"]}, "no gain named 'position_gian'; did you mean 'position_gain'"),
        ({"gains": []}, "gains must be one or more of position_gain"),
        ({"plan": []}, "plan must be one plan or more"),
        ({"flights": 1}, "tune: flights must be"),
        ({"conditions": "lba"}, "no conditions named 'lba'; did you mean 'lab'"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(changes: dict[str, object], complaint: str) -> None:
    arguments: dict[str, object] = {"plan": half_flip(), "conditions": WEAK} | changes
    with pytest.raises(ab.SpecError, match=f"^{complaint}"):
        ab.tune(**arguments)  # type: ignore[arg-type]


def test_a_gain_of_zero_and_plans_of_two_vehicles_are_refused() -> None:
    still = replace(detuned(), controller=replace(HALVED, integral_gain=0.0))
    with pytest.raises(ab.SpecError, match=r"^gains: integral_gain is 0, which no factor changes"):
        ab.tune(half_flip(), WEAK, vehicle=still)
    other = replace(half_flip(), vehicle=detuned())
    with pytest.raises(ab.SpecError, match=r"^plan: the plans are of several vehicles"):
        ab.tune([half_flip(), other], WEAK)


def test_tuned_gains_are_kept_in_the_vehicles_file(tmp_path: Path) -> None:
    tuned = found().tuned_vehicle
    ab.write_vehicle(tuned, tmp_path / "tuned.toml")
    again = ab.load_vehicle(tmp_path / "tuned.toml")
    assert again == tuned
    assert again.controller == found().controller
    assert replace(again, controller=Controller()) == ab.load_vehicle("agile-quad")


def test_a_vehicle_is_flown_by_its_own_controller_unless_another_is_named() -> None:
    own, named = ab.fly(half_flip(), detuned()), ab.fly(half_flip(), controller=HALVED)
    usual = ab.fly(half_flip(), detuned(), controller=Controller())
    assert np.array_equal(own.states.position, named.states.position)
    assert np.array_equal(usual.states.position, ab.fly(half_flip()).states.position)
    assert not np.array_equal(own.states.position, usual.states.position)


def test_a_plans_own_flight_is_by_its_vehicles_controller() -> None:
    plan = ab.plan("half-flip", ab.Miqp(order=4, reserve=0.1), detuned())
    assert plan.flyability is not None
    assert half_flip().flyability is not None
    flown = float(ab.fly(plan, controller=HALVED).position_error.max())
    assert plan.flyability.error == flown > half_flip().flyability.error


def test_vehicles_of_different_controllers_do_not_fly_together_without_a_word() -> None:
    fleet = ["agile-quad", detuned()]
    with pytest.raises(ab.SpecError, match=r"^controller: these vehicles have different ones"):
        ab.fly(half_flip(), fleet)
    assert len(ab.score_flights(half_flip(), fleet, controller=Controller())) == 2


def test_control_laws_keep_a_vehicles_gains() -> None:
    assert named_controller("full", HALVED) == HALVED
    paper = named_controller("paper", HALVED)
    assert paper.feature_flags == Controller.paper().feature_flags
    assert paper.gains(np.inf) == HALVED.gains(np.inf)


def test_a_controller_in_a_file_is_checked_as_every_field(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    ab.write_vehicle("agile-quad", path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text + "\n[controller]\nposition_gian = 3.0\n", encoding="utf-8")
    with pytest.raises(ab.SpecError, match=r"mine.toml: controller.position_gian .*position_gain"):
        ab.load_vehicle(path)


def test_a_sweep_is_flown_by_its_vehicles_controller() -> None:
    own = ab.sweep(half_flip(), WEAK, 3, vehicle=detuned(), workers=1)
    named = ab.sweep(half_flip(), WEAK, 3, controller=HALVED, workers=1)
    for name, column in named.table.items():
        np.testing.assert_array_equal(own.table[name], column)
