"""Clearance: where it is certified no sample of the body touches, and it is as large as samples say."""

from dataclasses import replace

import fcl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.certification import Certificate, Finding, Verdict, certify
from aerobat.environment import Environment
from aerobat.environment.obstacles import OBSTACLES, Obstacle
from aerobat.flatness import reference
from aerobat.problem import Problem, Wall, at_rest, tilted_gate
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Ellipsoid, load_vehicle
from fcl_peer import EXACT, convex, distance, gap_between, solid
from random_flights import Flight, moved, random_flight, with_lags
from random_obstacles import KINDS, random_obstacle
from suites import examples

VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)
BODY = VEHICLE.bounding_ellipsoid.revolved
REST = [[0.0, 0.0, 0.0]] * 3
TIGHT = 1e-3  # [m] from the bound to what samples come to
BOX, SPHERE, WALL = OBSTACLES["box"], OBSTACLES["sphere"], OBSTACLES["half-space"]


def clearance(certificate: Certificate) -> Finding:
    found = [finding for finding in certificate.findings if finding.quantity == "clearance"]
    assert len(found) == 1
    return found[0]


def among(flight: Flight, *obstacles: Obstacle) -> Flight:
    return replace(flight, environment=replace(flight.environment, obstacles=obstacles))


def certified(flight: Flight) -> Finding:
    return clearance(certify(flight.trajectory, flight.vehicle, flight.environment))


def line(length: float, seconds: float) -> Flight:
    """From rest to rest along x."""
    path = minimum_effort(np.array([[[0, 0, 0], *REST], [[length, 0, 0], *REST]], dtype=float), [seconds])
    return Flight(VEHICLE, path)


def forest(seed: int) -> Flight:
    """A random flight near a random obstacle of each kind but half-spaces, which would hold all of it."""
    flight, rng = random_flight(seed), np.random.default_rng(seed)
    size = flight.vehicle.bounding_ellipsoid.revolved.reach
    obstacles = []
    for i, kind in enumerate(KINDS):
        time = rng.uniform(0.0, flight.trajectory.duration)
        place = flight.trajectory.evaluate(time) + 4.0 * size * rng.normal(size=3)
        drawn = random_obstacle(rng, kind, place, size)
        if kind != "half-space":
            obstacles.append(replace(drawn, name=f"{kind} {i}"))
    return among(flight, *obstacles)


def sampled(flight: Flight, points: int) -> tuple[float, float]:
    """The least distance of the true body and of the one that is revolved, negative where they overlap [m].

    Far obstacles are left out.
    """
    times = np.linspace(0.0, flight.trajectory.duration, points)
    found = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    q, at = found.setpoint.q_world_body, flight.trajectory.evaluate(times)
    body = flight.vehicle.bounding_ellipsoid
    revolved = body.revolved
    centres, axes, up = at + body.turned(q)[0], so3.axes(q), at + revolved.up * so3.thrust_axis(q)
    wide = [revolved.wide, revolved.wide, revolved.high]
    true, around = [np.inf], [np.inf]
    for obstacle in flight.environment.obstacles:
        away = Environment(obstacles=(obstacle,)).pieces.box_distances(at, at)[:, 0]
        other = solid(obstacle)
        for k in np.flatnonzero(away < away.min() + 2.0 * revolved.reach):
            true.append(distance(other, centres[k], axes[k], body.semi_axes))
            around.append(distance(other, up[k], axes[k], wide) - revolved.aside)
    return min(true), min(around)


def check_against_samples(flight: Flight, points: int) -> Verdict:
    found = certified(flight)
    true, around = sampled(flight, points)
    assert found.bound <= found.value
    if found.verdict is Verdict.HOLDS:
        assert true > 0.0
        assert found.bound - EXACT <= around <= true + 2 * EXACT
        assert around <= found.bound + TIGHT
        assert found.margin == found.bound
    else:
        assert found.verdict is Verdict.VIOLATED
        assert around < EXACT
    return found.verdict


