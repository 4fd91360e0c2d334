"""Plan, fly, tighten: what is proven, on which flights, and what it costs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.planning.result import FLYING_RESERVE
from aerobat.studies.passing import Passing, Round
from aerobat.studies.passing import passing as proving
from aerobat.studies.passing.causes import main_failure_cause
from aerobat.studies.passing.spread import with_more_thrust
from aerobat.studies.passing.steadying import steadier
from aerobat.studies.passing.task import FlownPlan, PassingTask
from aerobat.studies.passing.tightening import Tightening
from aerobat.studies.share import Share

WEAK = ab.Dispersion(name="weak", mass=0.05, rotor=0.04, start_position=0.02)
HARSH = ab.Dispersion(name="harsh", start_velocity=30.0, mass=1e-4)
FEW = {"flights": 60, "fresh": 80, "seed": 3, "workers": 1}
PLANNER = ab.Miqp(reserve=0.1, flies=False)


def sought(probability: float) -> Passing:
    return ab.plan_to_pass(
        "flip-roll", PLANNER, "agile-quad", probability=probability, conditions=WEAK, **FEW
    )


passing = cache(sought)


@pytest.mark.parametrize("probability", [0.25, pytest.param(0.9, marks=pytest.mark.slow)])
def test_what_is_proven_was_learned_from_other_flights_and_holds_when_flown_again(probability: float):
    found = passing(probability)
    assert found.fresh.start >= FEW["flights"]
    assert all(trial.share.of == FEW["flights"] for trial in found.rounds)
    again = ab.score_flights(found.plan, conditions=WEAK, seed=3, flights=found.fresh)
    assert sum(outcome.is_success for outcome in again.outcomes) == found.after.count
    assert found.after.interval[0] >= probability
    assert (found.tube.passed, found.tube.flights) == (found.after.count, found.after.of)
    assert probability < found.after.fraction
    assert found.price == found.tube.price(found.plan.duration)
    assert (found.price == 0.0) == (probability == 0.25)  # which is met already


@pytest.mark.slow
@pytest.mark.parametrize("most", [0.25, 0.9])
def test_more_probability_never_gives_a_shorter_plan(most: float):
    durations = [passing(probability).plan.duration for probability in sorted({0.01, 0.25, most})]
    assert durations == sorted(durations)


def test_a_probability_that_is_met_already_costs_nothing():
    found = passing(0.01)
    assert (
        found.plan.trajectory
        == found.plain.trajectory
        == ab.plan("flip-roll", PLANNER, "agile-quad").trajectory
    )
    assert found.price == 0.0
    assert len(found.rounds) == 1


class Imagined(PassingTask):
    """Plans keep as much reserve as there is room for; as much as is needed lets all flights succeed."""

    need: float
    room: float

    def tightened(
        self, first: FlownPlan, start: FlownPlan, tightening: Tightening, required: ab.Problem
    ) -> Any:
        if tightening.reserve > self.room + 1e-9:
            raise ab.Infeasible("there is no room", [])
        reserve, rate = tightening.reserve, tightening.rate
        return SimpleNamespace(
            duration=1.0 + reserve + (1.0 - rate), certified=True, flies=True, keeps=reserve
        )

    def selecting(self, found: Any) -> Any:
        share = min(1.0, 0.5 + 0.5 * found.keeps / self.need) if self.need else 1.0
        return SimpleNamespace(succeeded=np.arange(200) < 200 * share, passages=(), attitudes=())


def imagined(need: float, room: float) -> Imagined:
    """Return a task of a figure without gates."""
    task = object.__new__(Imagined)
    values = {
        "rounds": [],
        "need": need,
        "room": room,
        "probability": 0.95,
        "proving": 1000,
        "vehicle": ab.load_vehicle("agile-quad"),
        "problem": ab.load_problem("power-loop"),
    }
    for name, value in values.items():
        object.__setattr__(task, name, value)
    return task


@given(need=st.integers(0, 20), room=st.integers(0, 20))
def test_hardly_more_reserve_than_needed_is_kept_wherever_plans_end(need: int, room: int):
    """Without a plan above some reserve, a smaller one that is enough is found all the same."""
    task = imagined(0.02 * need, 0.02 * room)
    plain = SimpleNamespace(duration=1.0, keeps=0.0)
    first = FlownPlan(plain, task.selecting(plain), 0.15, task.problem)
    found = steadier(task, first, first, 30, 0.05)
    assert found.tightening.reserve <= min(0.02 * need + 0.1, 0.02 * room) + 1e-9
    if need + 5 <= room:
        assert task.suffices(found.share)


@pytest.mark.slow
def test_a_dead_rotor_has_no_part_in_the_tube():
    """Its range is nothing, of which no margin is a part."""
    hexarotor = ab.load_vehicle("hexarotor")
    spins = (1, 1, -1, -1, 1, -1)  # with which any one rotor may fail
    rotors = [replace(rotor, spin=spin) for rotor, spin in zip(hexarotor.rotors, spins, strict=True)]
    rotors[0] = replace(rotors[0], min_thrust=0.0, max_thrust=0.0)
    failed = replace(hexarotor, rotors=tuple(rotors))
    found = ab.plan_to_pass("line", PLANNER, failed, probability=0.25, conditions=WEAK, **FEW)
    assert found.plan.vehicle == found.plain.vehicle == failed.without_dead_rotors()
    assert np.isfinite(found.tube.rotor_margin).all()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_plan_and_tube():
    again = sought(0.25)
    assert again.plan.trajectory == passing(0.25).plan.trajectory
    assert again.tube == passing(0.25).tube


@pytest.mark.parametrize("probability", [0.25, pytest.param(0.9, marks=pytest.mark.slow)])
def test_the_plan_that_passes_is_judged_by_the_gates_of_its_problem(probability: float):
    found = passing(probability)
    assert found.plan.problem == ab.load_problem("flip-roll")
    assert found.plan.certified == found.plain.certified


def test_a_saved_plan_carries_its_tube(tmp_path):
    found = passing(0.25).plan
    found.save(tmp_path / "flip.plan")
    assert ab.load_plan(tmp_path / "flip.plan").tube == found.tube


def test_a_plan_that_only_the_flights_it_is_judged_by_pass_is_tightened(monkeypatch: pytest.MonkeyPatch):
    """Its proof fails on fresh flights; the next plan goes on from it, and is proven on others."""
    task = imagined(0.0, 1.0)
    started: list[float] = []

    def steadier(task: Imagined, first: FlownPlan, start: FlownPlan, tries: int, price: float) -> FlownPlan:
        started.append(start.share.fraction)
        return start if start.share.fraction == 1.0 else replace(start, plan="tightened", scores=all_pass)

    all_pass, none = (SimpleNamespace(succeeded=np.full(10, passes)) for passes in (True, False))
    plain = SimpleNamespace(keeps=lambda reserve: True)
    monkeypatch.setattr(proving, "steadier", steadier)
    monkeypatch.setattr(proving, "plan", lambda *asked: plain)
    changed = {"planner": SimpleNamespace(reserve=0.15), "flights": range(4), "proving": 10, "progress": None}
    changed["scores"] = lambda found, flights: all_pass if found == "tightened" else none
    changed["selecting"] = lambda found: all_pass
    changed["is_proof"] = lambda share: share.fraction == 1.0
    for name, value in changed.items():
        object.__setattr__(task, name, value)
    monkeypatch.setattr(proving, "_with_proof", lambda task, first, best, share, fresh: (best.plan, fresh))
    assert proving.proven(task) == ("tightened", range(14, 24))
    assert started == [1.0, 0.0]


@pytest.mark.slow
def test_a_power_loop_is_proven_by_the_plan_that_commands_take():
    """A freestyle quadrotor's was refused after a minute, though one of 14 % more time passes."""
    lagging = ab.load_vehicle("agilicious")
    lagging = replace(lagging, rotors=tuple(replace(rotor, lag=0.05) for rotor in lagging.rotors))
    found = ab.plan_to_pass(
        "power-loop", ab.Miqp(reserve=FLYING_RESERVE), lagging, probability=0.95, workers=1
    )
    assert found.before.fraction < 0.9
    assert found.price < 0.2 * found.plain.duration


