"""Obstacles that move: passed behind or in front, proven clear over time, and touched when they are there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat.certification import Verdict, certify
from aerobat.planning.around.guesses import guesses
from aerobat.planning.task import Task
from aerobat.simulation.outcome import Outcome

QUAD = ab.load_vehicle("agile-quad")
ROOM = ab.Limits(lower=np.array([-2.0, -4.0, 0.2]), upper=np.array([12.0, 4.0, 3.8]))


def crossing(y: float, speed: float) -> ab.Problem:
    """Ten metres past a box from floor to ceiling that crosses the way."""
    box = ab.Box((5.0, y, 2.0), (1.0, 1.6, 4.0), velocity=(0.0, speed, 0.0))
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((10.0, 0.0, 1.5))
    return ab.Problem("crossing", *ends, limits=ROOM, environment=ab.Environment(obstacles=(box,)))


def side(plan: ab.Plan) -> float:
    """How far [m] to the left of the box's middle it is passed."""
    times = np.linspace(0.0, plan.duration, 2000)
    places = plan.trajectory.evaluate(times)
    box = plan.problem.environment.obstacles[0]
    assert isinstance(box, ab.Box)
    k = int(np.argmin(np.abs(places[:, 0] - 5.0)))
    return float(places[k, 1] - box.position[1] - box.velocity[1] * times[k])


@pytest.mark.slow
@pytest.mark.parametrize(("y", "speed", "sign"), [(0.6, 1.5, -1.0), (-2.5, 2.0, 1.0)])
def test_a_box_is_passed_behind_where_it_has_crossed_and_in_front_where_it_has_not(
    y: float, speed: float, sign: float
) -> None:
    plan = ab.plan(crossing(y, speed), vehicle=QUAD)
    assert plan.certified
    assert plan.flies
    assert sign * side(plan) > 0.8
    for plant in (None, "mujoco"):
        flight = ab.fly(plan, plant=plant)
        assert ab.score(flight, plan).outcome is Outcome.COMPLETE


@pytest.mark.parametrize(("speed", "blocks"), [(8.0, True), (0.8, False)])
def test_a_box_blocks_the_way_only_of_who_is_fast_enough_to_meet_it(speed: float, blocks: bool) -> None:
    """A box across the whole room leaves by its side within six seconds."""
    room = replace(ROOM, velocity=np.full(3, speed))
    box = ab.Box((5.0, 0.0, 2.0), (1.0, 9.0, 4.0), velocity=(0.0, 1.5, 0.0))
    problem = replace(crossing(0.0, 1.5), limits=room, environment=ab.Environment(obstacles=(box,)))
    assert any(guesses(Task.of(problem, QUAD))) != blocks


@pytest.mark.parametrize("late", [-0.02, 0.02])
@pytest.mark.parametrize("by_rows", [False, True])
def test_what_moves_is_judged_where_it_is_by_proof_by_flight_and_by_mujoco(
    late: float, by_rows: bool
) -> None:
    """A ball that comes from the side is touched, or not, at the instant at which it is nearest."""
    path = ab.Trajectory([1.0], [[[0.0, 0.0, 1.0], [3.0, 0.0, 0.0]]])
    body, radius = QUAD.bounding_ellipsoid, 0.3
    start = np.array([-float(body.semi_axes[0]) - radius - late, 4.0, 1.0 + body.centre[2]])
    velocity = np.array([3.0, -8.0, 0.0])  # beside the vehicle, and across its way after half a second
    rows = [[t, *(start + t * velocity)] for t in (0.0, 0.2, 0.7, 1.0)]
    ball = ab.Sphere(start, radius, **({"path": rows} if by_rows else {"velocity": velocity}))
    world = ab.Environment(obstacles=(ball,))
    finding = next(f for f in certify(path, QUAD, world).findings if f.quantity == "clearance")
    own, other = (ab.fly(path, QUAD, environment=world, plant=plant) for plant in (None, "mujoco"))
    problem = ab.Problem("past", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((3.0, 0.0, 1.0)))
    ours, felt = (ab.score(flight, problem, QUAD) for flight in (own, other))
    assert ours.nearest is not None
    if late > 0.0:
        assert finding.value == pytest.approx(late, abs=1e-3)
        assert ours.nearest.clearance == pytest.approx(late, abs=5e-3)
    assert (finding.verdict is Verdict.VIOLATED) == (late < 0.0)
    assert (ours.nearest.clearance < 0.0) == (late < 0.0)
    assert (felt.outcome is Outcome.HIT_OBSTACLE) == (late < 0.0)
