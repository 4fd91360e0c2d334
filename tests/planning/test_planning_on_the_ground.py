"""Courses as a person writes them: from the floor, through gates in a row, back to the floor."""

from __future__ import annotations

import numpy as np
import pytest

import aerobat as ab
from aerobat.problem import Problem

PLACES = ((3.0, 0.0, 1.5), (6.0, 1.0, 2.0), (9.0, -1.0, 1.5), (12.0, 1.0, 2.0), (15.0, 0.0, 1.5))
GATES = tuple(ab.tilted_gate(place, name=name) for name, place in zip("abcde", PLACES, strict=True))
MANEUVERS = {"course": ab.Course(tuple(ab.PassGate(gate.name) for gate in GATES)), "line": ab.Line()}


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 1.0])
@pytest.mark.parametrize("maneuver", MANEUVERS)
def test_five_gates_in_a_row_are_planned_from_the_floor_and_flown(maneuver: str, height: float) -> None:
    ends = (ab.at_rest((0.0, 0.0, height)), ab.at_rest((18.0, 0.0, height)))
    ground = ab.Environment(ground=0.0)
    problem = Problem("five", *ends, MANEUVERS[maneuver], GATES, environment=ground)
    plan = ab.plan(problem, vehicle="agile-quad")
    assert plan.certified
    assert plan.flies
    heights = plan.trajectory.evaluate(np.linspace(0.0, plan.duration, 2001))[:, 2]
    assert heights.min() > -1e-9
    score = ab.score(ab.fly(plan), plan)
    assert score.outcome.is_success
    assert [passage.gate for passage in score.passages] == [gate.name for gate in GATES]
    assert plan.duration < 4.0
