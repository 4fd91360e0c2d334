"""Gates are judged by the body: an ellipsoid, of which all that is swept of the plane lies in the opening."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.floats import FloatOps
from aerobat.limits.body_in_gate import BodyInGate, OpeningAhead, extent_of_attitude, extent_of_thrust
from aerobat.planning import PlacedStage
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.reporting.plain_data import plain
from aerobat.reporting.report import Report
from aerobat.simulation import Outcome
from aerobat.simulation.passages import log_rows, passages_in_log
from gate_motions import CROSSING, RATE, Motion, cruise, motion
from random_problems import random_case
from score_cases import QUAD
from suites import examples

seeds = st.integers(0, 2**32 - 1)


@given(seeds)
@examples(30, few=12)
def test_a_sphere_leaves_what_its_path_leaves_but_its_shadow(seed: int) -> None:
    """On a straight path it sweeps its shadow along the velocity, r √(1 + (v_l/v_n)²) to the sides."""
    drawn = motion(seed)
    radius = float(drawn.body.semi_axes[0])
    ball = ab.Ellipsoid([radius] * 3)
    straight = replace(drawn, body=ball, acceleration=np.zeros(3))
    gate, v = straight.gate, straight.velocity
    sides = []
    for axis, size in ((gate.lateral, gate.width), (gate.up, gate.height)):
        shadow = radius * np.hypot(1.0, (v @ axis) / (v @ gate.normal))
        sides.append(size / 2 - abs(straight.offset @ axis) - shadow)
    assert straight.passage().clearance == pytest.approx(min(sides), abs=1e-9)


@given(seeds)
@examples(30, few=12)
def test_moving_gate_and_flight_together_changes_nothing(seed: int) -> None:
    one = motion(seed)
    rng = np.random.default_rng([seed, 1])
    turn, shift = so3.exp(rng.normal(size=3)), rng.normal(size=3)
    gate = replace(
        one.gate,
        position=so3.rotate(turn, one.gate.position) + shift,
        normal=so3.rotate(turn, one.gate.normal),
        up=so3.rotate(turn, one.gate.up),
    )
    vectors = (so3.rotate(turn, v) for v in (one.offset, one.velocity, one.acceleration))
    moved = Motion(gate, one.body, *vectors, so3.multiply(turn, one.attitude), one.omega_body)
    for name in ("clearance", "closest_time", "closest_lateral", "closest_up", "needed_width"):
        assert getattr(moved.passage(), name) == pytest.approx(getattr(one.passage(), name), abs=1e-9)
    assert moved.passage().closest_edge == one.passage().closest_edge


@given(seeds, st.floats(0.001, 0.2))
@examples(30, few=12)
def test_an_edge_that_comes_nearer_takes_as_much_of_the_clearance(seed: int, nearer: float) -> None:
    one = motion(seed)
    before = one.passage()
    inward = {
        "left": -one.gate.lateral,
        "right": one.gate.lateral,
        "upper": -one.gate.up,
        "lower": one.gate.up,
    }[before.closest_edge]
    gate = replace(one.gate, position=one.gate.position + nearer * inward)
    after = replace(one, gate=gate, offset=one.offset - nearer * inward).passage()
    assert after.clearance == pytest.approx(before.clearance - nearer, abs=1e-12)
    assert after.closest_edge == before.closest_edge
    assert after.closest_time == pytest.approx(before.closest_time, abs=1e-9)


@given(seeds, st.floats(0.0, 0.5), st.floats(0.0, 0.5))
@examples(30, few=12)
def test_a_larger_opening_leaves_no_less_and_the_needed_one_just_nothing(
    seed: int, wider: float, higher: float
) -> None:
    one = motion(seed)
    gate = one.gate
    small = one.passage()
    large = replace(one, gate=replace(gate, width=gate.width + wider, height=gate.height + higher)).passage()
    assert small.clearance <= large.clearance <= small.clearance + max(wider, higher) / 2 + 1e-12
    needed = replace(gate, width=small.needed_width, height=small.needed_height)
    assert replace(one, gate=needed).passage().clearance == pytest.approx(0.0, abs=1e-12)


@given(seeds)
@examples(12, few=4)
def test_the_body_sweeps_of_the_plane_what_a_cloud_of_its_points_does(seed: int) -> None:
    """Points of its surface, each where it goes through the plane, at ten times the rate."""
    one = motion(seed)
    times = np.arange(0.2, 0.8, 1 / (10 * RATE))
    position, _, attitude = one.states(times)
    widest = highest = 0.0
    for point in one.body.centre + one.body.semi_axes * sphere(1500):
        offset = position + so3.rotate(attitude, point) - one.gate.position
        height = offset @ one.gate.normal
        k = np.flatnonzero(np.diff(height > 0.0))
        part = (height[k] / (height[k] - height[k + 1]))[:, None]
        through = offset[k] + part * (offset[k + 1] - offset[k])
        widest = max(widest, *np.abs(through @ one.gate.lateral), 0.0)
        highest = max(highest, *np.abs(through @ one.gate.up), 0.0)
    found = one.passage()
    assert 2 * widest - 5e-4 < found.needed_width < 2 * widest + 8e-3
    assert 2 * highest - 5e-4 < found.needed_height < 2 * highest + 8e-3


def sphere(count: int) -> Array:
    """Points evenly on the unit sphere: Fibonacci's spiral, (count, 3)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - z * z)
    return np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])


