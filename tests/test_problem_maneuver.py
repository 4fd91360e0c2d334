"""Maneuvers are lists of stages that say what the paper's equations say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.errors import SpecError
from aerobat.problem import (
    Condition,
    CustomManeuver,
    Flip,
    GatePassage,
    HalfFlip,
    Line,
    Quantity,
    Stage,
    StageSequence,
    load_problem,
    tilted_gate,
)

G = 9.81


def holds(stage: Stage, acceleration: np.ndarray) -> bool:
    """Whether the stage's conditions on the thrust hold at an acceleration."""
    thrust = np.add(acceleration, [0.0, 0.0, G])
    return all(
        c.lower - 1e-9 <= c.direction @ thrust <= c.upper + 1e-9
        for c in stage.conditions
        if c.quantity is Quantity.SPECIFIC_THRUST
    )


def flip_of_the_paper() -> StageSequence:
    problem = load_problem("flip-roll").as_in_paper()
    return problem.stages(50.0)


accelerations = st.tuples(*[st.sampled_from([-40.0, -25.0, -18.0, 0.0, 18.0, 30.0])] * 3)


@given(accelerations)
def test_the_flip_in_paper_mode_is_the_papers_section_ii_a(thrust: tuple[float, float, float]) -> None:
    """Its stages hold exactly where the paper's implications do, on a grid that hits the equalities."""
    x, y, z = thrust  # of a + g e3
    acceleration = np.array([x, y, z - G])
    stages = flip_of_the_paper().stages
    paper = [y == z, z == 0 and y >= 18, z <= -25 and y == 0, z == 0 and y <= -18, y == -z]
    assert [holds(s, acceleration) for s in stages] == paper


def test_the_paper_imposes_no_order_and_fixes_only_the_gate() -> None:
    course = flip_of_the_paper()
    assert not course.ordered
    assert [s.fixed_interval(20) for s in course.stages] == [None, None, 10, None, None]


def test_a_flip_of_ours_meets_its_gate_half_way_squarely_and_in_its_direction() -> None:
    problem = load_problem("flip-roll")
    gate = problem.stages(50.0).stages[2]
    assert gate.fixed_interval(20) == 9  # ends at half the duration
    velocity = {tuple(c.direction): (c.lower, c.upper) for c in gate.conditions if c.quantity == "velocity"}
    assert velocity[(0.0, 1.0, 0.0)] == (0.0, np.inf)
    assert sorted(velocity.values()) == [(0.0, 0.0), (0.0, 0.0), (0.0, np.inf)]


@given(st.floats(-180, 180), st.floats(10.0, 60.0))
def test_a_flip_asks_the_same_turn_about_any_horizontal_axis(axis_deg: float, thrust: float) -> None:
    gate = tilted_gate(np.zeros(3), tilt=np.pi)
    axis = np.deg2rad(axis_deg)
    spun = so3.about_axis(np.array([0, 0, 1.0]), axis)
    reference = Flip(0.0).stage_sequence([gate], thrust)
    turned = Flip(axis_deg).stage_sequence([gate], thrust)
    for a, b in zip(reference.stages, turned.stages, strict=True):
        for ca, cb in zip(a.conditions, b.conditions, strict=True):
            if ca.quantity is Quantity.SPECIFIC_THRUST:
                np.testing.assert_allclose(so3.rotate(spun, ca.direction), cb.direction, atol=1e-9)
                assert (ca.lower, ca.upper) == (cb.lower, cb.upper)


def test_signed_stages_refuse_the_inverted_thrust_that_the_papers_accept() -> None:
    signed = load_problem("flip-roll")
    first = signed.stages(50.0).stages[0]
    upright, inverted = np.array([0, 30.0, 30.0 - G]), np.array([0, -30.0, -30.0 - G])
    assert holds(first, upright)
    assert not holds(first, inverted)
    assert holds(flip_of_the_paper().stages[0], inverted)


@given(st.floats(5.0, 85.0), st.floats(18.0, 60.0), st.floats(-5.0, 5.0))
def test_the_half_flip_ties_lateral_to_vertical_thrust_by_the_tangent_of_the_tilt(
    tilt_deg: float, lateral: float, along: float
) -> None:
    """(a_z + g) tan α = a_y, a_y ≥ ε_y; our tilt is to the right, the paper's α to the left."""
    tilt = np.deg2rad(tilt_deg)
    gate = tilted_gate(np.zeros(3), tilt=tilt)
    (stage,) = HalfFlip(min_lateral_thrust=18.0).stage_sequence([gate], 50.0).stages
    fitting = np.array([along, -lateral, lateral / np.tan(tilt) - G])
    assert holds(stage, fitting)
    assert not holds(stage, np.add(fitting, [0, 0, 1.0]))
    assert not holds(stage, np.array([along, -17.9, 17.9 / np.tan(tilt) - G]))


def test_the_half_flip_never_turns_over() -> None:
    problem = load_problem("half-flip")
    (always,) = problem.stages(50.0).path_constraints
    assert (always.quantity, always.lower) == (Quantity.SPECIFIC_THRUST, 0.0)
    np.testing.assert_array_equal(always.direction, [0.0, 0.0, 1.0])


def test_a_line_asks_nothing_but_the_gate_it_may_have() -> None:
    assert Line().stage_sequence([], 50.0).stages == ()
    (stage,) = Line().stage_sequence([tilted_gate(np.ones(3))], 50.0).stages
    assert {c.quantity for c in stage.conditions} == {Quantity.POSITION, Quantity.VELOCITY}


def test_a_spelled_out_maneuver_may_pass_the_problems_gate() -> None:
    gate = tilted_gate(np.ones(3))
    kick = Stage("kick", (Condition("specific_thrust", (1.0, 0.0, 0.0), lower=5.0),))
    course = CustomManeuver((kick, Stage("gate", (), 0.4, gate="gate"))).stage_sequence([gate], 50.0)
    assert course.stages[0] is kick
    assert (course.stages[1].gate, course.stages[1].at) == (gate.name, 0.4)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Flip(axis_deg=np.inf),
        lambda: Flip(min_lateral_thrust=-1.0),
        lambda: Flip(min_inverted_thrust=0.0),
        lambda: HalfFlip(min_lateral_thrust=np.nan),
        lambda: HalfFlip(18.0).stage_sequence([tilted_gate(np.zeros(3))], 50.0),
        lambda: HalfFlip().stage_sequence([tilted_gate(np.zeros(3), tilt=np.pi)], 50.0),
        lambda: Flip().stage_sequence([], 50.0),
        lambda: Condition("position", (0.0, 0.0, 0.0), 0.0),
        lambda: Condition("velocity", (1.0, 0.0, 0.0), 2.0, 1.0),
        lambda: Stage("late", (), at=1.0),
        lambda: GatePassage(speed=-1.0),
    ],
)
def test_a_maneuver_that_cannot_be_is_refused(wrong) -> None:
    with pytest.raises(SpecError):
        wrong()
