"""The frames of gates are certified clear of the whole body, as the flights' judge tells them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.certification import Envelope, Verdict, certify
from aerobat.flatness import reference
from aerobat.problem import Gate, tilted_gate
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.simulation.passages import Passage, log_rows, passages_in_log
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Ellipsoid, Vehicle, load_vehicle
from suites import examples

QUAD = replace(load_vehicle("agile-quad"), body=Ellipsoid((0.25, 0.25, 0.05)))
RATE = 2000.0  # [Hz] of the rows that are judged
SHAPES = (
    {"width": 0.8, "height": 0.5},
    {"radius": 0.45},
    {"polygon": ((0.6, -0.4), (0.0, 0.7), (-0.6, -0.4))},
)


def flown(path: Trajectory, passage: PlannedPassage, vehicle: Vehicle = QUAD) -> Passage:
    """The passage of a vehicle that is all along where the path has it."""
    times = np.linspace(0.0, path.duration, int(RATE * path.duration))
    there = reference(path, vehicle, times).setpoint
    rows = log_rows(times, there.flat.position, there.flat.velocity, there.q_world_body)
    (found,) = passages_in_log(rows, [passage], vehicle.bounding_ellipsoid, np.array([np.nan]))
    return found.of_flight(0)


def bent(seed: int) -> tuple[Trajectory, Gate]:
    """Two seconds through a gate that is tilted, near its edge."""
    rng = np.random.default_rng(seed)
    gate = tilted_gate(rng.normal(size=3), *rng.uniform(-0.6, 0.6, 3), **SHAPES[seed % len(SHAPES)])
    velocity = rng.uniform(1.0, 4.0) * gate.normal + rng.uniform(-0.5, 0.5, 3)
    bends = [rng.uniform(-k, k, 3) for k in (3.0, 3.0)]
    place = gate.position + rng.uniform(-0.35, 0.35, 2) @ gate.plane_axes
    along = [place, velocity, *bends]  # by powers of the time from the crossing
    shifted = np.polynomial.Polynomial(np.array([-1.0, 2.0]))
    powers = [(shifted**k).coef for k in range(4)]
    coefficients = np.zeros((1, 4, 3))
    for k, power in enumerate(powers):
        coefficients[0, : len(power)] += np.outer(power, along[k])
    return Trajectory([2.0], coefficients), gate


@given(st.integers(0, 2**32 - 1))
@examples(60, few=15)
def test_the_certificate_says_of_a_frame_what_the_flights_judge_says(seed: int) -> None:
    path, gate = bent(seed)
    passage = PlannedPassage(gate, 1.0, gate.up)
    (found,) = certify(path, QUAD, envelope=Envelope(passages=(passage,))).frames
    left = flown(path, passage).clearance
    if found.verdict is Verdict.HOLDS:
        assert left > -1e-3
    if found.verdict is Verdict.VIOLATED:
        # planners take the polygon in a circle
        assert left < (0.01 * gate.radius if gate.radius else 1e-3)


@pytest.mark.parametrize("inside", [0.02, -0.02])
def test_the_body_is_clear_of_a_frame_2_cm_in_and_touches_it_2_cm_off(inside: float) -> None:
    level = Trajectory([2.0], [[[-2.0, 0.0, 0.0], [4.0, 0.0, 0.0]]])
    gate = tilted_gate((0.0, 0.0, 0.0), width=0.5 + 2.0 * inside)
    still = replace(QUAD, drag_body=np.zeros(3))
    passage = PlannedPassage(gate, 1.0, gate.up)
    certificate = certify(level, still, envelope=Envelope(passages=(passage,)))
    (found,) = certificate.frames
    assert found.bound == pytest.approx(inside, abs=1e-3)
    assert flown(level, passage, still).clearance == pytest.approx(inside, abs=1e-6)
    assert found.verdict is (Verdict.HOLDS if inside > 0.0 else Verdict.VIOLATED)
    assert certificate.certified == (inside > 0.0)
    if inside < 0.0:
        assert certificate.why == (
            "gate 'gate' clearance -0.02 m of at least 0 m at 1.000 s, 0.02 m below its limit"
        )


def test_what_a_body_does_beside_a_gate_before_it_comes_to_it_says_nothing_of_its_frame() -> None:
    """There it goes through the plane, two metres aside; then back, and through the opening."""
    places = np.array(
        [[-1.0, 2.0], [1.0, 2.0], [1.5, 3.0], [-1.5, 3.0], [-1.5, 0.0], [-0.6, 0.0], [1.0, 0.0]]
    )
    legs = [[[*a, 0.0], [*(b - a), 0.0]] for a, b in pairwise(places)]
    path = Trajectory(np.ones(len(legs)), np.array(legs))
    gate = tilted_gate((0.0, 0.0, 0.0), width=1.0, height=0.6)
    (found,) = certify(path, QUAD, envelope=Envelope(passages=(PlannedPassage(gate, 5.375, gate.up),))).frames
    assert found.verdict is Verdict.HOLDS
    assert 5.0 < found.time < 6.0