FRAME = """<mujoco><worldbody>
<geom type="box" size="{depth} 1 3" pos="0 {left} 0"/><geom type="box" size="{depth} 1 3" pos="0 -{left} 0"/>
<geom type="box" size="{depth} 3 1" pos="0 0 {top}"/><geom type="box" size="{depth} 3 1" pos="0 0 -{top}"/>
<body><freejoint/><geom type="ellipsoid" size="{axes}"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("seed", range(10))
def test_mujoco_finds_the_frame_touched_where_the_clearance_is_negative(seed: int) -> None:
    """A frame of four boxes, nearly as thin as a plane, made so wide that it is just touched, or just not."""
    drawn = motion(seed)
    one = replace(drawn, body=ab.Ellipsoid(drawn.body.semi_axes))
    found = one.passage()
    to_gate = so3.conjugate(so3.multiply(*_turns(one.gate)))
    times = np.arange(0.25, 0.75, 1 / 2000)
    position, _, attitude = one.states(times)
    for scale, touches in ((0.97, True), (1.03, False)):
        left, top = (1 + scale * size / 2 for size in (found.needed_width, found.needed_height))
        axes = " ".join(map(str, one.body.semi_axes))
        model = mujoco.MjModel.from_xml_string(FRAME.format(depth=1e-4, left=left, top=top, axes=axes))
        data = mujoco.MjData(model)
        contacts = 0
        for p, q in zip(so3.rotate(to_gate, position - one.gate.position), attitude, strict=True):
            data.qpos[:] = [*p, *so3.multiply(to_gate, q)]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            contacts += data.ncon
        assert (contacts > 0) == touches


def _turns(gate: ab.Gate) -> tuple[Array, Array]:
    """Rotations whose product takes the world's axes to normal, lateral and up of a gate."""
    first = so3.smallest_rotation(np.array([1.0, 0, 0]), gate.normal)
    lateral = so3.rotate(first, np.array([0.0, 1, 0]))
    angle = np.arctan2(np.cross(lateral, gate.lateral) @ gate.normal, lateral @ gate.lateral)
    return so3.about_axis(gate.normal, angle), first


@given(seeds)
@examples(40, few=16)
def test_a_path_that_bends_no_more_than_its_way_through_a_gate_clears_the_frame_and_does_not_turn_back(
    seed: int,
) -> None:
    """In any attitude, bending to one of the sides or backward; the slowest path that is fast enough."""
    rng, one = np.random.default_rng(seed), motion(seed)
    wide, _, high = one.body.semi_axes
    body, size = ab.Ellipsoid((wide, wide, high)), 2.0 * max(wide, high) + rng.uniform(0.1, 0.3)
    gate, offset = replace(one.gate, width=size, height=size), 0.4 * one.offset
    way = BodyInGate(gate, 0, PASSAGE_DEPTH + max(wide, high), rng.uniform(0.1, 8.0))
    opening = OpeningAhead.of_parameters(way.parameters.tolist())
    thrust = so3.rotate(one.attitude, np.array([0.0, 0.0, 1.0]))
    extent = extent_of_thrust(FloatOps, body.revolved, tuple(thrust.tolist()))
    along = one.velocity / np.linalg.norm(one.velocity)

    def is_asked(speed: float) -> bool:
        position, velocity = (gate.position + offset).tolist(), (speed * along).tolist()
        return min(opening.clearances(FloatOps, position, velocity, (extent, extent))) >= 0.0

    slowest = next((speed for speed in np.geomspace(0.3, 100.0, 80) if is_asked(speed)), None)
    assume(slowest)
    velocity = slowest * along
    for side in (gate.lateral, -gate.lateral, gate.up, -gate.up):
        passage = Motion(
            gate, body, offset, velocity, way.lateral_acceleration * side, one.attitude, np.zeros(3)
        ).passage(5 * RATE)
        assert passage.clearance > 0.0
    slowed = Motion(
        gate, body, offset, velocity, -way.lateral_acceleration * gate.normal, one.attitude, np.zeros(3)
    )
    times = np.arange(0.0, 5.0, 1e-3)
    assert ((slowed.states(times)[0] - gate.position) @ gate.normal).max() > 0.999 * way.reach


