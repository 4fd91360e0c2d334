"""Courses of figures begin at closed forms through the figures' places, whatever attitudes they ask."""

from __future__ import annotations

import numpy as np
import pytest

import aerobat as ab
from aerobat.planning.polynomial.closed_forms import closed_forms, stretched_path
from aerobat.planning.polynomial.knots import fixed_at_knots
from aerobat.planning.rotor_margin import sampled_margin
from aerobat.planning.task import Task

QUAD = ab.load_vehicle("agile-quad")


def course(*elements: ab.Maneuver, gates: tuple[ab.Gate, ...] = (), goal: float = 17.0) -> ab.Problem:
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((goal, 0.0, 2.0))
    environment = ab.Environment(ground=0.0)
    return ab.Problem("freestyle", *ends, ab.Course(elements), gates, environment=environment)


def freestyle() -> ab.Problem:
    gates = (
        ab.tilted_gate((5.0, 0.0, 2.0), name="first"),
        ab.tilted_gate((14.0, 0.0, 3.0), tilt=np.pi / 2, name="second"),
    )
    elements = (ab.PassGate("first", speed=4.0), ab.PowerLoop((8.0, 0.0, 2.5)), ab.HalfFlip(gate="second"))
    return course(*elements, gates=gates)


def test_a_range_of_places_is_met_at_its_centre() -> None:
    task = Task.of(course(ab.PowerLoop((8.0, 0.0, 2.5))), QUAD)
    still = np.zeros((len(task.stages.stages), 3))
    places = fixed_at_knots(task, 4, still)[1:-1, 0]
    np.testing.assert_allclose(places.mean(axis=0)[1:], [0.0, 3.7], atol=0.2)
    np.testing.assert_allclose(places[0], [8.0, 0.0, 2.5], atol=1e-9)


@pytest.mark.parametrize("order", [3, 4])
def test_a_start_through_figures_is_no_slower_than_a_few_times_what_is_flown(order: int) -> None:
    task = Task.of(freestyle(), QUAD)
    path = stretched_path(task, order)
    assert path.duration < 10.0  # its plan takes 3.5 s
    assert sampled_margin(path, QUAD, task.environment).margin > -1.0 * QUAD.max_thrusts.max()
    low, high = path.component_range(0)
    assert (low > [-3.0, -3.0, -3.0]).all()
    assert (high < [20.0, 3.0, 9.0]).all()


@pytest.mark.slow
def test_a_course_of_figures_is_planned_from_its_first_closed_form() -> None:
    problem = freestyle()
    found = ab.plan(problem, ab.FreeKnots(reserve=0.15), QUAD)
    assert found.certified
    assert found.duration < 3.6
    assert len(found.attempts) < 40  # 73 where closed forms led nowhere
    assert len(list(closed_forms(Task.of(problem, QUAD)))) == 2


@pytest.mark.slow
def test_a_course_of_more_stages_than_the_guess_has_intervals_is_planned() -> None:
    elements = (
        ab.BarrelRoll((4.0, 0.0, 3.0)),
        ab.PowerLoop((9.0, 0.0, 3.0)),
        ab.BarrelRoll((14.0, 0.0, 3.0)),
        ab.PowerLoop((19.0, 0.0, 3.0)),
    )
    problem = course(*elements, goal=24.0)
    assert len(problem.stages(QUAD.max_specific_thrust).stages) >= 20  # which leave none to choose from
    assert ab.plan(problem, vehicle=QUAD).certified
