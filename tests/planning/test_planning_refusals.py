"""A problem is refused once other planners were asked too, and says whether that is proven."""

from __future__ import annotations

import pickle
from dataclasses import replace
from math import radians
from typing import Any

import pytest

from aerobat.errors import Infeasible, SpecError
from aerobat.planning import FreeKnots, MinSnap, Miqp, Planner, TimeOptimal, plan
from aerobat.planning.assessment.contradiction import contradiction
from aerobat.planning.miqp import rescue
from aerobat.planning.result import FLYING_RESERVE
from aerobat.problem import GatePassage, Limits, Line, load_problem, tilted_gate
from aerobat.studies.feasibility import min_requirements
from aerobat.vehicle import Vehicle, load_vehicle
from places import CASES

QUAD = load_vehicle("agile-quad")
LINE = replace(load_problem("line"), gates=(tilted_gate((5.0, 0.0, 0.0)),))
SLOW = Limits(velocity=0.6)  # [m/s], slower than a gate is passed
NEXT_TO_THE_END = Line(GatePassage(at=(0.93, 0.97)))  # of the duration, where few intervals follow


def of_thrust_to_weight(ratio: float) -> Vehicle:
    """The quadrotor with rotors so strong."""
    factor = ratio / QUAD.thrust_to_weight
    rotors = tuple(replace(rotor, max_thrust=factor * rotor.max_thrust) for rotor in QUAD.rotors)
    return replace(QUAD, rotors=rotors)


@pytest.mark.parametrize("planner", ["miqp", "min-snap", "free-knots", "time-optimal"])
def test_what_contradicts_itself_is_refused_as_proven_before_anything_is_tried(planner: str) -> None:
    with pytest.raises(Infeasible, match="'line' is proven to have no plan") as refusal:
        plan(replace(LINE, limits=SLOW), planner, QUAD)
    assert "limits.velocity (0.6 m/s)" in str(refusal.value)
    assert refusal.value.limits == ("limits.velocity",)
    assert refusal.value.attempts == ()


@pytest.mark.slow
@pytest.mark.parametrize("planner", [Miqp(rescue=False), MinSnap()])
def test_a_refusal_holds_the_limits_that_bind_as_data_and_in_other_processes_too(planner: Planner) -> None:
    weak = of_thrust_to_weight(1.02)
    with pytest.raises(Infeasible) as refusal:
        plan("half-flip", planner, weak)
    (limit, *_) = refusal.value.limits
    assert limit in ("max_thrust", "min_thrust", "stage 'gate'")
    again = pickle.loads(pickle.dumps(refusal.value))
    assert (again.limits, again.sentence) == (refusal.value.limits, refusal.value.sentence)
    assert isinstance(refusal.value.attempts[-1].outcome, str)


@pytest.mark.slow
def test_a_refusal_names_the_bound_who_was_asked_and_that_it_is_not_proven(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[str] = []

    def refuse(self: Any, *_: Any) -> None:
        asked.append(type(self).__name__)
        raise Infeasible("refused")

    for planner in (FreeKnots, TimeOptimal):
        monkeypatch.setattr(planner, "plan", refuse)
    with pytest.raises(Infeasible) as refusal:
        plan(load_problem("half-flip"), Miqp(), of_thrust_to_weight(1.02))
    assert set(asked) == {"FreeKnots", "TimeOptimal"}
    said = str(refusal.value)
    assert "binds" in said or "at best" in said
    assert "not proven, but none was found" in said
    assert all(way in said for way in ("by time-optimal", "by free-knots", "with 26 intervals"))
    assert said.endswith("; ab.why(problem, vehicle=...) tries changes that would help")


def test_ways_for_which_there_is_no_time_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rescue, "RESCUE_WORK", 0.0)
    with pytest.raises(Infeasible, match=r"0 s of work were too few to plan .*by time-optimal"):
        plan(replace(LINE, maneuver=NEXT_TO_THE_END), vehicle=QUAD)


def test_a_refusal_stays_what_it_is_from_process_to_process() -> None:
    refusal = Infeasible("it is too little", ["one attempt"])
    again = pickle.loads(pickle.dumps(refusal))
    assert (str(again), again.attempts, again.sentence) == (
        str(refusal),
        ("one attempt",),
        "it is too little",
    )


def test_why_there_is_no_plan_is_found_out_once_and_only_where_it_is_read() -> None:
    asked: list[str] = []

    def diagnosis() -> str:
        asked.append("once")
        return "it is too little"

    refusal = Infeasible(diagnosis, ["one attempt"])
    assert not asked
    assert str(refusal).startswith("it is too little; ")
    assert pickle.loads(pickle.dumps(refusal)).sentence == refusal.sentence
    assert asked == ["once"]


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.15, 1.10])
def test_what_rotors_just_can_is_planned_by_whichever_planner_finds_it(ratio: float) -> None:
    """It was refused after 24 s, and 1.5 times the thrust were advised."""
    found = plan(load_problem("half-flip"), vehicle=of_thrust_to_weight(ratio))
    assert found.certified
    assert found.flies
    assert "; planned " in found.rescue