@pytest.mark.parametrize("seed", range(4))
def test_certified_bodies_are_as_near_as_samples_of_another_library_say(seed):
    check_against_samples(forest(seed), 2000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 64))
def test_many_certified_bodies_are_as_near_as_samples_of_another_library_say(seed):
    check_against_samples(forest(seed), 20_000)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 3, 4, 17, 23])
def test_no_point_of_a_certified_body_enters_an_obstacle(seed):
    """At 10⁵ instants, the hull of 200 points of its surface."""
    flight = forest(seed)
    found, body = certified(flight), flight.vehicle.bounding_ellipsoid
    assert found.verdict is Verdict.HOLDS
    hull = convex(sphere_points(200) * body.semi_axes)
    times = np.linspace(0.0, flight.trajectory.duration, 100_000)
    at = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    places = flight.trajectory.evaluate(times)
    centres, axes = places + body.turned(at.setpoint.q_world_body)[0], so3.axes(at.setpoint.q_world_body)
    for obstacle in flight.environment.obstacles:
        away = Environment(obstacles=(obstacle,)).pieces.box_distances(places, places)[:, 0]
        for k in np.flatnonzero(away < body.revolved.reach + found.value):
            hull.setTransform(fcl.Transform(axes[k], centres[k]))
            assert gap_between(solid(obstacle), hull) >= found.bound - EXACT


def sphere_points(count: int) -> np.ndarray:
    """Points of the unit sphere along a spiral, (count, 3)."""
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


@examples(12, few=7)
@given(seed=st.integers(0, 200), kind=st.sampled_from(KINDS), away=st.floats(0.0, 3.0))
def test_the_bound_is_below_the_gap_of_every_instant_and_reached(seed, kind, away):
    """By our own planes, whose exactness has tests of its own."""
    flight, rng = random_flight(seed), np.random.default_rng(seed)
    body = flight.vehicle.bounding_ellipsoid.revolved
    place = flight.trajectory.evaluate(rng.uniform(0.0, flight.trajectory.duration))
    flight = among(
        flight, random_obstacle(rng, kind, place + away * body.reach * rng.normal(size=3), body.reach)
    )
    found, pieces = certified(flight), flight.environment.pieces
    times = np.append(found.time, np.linspace(0.0, flight.trajectory.duration, 200))
    at = reference(flight.trajectory, flight.vehicle, np.sort(times), environment=flight.environment)
    arms, shapes = body.turned(so3.thrust_axis(at.setpoint.q_world_body))
    centres = flight.trajectory.evaluate(np.sort(times)) + arms
    gaps = pieces.separated(np.zeros(len(times), dtype=int), centres, shapes).gaps - body.aside
    if found.value < 0.0:
        assert found.verdict is Verdict.VIOLATED
        assert gaps.min() < 0.0
    else:
        assert gaps.min() >= found.bound - 1e-6
        assert gaps[np.searchsorted(np.sort(times), found.time)] == pytest.approx(found.value, abs=1e-5)
        assert found.bound <= found.value <= found.bound + 4e-4


@examples(12, few=12)
@given(gap=st.floats(-0.05, 0.5), tilt=st.floats(-1.0, 1.0))
def test_a_hovering_body_is_as_near_to_a_wall_as_its_attitude_says(gap, tilt):
    """In closed form: it reaches √(wide² sin² + high² cos²) and what its centre is shifted."""
    still = Flight(VEHICLE, Trajectory([1.0], np.zeros((1, 1, 3))))
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    reach = np.hypot(BODY.wide * np.sin(tilt), BODY.high * np.cos(tilt)) - BODY.up * np.cos(tilt)
    found = certified(among(still, WALL(position=-(gap + reach + BODY.aside) * normal, normal=normal)))
    assert found.value == pytest.approx(gap, abs=1e-6)
    if abs(gap) > 1e-5:
        assert found.verdict is (Verdict.HOLDS if gap > 0.0 else Verdict.VIOLATED)


