"""Wandering bodies about gates: judged tick by tick as from the whole log, and as geometry has it."""

from __future__ import annotations

from dataclasses import asdict
from operator import itemgetter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import tree_map
from aerobat.kernels.gates import progress
from aerobat.kernels.gates.snapshot import Transition
from aerobat.problem.ball import Ball
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint
from aerobat.simulation import Outcome
from aerobat.simulation.metrics import Criteria, metrics_of_log
from aerobat.simulation.passages import (
    Passage,
    WaypointPassage,
    log_rows,
    passages,
    passages_in_log,
    waypoint_passages,
)
from aerobat.simulation.passages.passage import PASSAGE_WINDOW, bounding_ellipsoid, gate_places
from aerobat.simulation.passages.stages import MISS_TOLERANCE
from gate_motions import CRUISE, SPEED
from polyline_judge import gate_progress
from score_cases import QUAD
from suites import examples

FLIGHTS, TICKS, LOGGED = 40, 300, 8
TIMES = np.linspace(0.0, 1.0, TICKS)  # [s]
PENTAGON = np.array([[0.9, 0.1], [0.3, 0.8], [-0.7, 0.5], [-0.5, -0.6], [0.4, -0.7]])  # [m] in no symmetry
OPENINGS: tuple[dict[str, Any], ...] = (
    {"width": 1.6, "height": 1.1},
    {"width": None, "height": None, "radius": 0.7},
    {"width": None, "height": None, "polygon": PENTAGON},
)
seeds = st.integers(0, 2**32 - 1)


def random_gate(rng: np.random.Generator, opening: dict[str, Any]) -> ab.Gate:
    return ab.tilted_gate(rng.normal(size=3), *rng.uniform(-1.5, 1.5, 3), **opening)


def wandering(rng: np.random.Generator, gate: ab.Gate) -> tuple[Array, Array, Array]:
    """Positions, velocities and attitudes, (TICKS, FLIGHTS, ·): to and fro through the plane, and turning."""
    rates = rng.uniform(2.0, 18.0, (3, FLIGHTS, 2))  # [rad/s]
    phases = rng.uniform(0.0, 2.0 * np.pi, (3, FLIGHTS, 2))
    sizes = rng.uniform(0.02, 0.5, (3, FLIGHTS, 2))
    waves = phases + TIMES[:, None, None, None] * rates
    along = (sizes * np.sin(waves)).sum(axis=-1) + rng.uniform(-0.2, 0.2, (3, FLIGHTS))
    velocity = (sizes * rates * np.cos(waves)).sum(axis=-1)
    axes = np.stack([gate.normal, gate.lateral, gate.up])
    turns = TIMES[:, None, None] * rng.uniform(-9.0, 9.0, (FLIGHTS, 3))
    attitude = so3.multiply(so3.exp(rng.normal(size=(FLIGHTS, 3))), so3.exp(turns))
    return (
        gate.position + np.moveaxis(along, 1, -1) @ axes,
        np.moveaxis(velocity, 1, -1) @ axes,
        attitude,
    )


def tick_by_tick(
    planned: PlannedPassage, states: tuple[Array, Array, Array], body: ab.Ellipsoid, ends: Array
) -> Passage:
    """Passages of flights of which ticks from `ends` on do not count, by the kernel."""
    [place] = gate_places((planned,), bounding_ellipsoid(body))
    found = tree_map(lambda leaf: np.full(FLIGHTS, leaf, dtype=float), progress.init(place))
    rows = log_rows(np.broadcast_to(TIMES[:, None], (TICKS, FLIGHTS)), *states)
    last = now = tree_map(lambda leaf: leaf[0], rows)
    for k in range(TICKS):
        last, now = now, tree_map(itemgetter(k), rows)
        transition = Transition(last, now, np.full(FLIGHTS, k > 0), k < ends)
        with np.errstate(invalid="ignore"):  # 0/0, of what is not selected
            found = progress.step(ArrayOps, found, place, transition)
    return passages(planned, found, np.where(ends < TICKS, TIMES[ends - 1], np.nan))


