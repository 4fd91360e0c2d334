"""A verdict is well only where enough flights under random conditions are proven to succeed."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import aerobat as ab
from aerobat.cli.runs.folder import trial_flights
from aerobat.cli.runs.record import FlightSettings, RunRecord
from aerobat.environment import load_dispersion
from aerobat.planning.tube import Tube
from aerobat.reporting.facts import REPORT
from aerobat.reporting.plain_data import to_json
from aerobat.reporting.report import Report
from aerobat.reporting.tables import print_table, table
from aerobat.simulation import Outcome
from aerobat.studies.share import Trials
from aerobat.studies.sweep import Share
from shared_plans import shared_flight, shared_plan

LAB = load_dispersion("lab")


def report(share: Share) -> Report:
    plan = shared_plan("line")
    return Report(plan, ab.score(shared_flight("line"), plan), trials=Trials(LAB, 0, share))


@pytest.mark.parametrize("share", [Share(96, 100), Share(771, 800)])
def test_more_than_needed_of_those_flown_may_prove_too_little(share: Share, capsys) -> None:
    """A plan of which 93 % of all flights succeed shows 95 of 100 three times in ten."""
    found = report(share)
    assert share.fraction > Trials.NEEDED
    assert not found.is_well
    assert json.loads(to_json(found))["trials"]["proven"] is False
    print_table(table(found, most=REPORT))
    shown = " ".join(capsys.readouterr().out.split())
    assert "certified, but not proven to succeed often enough under 'lab' conditions" in shown
    assert f"lab: {share.count} of {share.of} flights succeed, so {share.range} of all" in shown
    assert "plan for more with --pass 0.95" in shown


def test_what_became_of_flights_that_fail_is_told(capsys) -> None:
    failures = (*[Outcome.WRONG_ATTITUDE] * 30, *[Outcome.HIT_FRAME] * 7)
    found = replace(report(Share(63, 100)), trials=Trials(LAB, 0, Share(63, 100), failures))
    print_table(table(found, most=REPORT))
    shown = " ".join(capsys.readouterr().out.split())
    assert "95 % confidence; the others: 30 wrong attitude, 7 hit frame; plan for more with" in shown


def test_a_search_is_told_only_of_plans_that_were_searched_for(capsys) -> None:
    plan = shared_plan("line")
    given = ab.Plan(problem=plan.problem, trajectory=plan.trajectory, planner="file", status="as it is")
    for each, is_told in ((plan, True), (given.for_vehicle(ab.load_vehicle("agile-quad")), False)):
        print_table(table(Report(each)))
        shown = " ".join(capsys.readouterr().out.split())
        assert ("after" in shown and "attempts" in shown and "solved in" in shown) == is_told
        assert json.loads(to_json(Report(each)))["plan"]["nodes"] == each.nodes


def test_a_verdict_is_well_where_enough_are_proven_to_succeed(capsys) -> None:
    found = report(Share(784, 800))
    assert found.is_well
    print_table(table(found, most=REPORT))
    shown = " ".join(capsys.readouterr().out.split())
    assert "certified, and it flies" in shown
    assert "--pass" not in shown


def test_one_flight_in_physics_of_others_says_nothing_of_undisturbed_flights(capsys) -> None:
    """It may have met wind."""
    plan = shared_plan("line")
    found = Report(plan, ab.score(shared_flight("line"), plan), plant="mujoco")
    print_table(table(found, most=REPORT))
    assert "certified, and this flight succeeds" in " ".join(capsys.readouterr().out.split())


def test_a_plan_that_leaves_little_to_the_controller_is_told_what_leaves_enough(capsys) -> None:
    """A reserve of 0.1, which is less than plans keep by default, was advised."""
    print_table(table(Report(shared_plan("line", "agile-quad", ab.Miqp())), most=REPORT))
    shown = " ".join(capsys.readouterr().out.split())
    assert "for a real flight; try --pass 0.95" in shown
    assert "--reserve 0.1" not in shown


def test_flights_that_proved_a_plan_count_for_its_verdict() -> None:
    """Those of --pass are fresh and enough: others that leave it open are not flown."""
    plan = shared_plan("line")
    tube = Tube(
        conditions="lab",
        seed=7,
        level=0.95,
        times=(0.0,),
        position_error=(0.0,),
        attitude_error=(0.0,),
        rotor_margin=(0.1,),
        reserve=0.2,
        plain_duration=1.0,
        probability=0.95,
        passed=390,
        flights=400,
        lower_bound=0.955,
    )
    settings = FlightSettings(conditions=LAB, seed=7, probability=0.95)
    assert plan.vehicle is not None
    record = RunRecord(command="fly", problem=plan.problem, vehicle=plan.vehicle, flight=settings)
    found = trial_flights(replace(plan, tube=tube), record)
    assert found == Trials(LAB, 7, Share(390, 400))
    assert found.proven