def test_a_path_into_a_ball_is_violated_at_the_instant_at_which_it_is_deepest():
    flight = among(line(4.0, 3.0), SPHERE(position=(2.0, 0.05, 0.1), radius=0.2, name="the ball"))
    found = certified(flight)
    assert found.verdict is Verdict.VIOLATED
    assert found.time == pytest.approx(1.5, abs=0.1)
    assert str(found).startswith("clearance from 'the ball' falls to -0.")
    assert str(found).endswith("below its limit")
    assert not certify(flight.trajectory, flight.vehicle, flight.environment).certified


def test_a_hair_on_either_side_of_touching_is_told_apart():
    """A wall beside the path: the gap is known in closed form."""
    for hair, verdict in ((1e-4, Verdict.HOLDS), (1e-5, Verdict.HOLDS), (-1e-5, Verdict.VIOLATED)):
        beside = WALL(position=(0.0, BODY.wide + BODY.aside + hair, 0.0), normal=(0.0, -1.0, 0.0))
        found = certified(among(line(4.0, 3.0), beside))
        assert found.verdict is verdict
        assert found.value == pytest.approx(hair, abs=1e-7)


def test_what_passes_under_a_ceiling_level_does_not_pass_it_leaning():
    ceiling = WALL(position=(0.0, 0.0, BODY.up + 1.5 * BODY.high), normal=(0.0, 0.0, -1.0))
    assert certified(among(line(6.0, 30.0), ceiling)).verdict is Verdict.HOLDS
    assert certified(among(line(6.0, 1.4), ceiling)).verdict is Verdict.VIOLATED