@pytest.mark.slow
def test_a_flip_through_a_low_gate_is_planned_with_the_reserve() -> None:
    """It was refused, though it is planned at once where the gate is passed at 2 m/s."""
    hexa = load_vehicle(str(CASES / "slow-hexa.toml"))
    found = plan(load_problem(str(CASES / "slow-flip.toml")), None, hexa)
    assert found.keeps(FLYING_RESERVE)
    assert found.flies
    assert found.duration < 2.1  # the best known without a reserve takes 1.65 s
    assert found.rescue.endswith("planned faster through its gates")


@pytest.mark.slow
def test_what_is_needed_is_what_any_planner_needs() -> None:
    """It was 1.147, the least of the MIQP alone."""
    (found,) = min_requirements("half-flip", "agile-quad", ["thrust-to-weight"], tolerance=0.05, workers=1)
    assert found.value is not None
    assert found.value <= 1.10


def test_the_limit_that_a_path_exceeds_is_named() -> None:
    """It was "a limit or condition on the path"."""
    found = Miqp(rescue=False).plan(replace(LINE, limits=Limits(jerk=2.0)), QUAD)
    assert any(attempt.outcome.startswith("the jerk x is beyond its limit") for attempt in found.attempts)


def test_a_stage_that_asks_more_tilt_than_the_limit_allows_is_refused_as_proven() -> None:
    """Within its tolerance of attitude."""
    steep = replace(load_problem("half-flip"), limits=Limits(max_tilt=radians(80.0)))  # in a gate at 90°
    with pytest.raises(Infeasible, match=r"is proven to have no plan: the stage .* limits.max_tilt \(80°\)"):
        plan(steep, Miqp(), QUAD)
    assert contradiction(replace(steep, limits=Limits(max_tilt=radians(89.7))), QUAD) is None


def test_a_refused_tilt_names_the_attitude_and_what_frees_it() -> None:
    found = contradiction(replace(load_problem("half-flip"), limits=Limits(max_tilt=radians(88.93))), QUAD)
    assert found is not None
    assert "asks 90° of tilt, at least 89.5° within its tolerance" in found.sentence
    assert found.sentence.endswith("set limits.max_tilt to 90° or more, or ask 88.9° at most")


@pytest.mark.parametrize("planner", ["miqp", "min-snap", "free-knots", "time-optimal"])
@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_in_free_fall_is_refused_by_its_field(planner: str, end: str) -> None:
    falling = replace(LINE.ends[end], acceleration=(0.0, 0.0, -LINE.environment.gravity))
    with pytest.raises(SpecError, match=rf"^{end}\.acceleration asks no thrust.*give another"):
        plan(replace(LINE, **{end: falling}), planner, QUAD)


@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_that_asks_more_thrust_than_rotors_give_is_refused_as_proven(end: str) -> None:
    rising = replace(LINE.ends[end], acceleration=(0.0, 0.0, 90.0))
    with pytest.raises(Infeasible, match=rf"no plan: {end}\.acceleration asks .* N of thrust") as refusal:
        plan(replace(LINE, **{end: rising}), "miqp", QUAD)
    assert refusal.value.limits == (f"{end}.acceleration",)
    full = QUAD.max_specific_thrust - LINE.environment.gravity
    assert contradiction(replace(LINE, **{end: replace(rising, acceleration=(0.0, 0.0, full))}), QUAD) is None


@pytest.mark.parametrize("end", ["start", "goal"])
def test_an_end_that_asks_more_tilt_than_the_limit_allows_is_refused_as_proven(end: str) -> None:
    leaning = replace(LINE.ends[end], acceleration=(LINE.environment.gravity, 0.0, 0.0))
    steep = replace(LINE, limits=Limits(max_tilt=radians(30.0)), **{end: leaning})
    with pytest.raises(Infeasible, match=rf"no plan: {end}\.acceleration asks 45° of tilt") as refusal:
        plan(steep, "miqp", QUAD)
    assert refusal.value.limits == ("limits.max_tilt", f"{end}.acceleration")
    assert contradiction(replace(steep, limits=Limits(max_tilt=radians(46.0))), QUAD) is None


@pytest.mark.slow
@pytest.mark.parametrize(("name", "thrust"), [("barrel-roll", 0.9), ("immelmann", 1.0)])
def test_half_of_a_reserve_is_kept_before_it_is_given_up(name: str, thrust: float) -> None:
    """Without any, as both were planned once, no flight under `lab` succeeds."""
    x500 = load_vehicle("x500")
    rotors = tuple(replace(rotor, max_thrust=thrust * rotor.max_thrust) for rotor in x500.rotors)
    found = plan(name, None, replace(x500, rotors=rotors))
    assert found.rescue.endswith("with half of the reserve")
    assert found.keeps(0.5 * FLYING_RESERVE)
    assert not found.keeps(FLYING_RESERVE)
