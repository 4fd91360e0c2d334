"""Room for the body in gates: paths that hit a frame are mended, by all planners; slopes of room."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.planning import FreeKnots, Miqp, Planner, TimeOptimal, plan
from aerobat.planning.gate_clearance import bodies_in_gates
from aerobat.planning.miqp.refinement.room_rows import RoomRows
from aerobat.problem import Course, PassGate, Problem, at_rest, load_problem, tilted_gate
from aerobat.problem.condition import ForceBalance
from aerobat.vehicle import load_vehicle
from places import CASES

QUAD = load_vehicle("agile-quad")
COURSE = load_problem(str(CASES / "frame-course.toml"))


@pytest.mark.parametrize(
    "planner",
    [
        Miqp(),
        *(pytest.param(each, marks=pytest.mark.slow) for each in (FreeKnots(), TimeOptimal(starts=2))),
    ],
    ids=lambda planner: type(planner).__name__,
)
def test_gates_crossed_anywhere_in_their_openings_are_passed_clear_of_their_frames(planner: Planner) -> None:
    """The crossing point stayed where it was, at the edge of the opening, and left no room: 23 cm into it."""
    found = plan(COURSE, planner, QUAD)
    assert found.certified
    assert found.flies, found.flyability


def test_a_path_with_room_in_a_gate_settles_though_steps_miss_what_stages_ask_by_rounding() -> None:
    assert plan(load_problem(str(CASES / "settled-course.toml")), Miqp(), QUAD).flies


@pytest.mark.parametrize("shape", [{"radius": 0.6}, {"polygon": ((0.8, -0.6), (0.0, 1.0), (-0.8, -0.6))}])
def test_openings_of_any_shape_may_have_room_for_the_body(shape: dict[str, object]) -> None:
    """Where such a gate is crossed anywhere more than three conditions say where."""
    gates = [tilted_gate((2.0 * k, 0.0, 1.0), name=f"{k}") for k in (1, 2)]
    shaped = tuple(replace(gate, width=None, height=None, **shape) for gate in gates)
    course = Course(tuple(PassGate(gate.name, crossing_point="free") for gate in gates))
    problem = Problem("shapes", at_rest((0.0, 0.0, 1.0)), at_rest((6.0, 0.0, 1.0)), course, shaped)
    stages = problem.stages(QUAD.max_specific_thrust, QUAD.body_radius).stages
    assert [body.stage for body in bodies_in_gates(stages, problem, QUAD, everywhere=True)] == [0, 1]
    assert not bodies_in_gates(stages, problem, QUAD)


def test_slopes_of_room_are_its_differences() -> None:
    stages = COURSE.stages(QUAD.max_specific_thrust, QUAD.body_radius).stages
    rng = np.random.default_rng(0)
    balance = ForceBalance(drag=0.3, wind=np.array([1.0, -0.5, 0.2]))
    room = RoomRows(bodies_in_gates(stages, COURSE, QUAD, everywhere=True), QUAD.bounding_ellipsoid, balance)
    derivatives = rng.normal(size=(3, 6, 3))
    for body in room.in_gates:
        derivatives[body.stage, 0] += body.gate.position
        derivatives[body.stage, 1] += 3.0 * body.gate.normal
    change = 1e-6 * rng.normal(size=derivatives.shape)
    crossing, slopes = room.slopes(derivatives)
    assert set(crossing.tolist()) == {0, 1, 2}
    foreseen = np.sum(slopes * change[crossing], axis=(1, 2))
    moved = (room.values(derivatives + change) - room.values(derivatives - change)) / 2.0
    np.testing.assert_allclose(moved, foreseen, rtol=1e-5, atol=1e-10)
