"""Plans around obstacles: the whole body is clear, around the shorter side, and on its side in slits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.planning.around.cells import Cells
from aerobat.planning.around.guesses import guesses
from aerobat.planning.around.routes import routes
from aerobat.planning.passages import gaps_at_ends, require_clear_ends
from aerobat.planning.planners import suited_planner
from aerobat.planning.task import Task
from places import CASES, ROOT

QUAD = ab.load_vehicle("agile-quad")
EXAMPLES = ROOT / "examples" / "problems"
HALL = ab.Limits(lower=np.array([-2.0, -4.0, 0.2]), upper=np.array([10.0, 4.0, 3.8]))
ENDS = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((8.0, 0.0, 1.5))


def hall(*obstacles: ab.Obstacle, gates: tuple[ab.Gate, ...] = ()) -> ab.Problem:
    """Eight metres through a hall in which something stands."""
    world = ab.Environment(obstacles=obstacles)
    return ab.Problem("hall", *ENDS, gates=gates, limits=HALL, environment=world)


def trunk(x: float, y: float, radius: float = 0.4) -> ab.Cylinder:
    """A trunk from floor to ceiling."""
    return ab.Cylinder(start=(x, y, 0.0), end=(x, y, 4.0), radius=radius, name=f"trunk at {x:g}")


def least_gap(plan: ab.Plan) -> float:
    """The least distance [m] of the body, in its own attitude, to any piece, at 2000 instants a second."""
    assert plan.vehicle is not None
    world, times = plan.problem.surroundings, np.linspace(0.0, plan.duration, int(2000 * plan.duration))
    found = ab.reference(plan.trajectory, plan.vehicle, times, environment=world)
    offset, shapes = plan.vehicle.bounding_ellipsoid.turned(found.setpoint.q_world_body)
    centres = plan.trajectory.evaluate(times) + offset
    bodies, pieces = world.pieces.near(centres, plan.vehicle.body_radius, 1.0)
    return float(world.pieces.separated(pieces, centres[bodies], shapes[bodies]).gaps.min(initial=np.inf))


def test_a_plan_keeps_its_clearance_from_what_stands_in_its_way() -> None:
    plan = ab.plan(hall(trunk(4.0, 0.1)), ab.FreeKnots(segments=6, reserve=0.15, clearance=0.1), QUAD)
    assert plan.certified
    assert plan.flies
    assert least_gap(plan) + 1e-3 >= 0.1
    assert plan.duration < 1.03 * 1.255  # of the way without the trunk
    assert least_gap(plan) < 0.25


def test_a_round_hole_in_a_wall_is_passed_with_half_of_the_room_that_it_leaves() -> None:
    """Of a circle the body's wide axis needs the room, however the body is turned."""
    wide = QUAD.bounding_ellipsoid.revolved.wide
    for room in (0.05, 0.085, 0.15, 0.5):
        hole = ab.Gate((4.0, 0.0, 1.5), (1.0, 0.0, 0.0), so3.UP, radius=wide + room, wall=ab.Wall())
        problem = replace(hall(gates=(hole,)), maneuver=ab.Line())
        guess = next(guesses(Task.of(problem, QUAD, clearance=0.1)))[0]
        assert guess.task.clearance == pytest.approx(min(0.1, 0.5 * room), rel=0.02)


@pytest.mark.slow
def test_where_attitudes_are_asked_paths_that_knew_no_obstacles_are_tried_too() -> None:
    """Over a bar and back under it, the fastest way is no route's."""
    problem = ab.load_problem(CASES / "rewind.toml")
    fastest = ab.plan(problem, ab.Miqp(), QUAD).duration
    for planner in (ab.FreeKnots(), ab.TimeOptimal()):
        assert ab.plan(problem, planner, QUAD).duration < 1.01 * fastest


