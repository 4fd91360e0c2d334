"""Flights past obstacles: the first contact of the whole body, however it is flown, cut, moved or written."""

import pickle
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.environment.obstacles import OBSTACLES, ConvexPiece, Obstacle, Pieces
from aerobat.evaluation import Score, score, score_flights
from aerobat.planning import Plan
from aerobat.problem import Gate, Problem, Wall
from aerobat.problem.gate import GateWall
from aerobat.reporting.facts import Fact, Facts, facts
from aerobat.simulation import Outcome, fly, load_flight
from aerobat.simulation.passages import FlownBodies, NearestObstacle, nearest_obstacles
from aerobat.simulation.passages.obstacles import CLEARANCE_TOLERANCE
from aerobat.studies.feasibility.probe import Feasibility, ProbedTask, probe
from aerobat.studies.lens import Scenario, lens
from aerobat.vehicle import Ellipsoid
from score_cases import QUAD, near

Box, Cylinder, Sphere = OBSTACLES["box"], OBSTACLES["cylinder"], OBSTACLES["sphere"]
UP = [0.0, 0.0, 1.0]
BODY = QUAD.bounding_ellipsoid
ENGINES = [
    "compiled",
    pytest.param("floats", marks=pytest.mark.slow),
    pytest.param("jax", marks=pytest.mark.slow),
]


@cache
def hop() -> Plan:
    """A plan of half a second or so along y."""
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((0.0, 2.0, 1.0))
    return ab.plan(Problem("hop", *ends), ab.Miqp(), "agile-quad")


def beside(clearance: float, name: str = "pillar") -> Obstacle:
    """A pillar that a vehicle which hops without error passes at a clearance."""
    x = BODY.semi_axes[0] + clearance + 0.3
    return Cylinder(start=[x, 1.0, -1.0], end=[x, 1.0, 3.0], radius=0.3, name=name)


def among(*obstacles: Obstacle) -> Plan:
    """The hop, the obstacles in its environment."""
    plan = hop()
    environment = replace(plan.problem.environment, obstacles=obstacles)
    return replace(plan, problem=replace(plan.problem, environment=environment))


def wandering(flights: int, rows: int, seed: int) -> FlownBodies:
    """Flights of bodies that turn, some of which end early."""
    random = np.random.default_rng(seed)
    phases = random.uniform(0.0, 6.0, (flights, 1, 3))
    t = np.linspace(0.0, 3.0, rows)[:, None]
    position = 2.0 * np.sin(t * random.uniform(0.5, 2.0, (flights, 1, 3)) + phases)
    q = so3.exp(2.0 * np.sin(t * random.uniform(0.5, 3.0, (flights, 1, 3)) + phases))
    last = np.where(random.random(flights) < 0.3, random.integers(1, rows, flights), rows)
    centre = np.broadcast_to([0.01, 0.0, 0.02], (flights, 3))
    return FlownBodies(t[:, 0], position, q, centre, np.broadcast_to([0.2, 0.15, 0.05], (flights, 3)), last)


def scattered(count: int, seed: int) -> Pieces:
    """Convex pieces of every kind."""
    random = np.random.default_rng(seed)
    found = []
    for k in range(count):
        at, size = random.uniform(-2.5, 2.5, 3), random.uniform(0.1, 0.6)
        points = at + random.normal(size=(1 + k % 9, 3)) * 0.4
        found.append(ConvexPiece(points, (k % 3) * 0.5 * size * np.eye(3), f"no. {k}"))
    return Pieces(tuple(found))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("count", [2, 9])
def test_the_nearest_is_the_least_over_all_rows_and_pieces_until_the_first_contact(
    seed: int, count: int
) -> None:
    flown, pieces = wandering(6, 60, seed), scattered(count, seed)
    found = nearest_obstacles(pieces, flown)
    for k, last in enumerate(flown.rows.tolist()):
        gaps = np.array([_gaps(pieces, flown, k, piece)[:last] for piece in range(count)])
        touches = (gaps < 0.0).any(axis=0)
        row = int(np.argmax(touches)) if touches.any() else int(np.argmin(gaps.min(axis=0)))
        least = gaps[:, row].min()
        assert (found.clearance[k] < 0.0) == touches.any()
        if touches.any():
            assert found.time[k] == flown.times[row]
        assert found.clearance[k] == pytest.approx(least, abs=CLEARANCE_TOLERANCE) or touches.any()


