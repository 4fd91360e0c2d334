"""Stages that ask the very limit: a place as high as is allowed, a gate as fast as is allowed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat.planning.task import Task
from aerobat.problem import Quantity

HALF_FLIP = ab.load_problem("half-flip")
SPEED = float(HALF_FLIP.limits.velocity[0])
CEILING = 3.0
HARDLY_LESS = 0.99


def at_the_ceiling(ceiling: float) -> ab.Problem:
    """Over a place as high as the ceiling at CEILING."""
    over = ab.Waypoints((ab.Waypoint(position=(2.0, 0.0, CEILING)),))
    limits = ab.Limits(upper=(9.0, 9.0, ceiling))
    return ab.Problem(
        "over", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((4.0, 0.0, 1.0)), maneuver=over, limits=limits
    )


def through_the_gate_at(speed: float) -> ab.Problem:
    """The half-flip at a speed in its gate [m/s]."""
    maneuver = HALF_FLIP.maneuver
    return replace(HALF_FLIP, maneuver=replace(maneuver, passage=replace(maneuver.passage, speed=speed)))


@pytest.mark.parametrize(
    ("problem", "quantity", "still", "axis"),
    [
        (at_the_ceiling(CEILING), Quantity.POSITION, Quantity.VELOCITY, 2),
        (through_the_gate_at(SPEED), Quantity.VELOCITY, Quantity.ACCELERATION, 0),
    ],
    ids=["ceiling", "speed"],
)
def test_what_is_at_its_most_is_exactly_that_and_does_not_change(
    problem: ab.Problem, quantity: Quantity, still: Quantity, axis: int
) -> None:
    (stage,) = Task.of(problem, ab.load_vehicle("agile-quad")).stages.stages
    fixed = [c for c in stage.conditions if c.lower == c.upper and abs(c.direction[axis]) == 1.0]
    assert {quantity, still} <= {c.quantity for c in fixed}
    assert [c.lower for c in fixed if c.quantity is still] == [0.0]


def test_a_stage_below_the_limit_asks_what_it_asked() -> None:
    problem = through_the_gate_at(HARDLY_LESS * SPEED)
    task = Task.of(problem, ab.load_vehicle("agile-quad"))
    assert (
        task.stages.stages
        == problem.stages(task.vehicle.max_specific_thrust, task.vehicle.body_radius).stages
    )


@pytest.mark.slow
@pytest.mark.parametrize("planner", [ab.Miqp(), ab.FreeKnots(segments=4)], ids=lambda planner: planner.kind)
@pytest.mark.parametrize(
    ("at_most", "below"),
    [
        (at_the_ceiling(CEILING), at_the_ceiling(CEILING / HARDLY_LESS)),
        (through_the_gate_at(SPEED), through_the_gate_at(HARDLY_LESS * SPEED)),
    ],
    ids=["ceiling", "speed"],
)
def test_plans_at_the_limit_are_hardly_longer_than_just_below_it(
    at_most: ab.Problem, below: ab.Problem, planner: ab.Planner
) -> None:
    """Half as long again where only inequalities were known, after half a minute."""
    found, easier = (ab.plan(problem, planner, "agile-quad") for problem in (at_most, below))
    assert found.certified
    assert found.duration <= 1.05 * easier.duration
    np.testing.assert_array_less(np.abs(found.trajectory.evaluate(found.stages[0].time, 1)), SPEED + 1e-6)