@pytest.mark.slow
def test_where_rotors_lag_otherwise_than_known_turning_slower_costs_less_than_any_reserve():
    """At half more or less than a lag of 72 ms, 840°/s is 30° late; two thirds of that are as fast."""
    found = ab.plan_to_pass(
        "flip-pitch",
        ab.Miqp(reserve=0.15),
        "crazyflie",
        probability=0.9,
        conditions=ab.Dispersion(name="lags", lag=0.5),
        flights=200,
        fresh=300,
        workers=1,
    )
    assert found.before.fraction < 0.9
    assert found.plan.assessment.max_body_rate < 0.7 * found.plain.assessment.max_body_rate
    assert found.price < 0.03 * found.plain.duration
    assert found.plan.vehicle == ab.load_vehicle("crazyflie")


@pytest.mark.slow
def test_what_cannot_be_reached_names_the_cause_in_the_way(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(proving, "TRIES", 3)
    rounds: list[Round] = []
    with pytest.raises(ab.Infeasible, match=r"the start stands in the way: without it .* pass") as refused:
        ab.plan_to_pass(
            "flip-roll",
            ab.Miqp(order=4, reserve=0.26, rescue=False),
            "agile-quad",
            probability=0.9,
            conditions=HARSH,
            tried=rounds.append,
            **FEW,
        )
    assert "harsh" in str(refused.value)
    assert rounds[0].reserve == 0.26
    assert all(0.26 <= trial.reserve < 0.5 for trial in rounds[1:])


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"planner": "min-snap"}, "planner keeps no reserve"),
        ({"probability": 0.99, "flights": 300}, "flights: 300 flights cannot prove 99 %; take 368"),
        ({"probability": 0.99, "fresh": 300}, "fresh: 300 flights cannot prove 99 %; take 368"),
        ({"probability": 0.9999999}, "flights: 100000 flights cannot prove 99.99999 %; take 36888793"),
    ],
)
def test_what_can_prove_nothing_is_refused(settings, named):
    with pytest.raises(ab.SpecError, match=named):
        ab.plan_to_pass("line", **settings)