@given(seeds)
@examples(30, few=12)
def test_a_body_turned_about_its_thrust_reaches_as_far_as_it_does_in_some_attitude_and_no_farther(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    body = ab.Ellipsoid(rng.uniform(0.05, 0.3, 3), rng.uniform(-0.05, 0.05, 3))
    attitude, outward = so3.exp(rng.normal(size=3)), rng.normal(size=3)
    outward = tuple((outward / np.linalg.norm(outward)).tolist())
    x, y, z = np.moveaxis(so3.axes(attitude), -1, 0).tolist()
    own = extent_of_attitude(FloatOps, body, (x, y, z))(outward)
    surface = rng.normal(size=(20_000, 3))
    surface /= np.linalg.norm(surface, axis=1, keepdims=True)
    points = so3.rotate(attitude, body.centre + body.semi_axes * surface)
    assert own == pytest.approx((points @ outward).max(), abs=2e-3)
    assert own <= extent_of_thrust(FloatOps, body.revolved, tuple(2.0 * np.array(z)))(outward) + 1e-12
    round_body = ab.Ellipsoid((0.2, 0.2, 0.05), (0.0, 0.0, 0.03))
    assert extent_of_thrust(FloatOps, round_body.revolved, tuple(z))(outward) == pytest.approx(
        extent_of_attitude(FloatOps, round_body, (x, y, z))(outward)
    )


def upright_passage(gate: ab.Gate, body: ab.Ellipsoid, times: Array, position: list[Array]) -> ab.Passage:
    """The passage of a body that is moved without turning."""
    states = np.column_stack(position), np.zeros((len(times), 3)), np.tile(so3.IDENTITY, (len(times), 1))
    planned = PlannedPassage(gate, CROSSING, gate.up)
    rows = log_rows(times, *states)
    return passages_in_log(rows, (planned,), body, np.array([np.nan]))[0].of_flight(0)


def test_who_slides_along_the_plane_into_the_opening_has_hit_the_frame() -> None:
    """Up along the plane, half of the body in it, and through the centre: the lower edge was in the way."""
    gate, times = ab.tilted_gate((0.0, 0.0, 0.0)), np.arange(0.0, 1.0, 1 / RATE)
    beyond = -0.1 + 0.4 * np.maximum(times - 0.25, 0.0) + np.maximum(times - CROSSING, 0.0)
    along = np.minimum(2 * times - 1, 0)
    passage = upright_passage(gate, QUAD.bounding_ellipsoid, times, [beyond, 0 * times, along])
    assert passage.miss < 0.01
    assert passage.closest_edge == "lower"
    assert passage.closest_time < CROSSING - 0.2
    assert passage.failure is not None
    assert passage.failure.outcome is Outcome.HIT_FRAME


def test_a_start_in_a_gate_s_plane_three_metres_beside_it_is_no_hit_of_its_frame() -> None:
    """The small body leaves the plane there, passes the frame 4 cm before it, and then goes through."""
    gate = ab.tilted_gate((0.0, 0.0, 0.0))
    times, corners = np.linspace(0.0, 1.0, 501), [0.0, 0.1, 0.45, 0.55, 1.0]
    beyond = np.interp(times, corners, [0.0, -0.04, -0.04, 0.04, 0.4])
    left = np.interp(times, corners, [3.0, 3.0, 0.0, 0.0, 0.0])
    passage = upright_passage(gate, ab.Ellipsoid([0.02] * 3), times, [beyond, left, 0.0 * times])
    assert passage.inside
    assert passage.failure is None
    assert passage.clearance == pytest.approx(gate.height / 2 - 0.02)


def test_how_far_beside_a_gate_a_body_came_into_its_plane_is_not_how_far_it_hit_the_frame() -> None:
    gate, times = ab.tilted_gate((0.0, 0.0, 0.0)), np.linspace(0.0, 1.0, 501)
    beyond = np.interp(times, [0.0, CROSSING, 1.0], [-0.1, 0.0, 1.0])
    along = np.interp(times, [0.0, CROSSING, 1.0], [-3.0, 0.0, 0.0])
    passage = upright_passage(gate, QUAD.bounding_ellipsoid, times, [beyond, 0.0 * times, along])
    assert passage.failure is not None
    assert passage.failure.outcome is Outcome.HIT_FRAME
    extent = QUAD.bounding_ellipsoid.semi_axes.max() + np.linalg.norm(QUAD.bounding_ellipsoid.centre)
    assert -passage.clearance < 2.0 * extent + np.hypot(gate.width, gate.height) / 2 - gate.height / 2
    assert passage.closest_time > 0.25


def test_contact_is_said_with_its_edge_and_its_instant() -> None:
    path, problem = cruise(1.12)
    flight = ab.fly(path, QUAD)
    result = ab.score(flight, problem, QUAD)
    depth = QUAD.bounding_ellipsoid.semi_axes[2] - 0.03
    assert result.outcome is Outcome.HIT_FRAME
    assert result.sentence == f"hit the frame of the gate, {100 * depth:.1f} cm into its lower edge at 0.50 s"
    plan = ab.Plan(problem, path, "by hand", vehicle=QUAD)
    (facts,) = plain(Report(plan, result))["flight"]["passages"]
    assert facts["closest_edge"] == "lower"
    assert (facts["closest_lateral"], facts["closest_up"]) == pytest.approx((0.0, -0.15), abs=1e-3)
    (unknown,) = plain(Report(plan, ab.score(flight, problem)))["flight"]["passages"]
    assert unknown["clearance"] is unknown["closest_edge"] is unknown["needed_width"] is None


@pytest.mark.parametrize("engine", ["floats", "compiled"])
def test_in_a_batch_each_vehicle_has_its_own_body(engine: str) -> None:
    path, problem = cruise()
    bodies = [ab.Ellipsoid((0.25, 0.25, height)) for height in (0.05, 0.1, 0.2)]
    vehicles = [replace(QUAD, body=body) for body in bodies]
    scores = ab.score_flights(path, vehicles, problem=problem, engine=engine)
    np.testing.assert_allclose(scores.passages[0].clearance, [0.1, 0.05, -0.05], atol=1e-6)
    for k, vehicle in enumerate(vehicles):
        flight = ab.fly(path, vehicle)
        assert np.isnan(ab.score(flight, problem).passages[0].clearance)
        alone = ab.score(flight, problem, vehicle).passages[0]
        assert scores[k].passages[0].clearance == pytest.approx(alone.clearance, abs=1e-12)


@given(seeds)
@examples(30, few=12)
def test_a_coarse_log_finds_what_a_fine_one_finds(seed: int) -> None:
    """Within a millimetre, turning by up to 14 rad/s at up to 10 m/s."""
    one = motion(seed)
    assert one.passage().clearance == pytest.approx(one.passage(40 * RATE).clearance, abs=1e-3)


def test_a_plan_whose_own_flight_touches_the_frame_does_not_fly_and_says_where() -> None:
    path, problem = cruise(1.12)
    stages = (ab.Stage("gate", gate="gate"),)
    problem = replace(problem, maneuver=ab.CustomManeuver(stages))
    placed = (PlacedStage("gate", 0, 0.5, "gate"),)
    plan = ab.Plan(problem, path, "by hand", stages=placed, vehicle=QUAD)
    assert plan.flyability is not None
    assert not plan.flies
    assert plan.flyability.misses_gate
    assert not plan.flyability.wants_reserve
    assert "1.3 cm into its lower edge at 0.50 s" in str(plan.flyability)
    clearance = ab.score(ab.fly(plan), plan).passages[0].clearance
    assert plan.flyability.passages[0].clearance == pytest.approx(clearance, abs=1e-12)
    assert plain(Report(plan))["plan"]["flyability"]["passages"][0]["clearance_m"] == pytest.approx(clearance)


@pytest.mark.slow
def test_a_flip_that_would_slide_along_its_gate_s_plane_is_planned_straighter_through_it() -> None:
    """It would be half in the plane for 0.4 s, 1.6 m below the opening at first."""
    case = random_case(0, 42, ("flip", "half-flip"))
    plan = ab.plan(case.problem, vehicle=case.vehicle)
    assert plan.flies
    assert ab.score(ab.fly(plan), plan).passages[0].clearance > 0.0