def _gaps(pieces: Pieces, flown: FlownBodies, flight: int, piece: int) -> Array:
    body = Ellipsoid(flown.semi_axes[flight], flown.centre[flight])
    offset, shapes = body.turned(flown.q_world_body[flight])
    centres = flown.position[flight] + offset
    return pieces.separated(np.full(len(centres), piece), centres, shapes).gaps


@given(st.integers(0, 2**20))
def test_a_flight_that_is_moved_with_its_obstacles_has_the_same_contact(seed: int) -> None:
    random = np.random.default_rng(seed)
    flown, pieces = wandering(3, 70, seed), scattered(5, seed)
    turn, shift = so3.normalize(random.normal(size=4)), random.uniform(-50.0, 50.0, 3)
    axes = so3.axes(turn)
    there = Pieces(
        tuple(ConvexPiece(x.points @ axes.T + shift, axes @ x.rounding, x.name) for x in pieces.pieces)
    )
    moved = flown._replace(
        position=so3.rotate(turn, flown.position) + shift, q_world_body=so3.multiply(turn, flown.q_world_body)
    )
    here, found = nearest_obstacles(pieces, flown), nearest_obstacles(there, moved)
    clear = np.asarray(here.clearance) > 1e-6
    np.testing.assert_allclose(
        found.clearance[clear], here.clearance[clear], rtol=0, atol=2.0 * CLEARANCE_TOLERANCE
    )
    np.testing.assert_array_equal(found.clearance < 0.0, here.clearance < 0.0)
    np.testing.assert_array_equal(found.time[~clear], here.time[~clear])


@pytest.mark.parametrize("name", ["wall", "ball"])
def test_a_body_that_just_clears_is_clear_and_one_a_millimetre_nearer_is_not(name: str) -> None:
    """At rest and turned: a plane is reached by |Lᵀn|, a ball along an axis by a semi-axis."""
    q = so3.exp([0.4, -0.7, 0.2])
    normal = np.array([1.0, 0.0, 0.0]) if name == "wall" else so3.axes(q)[:, 0]
    reach = float(np.linalg.norm(so3.axes(q).T @ normal * BODY.semi_axes))
    centre = so3.rotate(q, BODY.centre)
    for nearer, touches in ((-0.0005, False), (0.0005, True)):
        middle = centre + (reach + 0.5 - nearer) * normal
        solid = Box(position=middle, size=[1.0, 9.0, 9.0]) if name == "wall" else Sphere(middle, 0.5)
        sizes = BODY.centre[None], BODY.semi_axes[None]
        still = FlownBodies(np.zeros(1), np.zeros((1, 1, 3)), q[None, None], *sizes, np.ones(1))
        found = nearest_obstacles(Pieces(solid.pieces), still)
        assert found.clearance[0] == pytest.approx(-nearer, abs=1e-9)
        assert (found.of_flight(0).failure is not None) == touches


@pytest.mark.parametrize("engine", ENGINES)
def test_all_engines_and_batches_find_the_contact_of_the_logged_flights(engine: str) -> None:
    plan, starts = among(beside(0.002), beside(2.0, "far")), near(4, 0.02)
    scores = score_flights(plan, start=starts, engine=engine)
    flights = fly(plan, start=starts, engine="compiled")
    outcomes = set()
    for k in range(4):
        logged, alone = score(flights[k], plan), score_flights(plan, start=_one(starts, k), engine=engine)
        _assert_as_near(scores[k], logged)
        _assert_as_near(alone, logged)
        outcomes.add(logged.outcome is Outcome.HIT_OBSTACLE)
    assert outcomes == {True, False}


def _one(starts: ab.BodyState, k: int) -> ab.BodyState:
    return ab.BodyState(**{name: part[k] for name, part in vars(starts).items()})


def _assert_as_near(found: Score, other: Score) -> None:
    a, b = (each if not each.is_batch else each[0] for each in (found, other))
    assert (a.outcome, a.sentence) == (b.outcome, b.sentence)
    assert isinstance(a.nearest, NearestObstacle)
    assert isinstance(b.nearest, NearestObstacle)
    assert (a.nearest.obstacle, a.nearest.time) == (b.nearest.obstacle, b.nearest.time)
    assert a.nearest.clearance == pytest.approx(b.nearest.clearance, abs=1e-9)


def test_obstacles_change_nothing_else_of_a_score() -> None:
    plan, starts = among(beside(0.5)), near(3, 0.02)
    with_them, without = (score_flights(each, start=starts) for each in (plan, hop()))
    assert replace(with_them, nearest=None) == without


