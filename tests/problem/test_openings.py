"""Openings of gates: rectangles, circles and convex polygons, planned, judged and drawn as the same shape."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.arrays import Array
from aerobat.certification import Envelope, Verdict
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError
from aerobat.evaluation.opening import opening_of
from aerobat.planning.passages import require_openings
from aerobat.problem.gate import in_opening
from aerobat.problem.opening import Circle, OpeningShape, Polygon, Rectangle
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.reporting.scene.glyphs import gate_bars
from aerobat.simulation.plants.mujoco import _frame_bars
from gate_motions import motion
from score_cases import QUAD
from suites import examples

seeds = st.integers(0, 2**32 - 1)
TRIANGLE = ((0.6, -0.5), (0.0, 0.7), (-0.6, -0.5))
HEXAGON = tuple((0.5 * np.cos(a), 0.5 * np.sin(a)) for a in np.arange(6) * np.pi / 3)


def drawn_polygon(rng: np.random.Generator) -> Array:
    """Corners in order around an ellipse that holds the origin, none next to another."""
    count = int(rng.integers(3, 9))
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.2, 0.2, count)) / count
    return np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(0.3, 1.0, 2)


def drawn(seed: int) -> OpeningShape:
    """An opening of any kind."""
    rng = np.random.default_rng(seed)
    kinds = (
        lambda: Rectangle(*rng.uniform(0.3, 1.5, 2)),
        lambda: Circle(rng.uniform(0.2, 0.8)),
        lambda: Polygon(drawn_polygon(rng)),
    )
    return kinds[int(rng.integers(3))]()


def points_about(opening: OpeningShape, rng: np.random.Generator) -> Array:
    """Points in and around it [m], (500, 2)."""
    return rng.uniform(-0.7, 0.7, (500, 2)) * opening.size


@given(seeds)
@examples(60)
def test_what_is_left_at_a_clearance_is_as_deep_inside_and_all_that_is_but_at_a_circle_s_rim(
    seed: int,
) -> None:
    opening, rng = drawn(seed), np.random.default_rng([seed, 1])
    clearance = rng.uniform(0.0, 0.95) * opening.inradius
    bounds = opening.at_clearance(clearance)
    points = points_about(opening, rng)
    along = points @ bounds.directions.T
    left = ((bounds.lower <= along) & (along <= bounds.upper)).all(axis=1)
    assert (opening.depth(points[left]) >= clearance - 1e-12).all()
    rim = 0.01 * opening.inradius if isinstance(opening, Circle) else 1e-12
    assert left[opening.depth(points) >= clearance + rim].all()


@given(seeds)
@examples(30)
def test_too_narrow_an_opening_leaves_a_place_as_deep_as_any_along_the_axis_that_is_too_narrow(
    seed: int,
) -> None:
    opening = drawn(seed)
    bounds = opening.at_clearance(1.001 * opening.inradius)
    place = (bounds.lower + bounds.upper) / 2
    assert np.abs(bounds.directions - np.eye(2)).max() == 0.0
    assert opening.depth(place) == pytest.approx(opening.inradius, abs=1e-9)
    assert (bounds.lower == bounds.upper).any()


@given(seeds)
@examples(40)
def test_an_ellipse_that_is_admitted_lies_inside_somewhere_and_one_a_hair_larger_than_the_least_does_not(
    seed: int,
) -> None:
    """Scaled until it is admitted just so; about the best of many places no point of it is outside."""
    opening, rng = drawn(seed), np.random.default_rng([seed, 1])
    turn = rng.uniform(0.0, np.pi)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * rng.uniform(
        0.2, 1, (2, 1)
    )
    low, high = 0.0, 10.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if opening.admits(middle**2 * axes.T @ axes) else (low, middle)
    angle = np.linspace(0.0, 2 * np.pi, 400)
    rim = low * np.column_stack([np.cos(angle), np.sin(angle)]) @ axes
    places = [*np.zeros((1, 2)), *(0.5 * points_about(opening, rng))]
    depth = max(float(opening.depth(place + rim).min()) for place in places)
    assert depth <= 1e-3 * low
    assert opening.admits_turned(*np.sort(low * np.linalg.norm(axes, axis=1)).tolist())


@given(seeds)
@examples(40)
def test_the_frame_lies_outside_and_its_bars_leave_no_way_out(seed: int) -> None:
    opening = drawn(seed)
    gate = replace(ab.tilted_gate((1.0, 2.0, 3.0), 0.3, 0.2, 0.5), **opening.fields())
    rings = gate.outline, gate.frame(0.05)
    on_edge, outside = ((points - gate.position) @ gate.plane_axes.T for points in rings)
    np.testing.assert_allclose(opening.depth(on_edge), 0.0, atol=1e-12)
    assert (opening.depth(outside) < -0.045).all()
    assert len(gate_bars(gate)) == len(gate.outline)
    parts = np.linspace(0.0, 1.0, 9)[:, None, None]
    around = (on_edge + parts * (np.roll(on_edge, -1, axis=0) - on_edge)).reshape(-1, 2)
    bars = list(_frame_bars(gate))
    for scale, in_frame in ((0.99, False), (1.01, True)):
        points = gate.position + scale * around @ gate.plane_axes
        assert (np.any([_holds(gate, bar, points) for bar in bars], axis=0) == in_frame).all()


def _holds(gate: ab.Gate, bar: tuple[Array, Array, tuple[float, float, float]], points: Array) -> Array:
    """True for points in a bar of a frame."""
    centre, outward, half = bar
    axes = np.array([gate.normal, outward, np.cross(gate.normal, outward)])
    return np.asarray((np.abs((points - centre) @ axes.T) <= half).all(axis=1))


@given(seeds)
@examples(30)
def test_a_rectangle_given_by_its_corners_is_judged_as_that_rectangle(seed: int) -> None:
    one = motion(seed)
    corners = one.gate.opening.outline
    other = replace(one, gate=replace(one.gate, width=None, height=None, polygon=corners[::-1]))
    expected, found = one.passage(), other.passage()
    for name in ("clearance", "closest_time", "closest_lateral", "closest_up"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), abs=2e-3)
    assert found.clearance == pytest.approx(expected.clearance, abs=2e-4)
    assert found.closest_edge == expected.closest_edge
    assert found.inside == expected.inside


@given(seeds)
@examples(30)
def test_turning_a_regular_opening_onto_itself_changes_nothing(seed: int) -> None:
    """A hexagon by a sixth of a turn, a circle by as much as one likes, but for a part of its radius."""
    one = motion(seed)
    turn = np.random.default_rng([seed, 1]).uniform(0.0, 2 * np.pi)
    for fields, tilt, off in (({"polygon": HEXAGON}, np.pi / 3, 1e-9), ({"radius": 0.5}, turn, 2e-3 * 0.5)):
        gate = replace(one.gate, width=None, height=None, **fields)
        turned = ab.tilted_gate(gate.position, *_tilted(gate, tilt), **fields)
        before, after = (replace(one, gate=each).passage() for each in (gate, turned))
        assert after.clearance == pytest.approx(before.clearance, abs=off)


def _tilted(gate: ab.Gate, tilt: float) -> tuple[float, float, float]:
    heading, elevation, before = gate.angles
    return heading, elevation, float(np.mod(before + tilt, 2 * np.pi))


@given(seeds)
@examples(30)
def test_a_sphere_leaves_of_a_circle_what_the_farthest_of_its_shadow_leaves(seed: int) -> None:
    """On a straight path the shadow is an ellipse, r √(1 + (v_t/v_n)²) along that in the plane."""
    drawn_motion = motion(seed)
    radius = float(drawn_motion.body.semi_axes[0])
    gate = replace(drawn_motion.gate, width=None, height=None, radius=0.5)
    body = ab.Ellipsoid([radius] * 3)
    one = replace(drawn_motion, gate=gate, body=body, acceleration=np.zeros(3))
    along = gate.plane_axes @ one.velocity
    speed = np.linalg.norm(along)
    axes = np.array([along / speed, [-along[1] / speed, along[0] / speed]])
    stretch = np.diag([np.hypot(1.0, speed / (one.velocity @ gate.normal)), 1.0])
    angle = np.linspace(0.0, 2 * np.pi, 20_000)
    shadow = radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ stretch @ axes
    farthest = float(np.linalg.norm(gate.plane_axes @ one.offset + shadow, axis=1).max())
    found = one.passage().clearance
    assert -1e-8 <= found - (0.5 - farthest) <= 2e-3 * 0.5


@given(seeds)
@examples(30)
def test_files_hold_every_opening_exactly(seed: int) -> None:
    gate = replace(ab.tilted_gate((1.0, 2.0, 3.0)), **drawn(seed).fields())
    table = to_table(gate)
    assert from_table(ab.Gate, table) == gate
    assert sum(key in table for key in ("width", "radius", "polygon")) == 1


def test_a_circle_may_be_given_by_its_diameter() -> None:
    assert from_table(ab.Gate, {"position": [0, 0, 1], "diameter": 0.9}).opening.inradius == 0.45


STAR = [(np.cos(a), np.sin(a)) for a in np.arange(5) * 4 * np.pi / 5]


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        (
            {"radius": 0.4, "width": 1.0},
            "radius stands beside width, an opening of another kind",
        ),
        ({"radius": 0.4, "polygon": TRIANGLE}, "polygon stands beside radius, an opening of another kind"),
        ({"radius": 0.0}, "radius must be positive"),
        ({"diameter": 0.8, "radius": 0.4}, "diameter stands beside radius; give one or the other"),
        ({"diameter": -0.8}, "diameter must be positive, got -0.8"),
        ({"polygon": TRIANGLE[:2]}, "polygon must have from 3 to 24 corners, got 2"),
        ({"polygon": 3}, "polygon must be a list of corners, two numbers each, got 3"),
        ({"polygon": [1.0, 2.0, 3.0]}, r"polygon\[0\] must be 2 numbers, got 1.0"),
        ({"polygon": [*TRIANGLE, (0.0, 0.3)]}, "polygon must be convex, at its corner"),
        ({"polygon": [*TRIANGLE, (0.0, -0.5)]}, r"polygon has its corner \[0, -0.5\] on a line"),
        ({"polygon": [*TRIANGLE, TRIANGLE[0]]}, r"polygon has the corner \[0.6, -0.5\] twice; drop one"),
        ({"polygon": STAR}, "polygon must go around once, its sides cross"),
        ({"polygon": [(1, 0), (2, 0), (1, 1)]}, "polygon must hold the gate's position, .*, inside"),
        ({"polygon": [(1e20, 0), (0, 1e20), (-1, -1)]}, "polygon must have corners within 1e[+]15 m"),
    ],
)
def test_an_opening_that_cannot_be_is_refused_in_a_sentence(fields: dict, sentence: str) -> None:
    with pytest.raises(SpecError, match=f"^{sentence}"):
        from_table(ab.Gate, {"position": [0.0, 0.0, 0.0]} | fields)


def test_a_gate_that_stands_in_a_round_opening_is_refused() -> None:
    outer = ab.tilted_gate((3.0, 0.0, 1.0), name="outer", radius=1.0)
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((6.0, 0.0, 1.0))
    for place, refused in (((3.0, 0.0, 1.0), True), ((3.0, 1.0, 2.0), False)):
        inner = ab.tilted_gate(place, np.pi / 2, name="inner", polygon=0.5 * np.array(TRIANGLE))
        gates = (outer, inner)
        if refused:
            with pytest.raises(SpecError, match="gate 'inner' stands in the opening of gate 'outer'"):
                ab.Problem("two", *ends, gates=gates)
        else:
            ab.Problem("two", *ends, gates=gates)


@cache
def through(*openings: str) -> ab.Problem:
    """Past gates of some kinds one after another, anywhere in their openings, the last far to the side."""
    fields = {"round": {"radius": 0.5}, "triangle": {"polygon": TRIANGLE}}
    gates = tuple(
        ab.tilted_gate((3.0 * k, (-1.0) ** k, 1.5), name=kind, **fields[kind])
        for k, kind in enumerate(openings, 1)
    )
    passing = tuple(ab.PassGate(kind, crossing_point="free", speed=2.0) for kind in openings)
    return ab.Problem(
        "through",
        ab.at_rest((0.0, 0.0, 1.0)),
        ab.at_rest((3.0 * len(gates) + 3.0, 0.0, 1.5)),
        ab.Course(passing),
        gates,
    )


@pytest.mark.parametrize(
    ("planner", "openings"),
    [
        pytest.param(ab.TimeOptimal(segments=8, starts=1), ("round",), marks=pytest.mark.slow),
        pytest.param(ab.FreeKnots(segments=2), ("triangle",), marks=pytest.mark.slow),
        (ab.Miqp(order=4), ("round", "triangle")),
        pytest.param(ab.TimeOptimal(segments=8, starts=1), ("round", "triangle"), marks=pytest.mark.slow),
        pytest.param(ab.FreeKnots(segments=2), ("round", "triangle"), marks=pytest.mark.slow),
    ],
)
def test_every_planner_passes_round_and_triangular_openings_off_their_centres(
    planner: ab.Planner, openings: tuple[str, ...]
) -> None:
    problem = through(*openings)
    plan = ab.plan(problem, planner, QUAD)
    passages = ab.score(ab.fly(plan), plan).passages
    for passage, gate in zip(passages, problem.gates, strict=True):
        assert passage.inside
        assert passage.miss > 0.1
        assert passage.clearance > -5e-3
        offset = plan.trajectory.evaluate(passage.time) - gate.position
        assert gate.opening.depth(gate.plane_axes @ offset) > QUAD.bounding_ellipsoid.semi_axes[2]


def test_a_batch_judges_round_and_polygonal_openings_as_one_flight_does() -> None:
    problem = through("round", "triangle")
    path = ab.plan(problem, ab.Miqp(order=4), vehicle=None).trajectory
    one = ab.score(ab.fly(path, QUAD), problem, QUAD)
    scores = ab.score_flights(path, [QUAD, QUAD], problem=problem, engine="compiled")
    for found, expected in zip(scores.passages, one.passages, strict=True):
        assert found.clearance == pytest.approx(np.full(2, expected.clearance), abs=1e-4)
        assert list(found.closest_edge) == 2 * [expected.closest_edge]


def test_a_plan_beside_a_round_opening_in_the_corner_of_the_square_about_it_is_not_certified() -> None:
    gate = ab.tilted_gate((0.0, 0.0, 0.0), radius=0.5)
    path = ab.Trajectory([2.0], [[[-1.0, 0.4, 0.4], [2.0, 0.0, 0.0]]])
    for each, certified in ((gate, False), (ab.tilted_gate((0.0, 0.0, 0.0), width=1.0, height=1.0), True)):
        asked = Envelope(passages=(PlannedPassage(each, 1.0, each.up),))
        found = {f.quantity: f for f in ab.certify(path, QUAD, envelope=asked).findings}["inside by"]
        assert (found.verdict is Verdict.HOLDS) == certified
    assert found.value == pytest.approx(0.1)


def test_a_vehicle_too_large_for_a_round_or_polygonal_opening_is_refused_with_its_size() -> None:
    problem = through("round")
    (gate,) = problem.gates
    for opening, size in (
        (Circle(0.2), "is round, 40.00 cm wide and 40.00 cm high"),
        (Polygon(0.05 * np.array(TRIANGLE)), "is a polygon of 3 corners, 6.00 cm wide and 6.00 cm high"),
    ):
        small = replace(problem, gates=(replace(gate, **opening.fields()),))
        with pytest.raises(SpecError, match=f"gate .round. {size}, but the body of agile-quad takes"):
            require_openings(small, QUAD)
    require_openings(problem, QUAD)


def test_the_smallest_opening_is_of_the_gate_s_kind() -> None:
    gate = ab.tilted_gate((0.0, 0.0, 0.0), radius=0.5)
    found = opening_of(np.full(400, 0.8), gate, 0.99, 0.95)
    assert (found.width, found.height, found.scale) == pytest.approx((0.8, 0.8, 0.8))
    assert gate.resized(0.8, 1.0).opening.inradius == pytest.approx(0.4)
    assert len(gate.opening.probes) == 12
    assert len(in_opening(gate, 0.1)) == 13