@pytest.mark.slow
def test_a_forest_is_flown_on_the_fastest_of_several_sides() -> None:
    rng = np.random.default_rng(7)
    trunks = tuple(trunk(x, float(rng.uniform(-2.0, 2.0)), 0.3) for x in np.arange(1.0, 7.5, 0.6).tolist())
    plan = ab.plan(hall(*trunks), vehicle=QUAD)
    assert plan.planner == "free-knots"
    assert plan.certified
    assert least_gap(plan) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.toml")))
def test_problems_that_come_with_the_repository_are_planned_clear_of_everything(name: str) -> None:
    plan = ab.plan(ab.load_problem(EXAMPLES / name), vehicle=QUAD)
    assert plan.certified
    assert plan.flies
    assert least_gap(plan) > 0.0


@pytest.mark.slow
def test_a_hundred_metres_of_forest_take_little_longer_than_is_possible_without() -> None:
    rng = np.random.default_rng(3)
    places = rng.uniform((4.0, -15.0, 0.8), (96.0, 15.0, 1.5), (45, 3)).tolist()
    world = ab.Environment(obstacles=tuple(trunk(x, y, radius) for x, y, radius in places))
    hall = ab.Limits(lower=np.array([-5.0, -15.0, 0.5]), upper=np.array([105.0, 15.0, 3.5]), velocity=10.0)
    ends = ab.at_rest((0.0, 0.0, 2.0)), ab.at_rest((100.0, 0.0, 2.0))
    plan = ab.plan(ab.Problem("forest", *ends, limits=hall, environment=world), vehicle=QUAD)
    assert plan.certified
    assert least_gap(plan) > 0.0
    assert plan.assessment.ratio < 1.1


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [10.0, 60.0, 90.0])
def test_a_body_passes_a_slit_on_its_side_that_it_does_not_pass_level(tilt: float) -> None:
    thickness = 2.0 * QUAD.bounding_ellipsoid.semi_axes[2]
    gate = ab.tilted_gate((4.0, 0.0, 1.6), tilt=np.radians(tilt), width=0.7, height=1.3 * thickness)
    slit = hall(gates=(replace(gate, wall=ab.Wall(border=4.0)),))
    plan = ab.plan(slit, vehicle=QUAD)
    assert plan.certified
    assert plan.flies
    assert least_gap(plan) > 0.0
    crossing = [placed.time for placed in plan.stages if placed.gate == "gate"]
    found = ab.reference(plan.trajectory, QUAD, crossing, environment=slit.surroundings)
    axis = ab.so3.thrust_axis(found.setpoint.q_world_body[0])
    assert abs(float(axis @ gate.up)) > np.cos(np.radians(12.0))


@pytest.mark.slow
def test_a_flip_moves_aside_where_something_stands_in_its_way() -> None:
    flip = ab.load_problem("flip-roll")
    free = ab.plan(flip, vehicle=QUAD)
    x, y, z = free.trajectory.evaluate(free.duration / 2.0).tolist()
    crate = ab.Box(position=(x, y + 0.45, z + 0.2), size=(0.3, 0.3, 0.3), name="crate")
    plan = ab.plan(replace(flip, environment=ab.Environment(obstacles=(crate,))), vehicle=QUAD)
    assert plan.certified
    assert least_gap(plan) > 0.05
    assert least_gap(replace(free, problem=plan.problem)) < least_gap(plan)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_first_route_goes_around_the_nearer_side_and_the_next_around_the_other(side: float) -> None:
    wall = ab.Box(position=(4.0, side * 0.8, 2.0), size=(0.2, 3.0, 4.0), name="wall")
    task = Task.of(hall(wall), QUAD)
    lower, upper = HALL.lower, HALL.upper
    places = np.array([ENDS[0].position, ENDS[1].position])
    grid = Cells.around(task.environment.pieces, QUAD.bounding_ellipsoid, places, lower, upper, 2.0)
    first, second = list(routes(grid, [(places[0], places[1])], 2))
    across = [np.interp(4.0, route.legs[0][:, 0], route.legs[0][:, 1]) for route in (first, second)]
    assert side * across[0] < -0.7
    assert side * across[1] > 2.3