def test_sweeps_count_contacts_and_tell_how_near_flights_come_whatever_their_batches() -> None:
    conditions = ab.Dispersion(start_position=0.02, mass=0.03)
    whole = ab.sweep(among(beside(0.002)), conditions, 60, workers=1)
    assert whole == ab.sweep(among(beside(0.002)), conditions, 60, workers=1, batch=7)
    hits = whole.table["outcome"] == "hit_obstacle"
    assert 0 < hits.sum() < 60
    np.testing.assert_array_equal(whole.table["clearance_m"] < 0.0, hits)
    assert set(whole.table["nearest"]) == {"pillar"}
    assert "'pillar', touched, " in _told(whole)
    assert "nearest" not in ab.sweep(hop(), conditions, 5, workers=1).table


def test_a_plan_whose_own_flight_touches_is_not_flyable_and_the_report_names_the_obstacle() -> None:
    clear, hit = among(beside(0.03)), among(beside(-0.01))
    assert clear.flyability is not None
    assert hit.flyability is not None
    assert clear.flyability.flies
    assert clear.flyability.nearest is not None
    assert clear.flyability.nearest.clearance == pytest.approx(0.03, abs=5e-3)
    assert not hit.flyability.flies
    assert hit.flyability.defects[-1].startswith("hit 'pillar' at ")
    assert "'pillar', 3.0" in _told(score(fly(clear), clear))
    assert str(score(fly(hit), hit)).startswith("hit 'pillar' at ")


def _told(result: object) -> str:
    """What is said of the nearest obstacle."""
    (found,) = {x.words for each in facts(result) for x in _inner(each) if x.label == "nearest"}
    return found


def _inner(fact: Fact) -> list[Fact]:
    return [fact, *(fact.value if isinstance(fact.value, Facts) else ())]


def test_flights_are_written_and_read_with_obstacles_and_the_walls_of_gates(tmp_path: Path) -> None:
    """A moving gate's wall was read as one that stands, and a flight that has a wall was not pickled."""
    gate = Gate([0.0, 1.0, 1.0], [0.0, 1.0, 0.0], UP, wall=Wall(border=1.0), velocity=[0.2, 0.0, 0.0])
    wall = GateWall.of(gate)
    assert wall.velocity[0] == 0.2
    flight = fly(among(beside(0.1), Box(position=[3.0, 0.0, 0.0], size=[1.0, 1.0, 1.0], tilt=0.3), wall))
    flight.save(tmp_path / "flight.npz")
    again = load_flight(tmp_path / "flight.npz")
    assert again == flight
    assert pickle.loads(pickle.dumps(flight)) == flight
    assert score(again, hop(), QUAD).nearest == score(flight, hop(), QUAD).nearest


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("environment.obstacles[0].radius", 0.2),
        ("environment.obstacles[0].start.x", 2.0),
        ("environment.obstacles[1].size.y", 0.4),
        ("environment.obstacles[1].heading_deg", 20.0),
        ("gate.wall.border", 0.7),
        ("gate.height", 0.3),
    ],
)
def test_studies_vary_obstacles_and_walls(field: str, value: float) -> None:
    gate = Gate([0.0, 1.0, 1.0], [0.0, 1.0, 0.0], UP, wall=Wall(border=1.0))
    box = Box(position=[3.0, 0.0, 0.0], size=[1.0, 1.0, 1.0])
    environment = Environment(obstacles=(beside(0.1), box))
    problem = replace(hop().problem, gates=(gate,), environment=environment)
    before = Scenario(problem, QUAD)
    varied = lens(field, before)
    after = varied.set(before, value)
    assert varied.get(after) == pytest.approx(value)
    moved = [a != b for a, b in zip(_solids(before), _solids(after), strict=True)]
    assert sum(moved) == 1


def _solids(scenario: Scenario) -> list[str]:
    """All that stands in the way, part by part."""
    obstacles = scenario.problem.surroundings.obstacles
    return [str([piece.box for piece in obstacle.pieces]) for obstacle in obstacles]


def test_a_scenario_whose_flight_touches_is_not_flyable_and_says_what(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plan = among(beside(-0.01))
    monkeypatch.setattr("aerobat.studies.feasibility.probe.plan", lambda *_: plan)
    found = probe(ProbedTask(Scenario(plan.problem, QUAD), (), 30.0), ())
    assert found.feasibility is Feasibility.NOT_FLYABLE
    assert "pillar" in found.sentence