@pytest.mark.parametrize(
    "opening",
    [
        pytest.param(OPENINGS[0], id="rectangle", marks=pytest.mark.slow),
        pytest.param({"width": 0.1, "height": 0.2}, id="slot"),  # which most flights are far beside of
        pytest.param(OPENINGS[1], id="circle", marks=pytest.mark.slow),
        pytest.param(OPENINGS[2], id="pentagon", marks=pytest.mark.slow),
    ],
)
@given(seeds)
@examples(2)
def test_a_gate_is_judged_tick_by_tick_as_from_the_whole_flight_at_once(
    opening: dict[str, Any], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    gate = random_gate(rng, opening)
    body = ab.Ellipsoid(rng.uniform(0.02, 0.3, 3), rng.uniform(-0.05, 0.05, 3))
    planned = PlannedPassage(gate, rng.uniform(0.1, 0.9), gate.up)
    states = wandering(rng, gate)
    ends = np.where(rng.random(FLIGHTS) < 0.3, rng.integers(2, TICKS, FLIGHTS), TICKS)
    streamed = tick_by_tick(planned, states, body, ends)
    crossed = 0
    for k, end in enumerate(ends):
        log = [part[:end, k] for part in states]
        stop = np.array([TIMES[end - 1] if end < TICKS else np.nan])
        others = [passages(planned, gate_progress(planned, TIMES[:end], log, body), stop)]
        if k < LOGGED:
            others += passages_in_log(log_rows(TIMES[:end], *log), (planned,), body, stop)
        one = asdict(streamed.of_flight(k))
        crossed += bool(np.isfinite(one["time"]))
        edge = one.pop("closest_edge")
        for other in (asdict(each.of_flight(0)) for each in others):
            assert edge == other.pop("closest_edge")
            assert one == pytest.approx(other, abs=1e-9, nan_ok=True)
    assert crossed > 0


@pytest.mark.parametrize("opening", OPENINGS, ids=("rectangle", "circle", "pentagon"))
@given(seeds)
@examples(40)
def test_a_ball_straight_through_a_gate_is_nearest_to_its_frame_where_geometry_has_it(
    opening: dict[str, Any], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    gate = random_gate(rng, opening)
    aside, radius = rng.uniform(-1.0, 1.0, 2), rng.uniform(0.02, 0.2)
    position = gate.position + aside @ gate.plane_axes + np.outer(4.0 * (TIMES - 0.5), gate.normal)
    velocity, attitude = np.tile(4.0 * gate.normal, (TICKS, 1)), np.tile(so3.IDENTITY, (TICKS, 1))
    planned = PlannedPassage(gate, 0.5, gate.up)
    states = position, velocity, attitude
    rows, body = log_rows(TIMES, *states), ab.Ellipsoid((radius, radius, radius))
    passage = passages_in_log(rows, (planned,), body, np.array([np.nan]))[0].of_flight(0)
    depth, nearest = depth_in(opening, aside)
    assert (passage.lateral, passage.up) == pytest.approx(tuple(aside), abs=1e-9)
    assert passage.inside == (depth > 0.0)
    outcome = passage.failure and passage.failure.outcome
    if depth <= 0.0:
        assert outcome is Outcome.MISSED_GATE
        return
    assert outcome is (Outcome.HIT_FRAME if passage.clearance < 0.0 else None)
    coarse = 2e-3 * opening.get("radius", 0.0)  # a circle is measured in so many directions
    assert -1e-9 <= passage.clearance - (depth - radius) <= 1e-9 + coarse
    closest = np.array([passage.closest_lateral, passage.closest_up])
    assert np.linalg.norm(closest - nearest) < 1e-6 + 50.0 * coarse


def waypoint_passage(flight: ab.Flight, planned: PlannedWaypoint) -> WaypointPassage:
    """The passage of a flight by a waypoint."""
    [found] = metrics_of_log(flight, Criteria(waypoints=(planned,)), None).waypoints
    return waypoint_passages(planned, found, flight.diverged_at).of_flight(0)


def depth_in(opening: dict[str, Any], point: Array) -> tuple[float, Array]:
    """How deep [m] a point (left, up) lies in an opening, and the nearest of its edge to a point inside."""
    if "radius" in opening:
        distance = np.linalg.norm(point)
        return opening["radius"] - distance, opening["radius"] * point / distance
    half = 0.5 * np.array([opening["width"] or 0.0, opening["height"] or 0.0])
    corners = opening.get("polygon", half * [[1, 1], [-1, 1], [-1, -1], [1, -1]])
    along = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
    depths = ((corners - point) * outward).sum(axis=1)
    k = int(np.argmin(depths))
    return float(depths[k]), point + depths[k] * outward[k]


@given(st.floats(-0.9, 0.9), st.floats(0.0, 2.0), st.floats(0.05, 1.0), st.floats(0.0, 2 * np.pi))
@examples(40)
def test_a_waypoint_is_judged_by_the_nearest_approach_within_its_window(
    late: float, aside: float, radius: float, turn: float
) -> None:
    """Of a flight straight on, `late` after it was planned to come by."""
    flight = ab.fly(CRUISE, QUAD)
    centre = np.array([SPEED, aside * np.cos(turn), 1.0 + aside * np.sin(turn)])
    planned = PlannedWaypoint("point", Ball(centre, radius), 1.0 - late)
    passage = waypoint_passage(flight, planned)
    beyond = max(abs(late) - PASSAGE_WINDOW, 0.0)  # [s] by which the nearest is outside of the window
    step = flight.times[1] - flight.times[0]
    assert passage.time == pytest.approx(1.0 - np.sign(late) * beyond, abs=2e-3 + step)
    distance = np.hypot(aside, SPEED * beyond)
    assert passage.miss == pytest.approx(distance, abs=SPEED * (2e-3 + step))
    assert passage.speed == pytest.approx(SPEED, rel=1e-3)
    assert (passage.failure is None) == (passage.miss <= radius + MISS_TOLERANCE)
    if beyond == 0.0:
        assert passage.miss == pytest.approx(aside, abs=2e-3)


def test_a_waypoint_missed_by_more_than_what_grazes_it_is_missed() -> None:
    flight = ab.fly(CRUISE, QUAD)
    for beyond, failure in ((0.5 * MISS_TOLERANCE, None), (2.0 * MISS_TOLERANCE, Outcome.MISSED_WAYPOINT)):
        planned = PlannedWaypoint("point", Ball(np.array([SPEED, 0.0, 1.3]), 0.3 - beyond), 1.0)
        passage = waypoint_passage(flight, planned)
        assert (passage.failure and passage.failure.outcome) is failure
