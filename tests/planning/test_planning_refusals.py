"""What a refusal advises is true: followed, and in that way alone, the problem is planned."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest

from aerobat.errors import Infeasible
from aerobat.planning import Miqp, Plan, plan
from aerobat.planning.miqp.remedies import advice
from aerobat.problem import GatePassage, Limits, Line, Problem, at_rest, load_problem, tilted_gate
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import load_vehicle

QUAD = load_vehicle("agile-quad")
LINE = replace(load_problem("line"), gates=(tilted_gate((5.0, 0.0, 0.0)),))
SLOW = Limits(velocity=0.6)  # [m/s], slower than a gate is passed
NEXT_TO_THE_END = Line(GatePassage(at=(0.93, 0.97)))  # of the duration, where few intervals follow
CHANGES = ("without limits.velocity", "with its stages at any time")


@cache
def followed() -> Plan:
    """The plan without the limit, with its stages at any time: as any of the advice has it."""
    return plan(replace(LINE, limits=Limits()), vehicle=QUAD)


def said(problem: Problem) -> str:
    """The advice of the refusal of a problem."""
    with pytest.raises(Infeasible) as refusal:
        plan(problem, vehicle=QUAD)
    return str(refusal.value).rpartition("; it is planned ")[2]


@pytest.mark.parametrize(
    ("problem", "advised"),
    [
        (replace(LINE, limits=SLOW), CHANGES[0]),
        (replace(LINE, maneuver=NEXT_TO_THE_END), CHANGES[1]),
        pytest.param(
            replace(LINE, limits=SLOW, maneuver=NEXT_TO_THE_END),
            " and ".join(CHANGES),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["a limit", "a window", "both together"],
)
def test_a_problem_without_a_plan_is_planned_as_its_refusal_advises(problem: Problem, advised: str) -> None:
    """Where no program had a solution, more intervals were advised, with which there was no plan either."""
    assert said(problem) == advised
    assert followed().certified


@pytest.mark.slow
def test_a_reserve_that_leaves_too_little_to_hover_is_what_the_advice_names() -> None:
    hop = replace(LINE, gates=(), goal=at_rest((0.5, 0.0, 0.0)))
    heavy = replace(QUAD, mass=0.9 * float(QUAD.max_thrusts.sum()) / STANDARD_GRAVITY)
    asked = Miqp(order=4, intervals=8, reserve=0.2)
    assert "; it is planned without reserve" in advice(asked, hop, heavy)
    assert replace(asked, reserve=0.0).plan(hop, heavy).duration > 0.0


def test_the_limit_that_a_path_exceeds_is_named() -> None:
    """It was "a limit or condition on the path"."""
    found = Miqp().plan(replace(LINE, limits=Limits(jerk=2.0)), QUAD)
    assert any(attempt.outcome.startswith("the jerk x is beyond its limit") for attempt in found.attempts)