@pytest.mark.parametrize("flights", [10**15, range(5, 10**15), range(10**15, 0, -1)])
def test_more_flights_than_can_be_flown_are_refused_at_once(flights):
    with pytest.raises(ab.SpecError, match="flights must be 10000000 flights at most"):
        ab.FlightConfig(conditions=WEAK, flights=flights)


@pytest.mark.parametrize("name", ["half-flip", "flip-roll"])
def test_more_thrust_in_a_gate_is_asked_of_the_stage_there_alone(name):
    problem = ab.load_problem(name)
    firm = problem.maneuver.with_stage_thrust(problem.gates, 17.0)
    before, after = (each.stage_sequence(problem.gates, 40.0).stages for each in (problem.maneuver, firm))
    changed = [b.name for a, b in zip(before, after, strict=True) if a != b]
    assert changed == ["gate"]


@pytest.mark.slow
def test_figures_whose_flights_stray_off_their_attitudes_are_asked_for_more_thrust_in_their_stages():
    problem, vehicle = ab.load_problem("immelmann"), ab.load_vehicle("agile-quad")
    loose = replace(problem, maneuver=problem.maneuver.with_stage_thrust((), 7.0))
    plan = ab.plan(loose, ab.Miqp(reserve=0.15), vehicle)
    strays = ab.score_flights(plan, vehicle, config=ab.FlightConfig(conditions="lab", flights=range(20)))
    firm = with_more_thrust(loose, vehicle, plan, strays, 0.97)
    assert firm.maneuver.min_thrust > 7.0
    assert firm.maneuver.min_thrust <= 0.75 * vehicle.max_specific_thrust


@pytest.mark.parametrize("name", ab.dispersion_names())
def test_without_any_one_cause_conditions_can_still_be_flown_in(name: str) -> None:
    """Without a control rate of its own a controller has a shorter period, and no longer delay."""
    tried: list[ab.Dispersion] = []

    def share(conditions: ab.Dispersion) -> Share:
        tried.append(conditions)
        return Share(0, 1)

    main_failure_cause(ab.load_dispersion(name), 0.95, share)
    plan = ab.plan("line", ab.MinSnap(), "agile-quad")
    for conditions in tried:
        ab.prepare(plan, conditions=conditions)