def test_where_thrust_vanishes_the_body_counts_in_every_attitude():
    """A ball about it is clear of a wall beside free fall, or nothing is decided."""
    falling = Flight(
        VEHICLE, Trajectory([0.5], np.array([[[0, 0, 0], [0, 0, 0], [0, 0, -0.5 * 9.80665 * 0.25]]]))
    )
    falling = replace(falling, environment=replace(falling.environment, gravity=9.80665))
    for gap, verdict in ((0.01, Verdict.HOLDS), (-0.01, Verdict.UNDECIDED)):
        wall = WALL(position=(BODY.reach + gap, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
        certificate = certify(falling.trajectory, VEHICLE, replace(falling.environment, obstacles=(wall,)))
        found = clearance(certificate)
        assert certificate.undetermined
        assert found.verdict is verdict
        assert found.value == pytest.approx(gap, abs=1e-6)
        assert not certificate.certified


def test_a_path_through_a_spell_without_thrust_is_covered_without_a_hole():
    """Attitude before and after, a ball between: a wall across the path is found wherever it stands."""
    flight = upside_down_and_back()
    spells = certify(flight.trajectory, VEHICLE, flight.environment).undetermined
    assert spells
    between = 0.5 * (spells[0].start + spells[0].end)
    for time in (0.3, between, 0.8 * flight.trajectory.duration):
        at = flight.trajectory.evaluate(time)
        found = certified(among(flight, SPHERE(position=at, radius=0.05)))
        assert found.verdict is not Verdict.HOLDS
        assert found.bound < -0.04


def upside_down_and_back() -> Flight:
    """Up and down so hard that thrust passes zero on the way down."""
    ends = np.array([[[0, 0, 0], *REST], [[0, 0, 3.0], *REST]], dtype=float)
    return Flight(VEHICLE, minimum_effort(ends, [1.0]))


def test_a_tall_body_is_certified_as_sharply_as_a_flat_one():
    tall = replace(VEHICLE, body=Ellipsoid(semi_axes=(0.5, 0.5, 1.5)))
    flight = replace(line(6.0, 1.6), vehicle=tall)
    for k, kind in enumerate(KINDS[:5]):
        rng = np.random.default_rng(k)
        obstacle = random_obstacle(rng, kind, np.array([3.0, 2.0, -1.0]), 0.3)
        if kind == "half-space":
            obstacle = WALL(position=(0.0, 2.5, 0.0), normal=(0.3, -1.0, 0.0))
        found = certified(among(flight, obstacle))
        assert found.verdict is Verdict.HOLDS
        assert sampled(among(flight, obstacle), 2000)[1] == pytest.approx(found.bound, abs=TIGHT)


def test_moving_and_turning_all_about_the_vertical_changes_nothing():
    flight = forest(2)
    turned = moved(flight, 0.7, np.array([5.0, -3.0, 2.0]))
    turn = so3.axes(so3.about_axis(so3.UP, np.array(0.7)))
    shapes = tuple(
        OBSTACLES["polytope"](points=piece.points @ turn.T + [5.0, -3.0, 2.0])
        for obstacle in flight.environment.obstacles
        for piece in obstacle.pieces
        if obstacle.kind in ("box", "polytope")
    )
    straight = tuple(each for each in flight.environment.obstacles if each.kind in ("box", "polytope"))
    found, again = certified(among(flight, *straight)), certified(among(turned, *shapes))
    assert again.value == pytest.approx(found.value, abs=4e-4)
    assert again.time == pytest.approx(found.time, abs=0.05)


def test_obstacles_change_no_other_finding_and_without_them_nothing_is_said_of_clearance():
    for seed in (0, 3):  # of unequal and of equal drag
        flight = random_flight(seed)
        alone = certify(flight.trajectory, flight.vehicle, flight.environment).findings
        far = among(flight, SPHERE(position=(1000.0, 0.0, 0.0), radius=1.0))
        others = certify(far.trajectory, far.vehicle, far.environment).findings
        assert "clearance" not in [finding.quantity for finding in alone]
        kept = [finding for finding in others if finding.quantity != "clearance"]
        for one, other in zip(alone, kept, strict=True):
            assert replace(other, value=one.value, bound=one.bound, time=one.time) == one
            assert (other.value, other.bound) == pytest.approx((one.value, one.bound), rel=1e-9, abs=1e-9)


def test_the_wall_around_a_gate_is_an_obstacle_that_is_named():
    def through(height: float) -> Finding:
        gate = replace(tilted_gate((3.0, 0.0, 0.0)), name="slit", width=1.0, height=height, wall=Wall())
        problem = Problem("wall", at_rest((0.0, 0.0, 0.0)), at_rest((6.0, 0.0, 0.0)), gates=(gate,))
        return clearance(certify(line(6.0, 20.0).trajectory, VEHICLE, problem.surroundings))

    wide, narrow = through(1.0), through(0.05)
    assert wide.verdict is Verdict.HOLDS
    assert wide.value == pytest.approx(0.5 - BODY.wide, abs=0.02)
    assert narrow.verdict is Verdict.VIOLATED
    assert narrow.name == "clearance from 'the wall of slit'"
    assert narrow.time == pytest.approx(10.0, abs=1.0)
    assert narrow.reason.limits == ("environment.obstacles",)


@given(seed=st.integers(0, 10**6))
def test_the_rest_of_intervals_is_what_parts_leave(seed):
    rng = np.random.default_rng(seed)
    parts = Subintervals.whole(3)
    for _ in range(5):
        rows = rng.uniform(size=len(parts)) < 0.5
        parts = Subintervals.joined([parts[~rows], parts[rows].halves()])
    kept = rng.uniform(size=len(parts)) < 0.5
    rest = parts[kept].rest(3)
    assert rest.length.sum() + parts[kept].length.sum() == 3.0
    middles = parts.start + parts.length / 2
    for interval, middle, known in zip(parts.interval, middles, kept, strict=True):
        inside = (rest.interval == interval) & (rest.start < middle) & (middle < rest.start + rest.length)
        assert inside.sum() == (not known)