def test_routes_that_differ_in_nothing_but_height_are_one() -> None:
    task = Task.of(hall(trunk(4.0, 0.0)), QUAD)
    places = np.array([ENDS[0].position, ENDS[1].position])
    lower, upper = HALL.lower, HALL.upper
    grid = Cells.around(task.environment.pieces, QUAD.bounding_ellipsoid, places, lower, upper, 2.0)
    found = list(routes(grid, [(places[0], places[1])], 4))
    sides = [np.sign(route.legs[0][1:-1, 1].sum()) for route in found]
    assert sorted(sides) == [-1.0, 1.0]


def test_what_is_kept_clear_is_no_more_than_the_ends_leave() -> None:
    reach = QUAD.bounding_ellipsoid.semi_axes[0]
    beside = [ab.Box(position=(-reach - gap - 0.1, 0.0, 1.5), size=(0.2, 1.0, 1.0)) for gap in (0.03, 0.3)]
    near, far = (Task.of(hall(box), QUAD, clearance=0.1).clearance for box in beside)
    assert 0.0 < near < 0.03
    assert far == 0.1


def test_an_end_in_free_fall_is_clear_in_every_attitude_or_refused() -> None:
    falling = ab.EndState(ENDS[0].position, acceleration=(0.0, 0.0, -ab.Environment().gravity))
    reach = QUAD.bounding_ellipsoid.revolved.reach
    boxes = [ab.Box(position=(0.0, 0.0, 1.4 - reach - gap), size=(1.0, 1.0, 0.2)) for gap in (0.03, -0.03)]
    clear, hit = (replace(hall(box), start=falling) for box in boxes)
    assert gaps_at_ends(clear, QUAD)[0][0] == pytest.approx(0.03)
    with pytest.raises(ab.SpecError, match=r"start\.position: the body of agile-quad reaches 3\.\d* cm into"):
        require_clear_ends(hit, QUAD)


@pytest.mark.slow
def test_the_exact_search_plans_from_beside_an_obstacle() -> None:
    flip = ab.load_problem("flip-roll")
    reach = QUAD.bounding_ellipsoid.semi_axes[0]
    post = ab.Box(position=(reach + 0.13, 0.0, 0.0), size=(0.2, 0.6, 0.6))
    beside = replace(flip, environment=replace(flip.environment, obstacles=(post,)))
    plan = ab.plan(beside, ab.Miqp(reserve=0.15, clearance=0.1), QUAD)
    assert plan.planner == "miqp"
    assert plan.certified
    assert least_gap(plan) > 0.0


def test_ways_around_obstacles_are_asked_of_free_knots_but_flips_of_the_exact_search() -> None:
    assert suited_planner(hall(), QUAD) == "miqp"
    assert suited_planner(hall(trunk(4.0, 0.0)), QUAD) == "free-knots"
    flip = replace(ab.load_problem("flip-roll"), environment=ab.Environment(obstacles=(trunk(4.0, 0.0),)))
    assert suited_planner(flip, QUAD) == "miqp"


@pytest.mark.slow
def test_a_hall_without_a_way_through_is_refused_for_that() -> None:
    closed = hall(ab.Box(position=(4.0, 0.0, 2.0), size=(0.2, 9.0, 5.0), name="wall"))
    with pytest.raises(ab.Infeasible, match="between obstacles no way was found"):
        ab.plan(closed, ab.FreeKnots(segments=4), QUAD)
    with pytest.raises(
        ab.SpecError, match=r"start\.position: the body of agile-quad reaches .* into 'crate'"
    ):
        ab.plan(hall(ab.Box(position=(0.0, 0.3, 1.5), size=(0.3, 0.3, 0.3), name="crate")), vehicle=QUAD)
    with pytest.raises(ab.SpecError, match="has obstacles, which the body of a vehicle keeps clear of"):
        ab.plan(hall(trunk(4.0, 0.0)), vehicle=None)
