"""Nothing is advised that was not tried, and what is advised does plan."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.errors import Reason
from aerobat.planning import registered_planners
from aerobat.studies.why import Request, explained, remedies
from aerobat.studies.why.changes import changes
from shared_plans import shared_plan

QUAD = ab.load_vehicle("agile-quad")
LINE = replace(ab.load_problem("line"), gates=(ab.tilted_gate((5.0, 0.0, 0.0)),))
SLOW = replace(LINE, limits=ab.Limits(velocity=0.6))  # [m/s], slower than a gate is passed
WITHOUT_LIMIT, WITHOUT_RATE = "without limits.velocity", "without max_body_rate"


@pytest.mark.slow
def test_a_limit_that_binds_is_named_and_the_problem_is_planned_without_it_alone() -> None:
    tried: list[tuple[str, bool]] = []
    found = ab.why(SLOW, vehicle=QUAD, progress=lambda *change: tried.append(change))
    (remedy,) = found.remedies
    assert found.limits == ("limits.velocity",)
    assert remedy.changes == (WITHOUT_LIMIT,)
    assert tuple(words for words, _ in tried) == found.tried
    assert [words for words, helps in tried if helps] == [WITHOUT_LIMIT]
    assert remedy.plan.problem.limits == ab.Limits()
    assert remedy.plan.certified
    assert remedy.plan.flies
    again = ab.plan(remedy.plan.problem, vehicle=remedy.plan.vehicle)
    assert again.duration == remedy.plan.duration
    assert str(found).endswith(f"'line' is planned {WITHOUT_LIMIT} (by miqp in {again.duration:.3f} s)")


def test_every_limit_of_problem_and_vehicle_is_a_change_to_be_tried() -> None:
    limits = ab.Limits(
        lower=[-9, -9, -9], velocity=9.0, acceleration=9.0, jerk=9.0, snap=9.0, crackle=9.0, max_tilt=1.0
    )
    late = ab.GatePassage(at=0.5, speed=1.0)
    problem = replace(ab.load_problem("half-flip"), limits=limits, maneuver=ab.HalfFlip(passage=late))
    problem = replace(problem, environment=ab.Environment(ground=-3.0))
    idle = replace(QUAD, rotors=tuple(replace(rotor, min_thrust=0.1) for rotor in QUAD.rotors))
    task = Request(problem, idle, ab.Miqp(reserve=0.1))
    found = list(changes(task))
    for change in found:
        changed = change.apply(task)
        assert (changed.problem, changed.vehicle, changed.planner) != (problem, idle, task.planner)
    assert len({change.words for change in found}) == len(found) == 15


def test_a_problem_that_has_a_plan_needs_no_change() -> None:
    found = ab.why("line", vehicle=QUAD)
    assert (found.refusal, found.tried) == ("", ())
    assert [remedy.changes for remedy in found.remedies] == [()]


def test_without_a_vehicle_limits_are_what_may_change() -> None:
    found = ab.why(replace(LINE, limits=ab.Limits(velocity=0.1)))
    assert found.tried == (WITHOUT_LIMIT,)
    assert [remedy.changes for remedy in found.remedies] == [(WITHOUT_LIMIT,)]


class Pretending:
    """Stands for plan(): has one where a problem is changed as it says, and takes note of who was asked."""

    def __init__(self, *needed: str) -> None:
        self.needed = needed
        self.asked: list[ab.Planner] = []

    def __call__(self, problem: ab.Problem, planner: Any, vehicle: ab.Vehicle) -> ab.Plan:
        self.asked.append(planner)
        changed = {
            WITHOUT_LIMIT: bool(np.isinf(problem.limits.velocity).all()),
            WITHOUT_RATE: vehicle.max_body_rate == np.inf,
        }
        if all(changed.get(words, False) for words in self.needed):
            return shared_plan("line")
        raise ab.Infeasible(Reason("it turns too fast", ("max_body_rate",)), ["one attempt"])


def test_where_no_change_is_enough_alone_the_fewest_together_are_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(remedies, "plan", Pretending(WITHOUT_LIMIT, WITHOUT_RATE))
    found = ab.why("line", vehicle=QUAD)
    assert [remedy.changes for remedy in found.remedies] == [(WITHOUT_LIMIT, WITHOUT_RATE)]
    assert len(found.tried) > 2
    assert f"{WITHOUT_LIMIT} and {WITHOUT_RATE} (by " in found.advice


def test_where_nothing_helps_all_that_was_tried_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(remedies, "plan", Pretending("a miracle"))
    found = ab.why("line", vehicle=QUAD)
    assert found.remedies == ()
    assert found.limits == ("max_body_rate",)
    assert all(words in found.advice for words in found.tried)
    assert found.advice.endswith("nor with all of that together")


def test_every_registered_planner_is_asked_and_keeps_the_reserve(monkeypatch: pytest.MonkeyPatch) -> None:
    pretending = Pretending("a miracle")
    monkeypatch.setattr(remedies, "plan", pretending)
    ab.why("line", ab.MinSnap(), QUAD)
    assert {type(planner) for planner in pretending.asked} >= set(registered_planners().values())
    pretending.asked.clear()
    ab.why("line", ab.Miqp(reserve=0.2), QUAD)
    asked = [getattr(planner, "reserve", 0.2) for planner in pretending.asked]
    assert asked.count(0.2) > len(asked) // 2  # not where that is the change


def test_what_one_planner_finds_no_plan_for_another_may_plan_as_it_is() -> None:
    """A refusal advised 1.5 times the thrust."""
    weak = replace(QUAD, rotors=tuple(replace(rotor, max_thrust=2.33) for rotor in QUAD.rotors))
    found = ab.why("half-flip", ab.Miqp(intervals=10, rescue=False), weak)
    (remedy,) = found.remedies
    assert remedy.changes == ()
    assert remedy.plan.certified


def test_a_plan_that_keeps_less_than_the_reserve_helps_only_without_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A closed form, which keeps none, was advised to who asked for a reserve."""
    monkeypatch.setattr(remedies, "plan", Pretending())
    task = Request(ab.load_problem("line"), QUAD, ab.Miqp(reserve=0.45))
    found = explained(ab.Infeasible("it is too little", ["one attempt"]), task)
    assert [remedy.changes for remedy in found.remedies] == [("without reserve",)]
