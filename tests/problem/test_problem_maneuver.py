"""Maneuvers are lists of stages that say what the paper's equations say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.errors import SpecError
from aerobat.planning.miqp.miqp import Miqp
from aerobat.problem import (
    Attitude,
    Condition,
    CustomManeuver,
    Flip,
    ForceBalance,
    GatePassage,
    HalfFlip,
    Line,
    Problem,
    Quantity,
    Stage,
    StageSequence,
    at_rest,
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
    anywhere = range(19)
    assert [s.slots(20) for s in course.stages] == [anywhere, anywhere, range(10, 11), anywhere, anywhere]


def test_a_flip_of_ours_meets_its_gate_at_any_time_squarely_and_in_its_direction() -> None:
    problem = load_problem("flip-roll")
    gate = problem.stages(50.0).stages[2]
    assert gate.slots(20) == range(19)
    velocity = {tuple(c.direction): (c.lower, c.upper) for c in gate.conditions if c.quantity == "velocity"}
    assert velocity[(0.0, 1.0, 0.0)] == (1.0, np.inf)  # never standing still in the gate
    assert sorted(velocity.values()) == [(0.0, 0.0), (0.0, 0.0), (1.0, np.inf)]


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


@given(st.floats(-180, 180), st.floats(-60.0, 60.0), st.floats(5.0, 60.0))
def test_upside_down_a_flip_leans_out_of_its_plane_by_thirty_degrees_at_most(
    axis_deg: float, aside: float, downward: float
) -> None:
    """Without a gate, whose attitude would say so: else a quick flip never turns over."""
    flip = Flip(axis_deg, count=2)
    thrust = aside * flip.turn_axis + [0.0, 0.0, -downward]
    leaning = np.rad2deg(np.arctan2(abs(aside), downward))
    stages = {stage.name: stage for stage in flip.stage_sequence([], 20.0).stages}
    for name in ("180°", "540°"):
        if abs(leaning - 30.0) > 1e-6:
            assert holds(stages[name], thrust - [0.0, 0.0, G]) == (leaning < 30.0)


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
    in_plane = GatePassage(upright=False)
    (stage,) = HalfFlip(18.0, in_plane).stage_sequence([gate], 50.0).stages
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
    assert {c.quantity for c in stage.conditions} == {Quantity.VELOCITY}
    assert stage.attitude is None


def test_a_spelled_out_maneuver_may_pass_the_problems_gate() -> None:
    gate = tilted_gate(np.ones(3))
    kick = Stage("kick", (Condition("specific_thrust", (1.0, 0.0, 0.0), lower=5.0),))
    course = CustomManeuver((kick, Stage("gate", (), 0.4, gate="gate"))).stage_sequence([gate], 50.0)
    assert course.stages[0] is kick
    assert (course.stages[1].gate, course.stages[1].at) == (gate.name, 0.4)


GATE = tilted_gate(np.ones(3), heading=0.5, elevation=0.2)


@given(st.lists(st.floats(-9, 9), min_size=3, max_size=3))
def test_a_stage_that_names_a_gate_moves_through_it_unless_it_says_how(velocity: list[float]) -> None:
    """At 1 m/s or more in its direction: whatever is asked across it changes nothing."""

    def slowest(*conditions: Condition, **keys: float) -> float:
        asked = Stage("gate", conditions, gate="gate", **keys).explicit(GATE).conditions
        return max((c.lower for c in asked if c.quantity is Quantity.VELOCITY), default=-np.inf)

    across = Condition("velocity", GATE.lateral, 0.0, 0.0), Condition("velocity", GATE.up, 0.0, 0.0)
    along = Condition("velocity", GATE.normal, -3.0, 0.5)
    thrust = Condition("specific_thrust", GATE.normal, lower=1.0)
    assert slowest() == slowest(*across) == slowest(thrust) == 1.0
    assert slowest(along) == -3.0
    assert slowest(min_speed=2.5) == slowest(along, min_speed=2.5) == 2.5
    assert slowest(min_speed=0.0) == -np.inf
    moving = [c for c in Stage("gate", gate="gate").explicit(GATE).conditions if "vel" in c.quantity.value]
    assert all((c.direction @ velocity >= 1.0) == (GATE.normal @ velocity >= 1.0) for c in moving)


angles = st.floats(0.0, 6.28)


@given(st.floats(0.0, 1.4), st.floats(0.0, 1.6), angles, st.floats(-3.1, 3.1))
def test_thrust_that_meets_an_attitudes_conditions_lies_in_its_cone_and_fills_half_of_it(
    tolerance: float, off: float, around: float, tilt: float
) -> None:
    """Never outside the cone; inside it wherever the thrust is nearer than the pyramid's faces."""
    gate = tilted_gate(np.zeros(3), 0.3, tilt=tilt)
    attitude = Attitude(gate.up, 5.0, tolerance)
    stage = Stage("gate", attitude=attitude).explicit()
    sideways = np.cos(around) * gate.lateral + np.sin(around) * gate.normal
    thrust = 20.0 * (np.cos(off) * gate.up + np.sin(off) * sideways)
    if holds(stage, thrust - [0.0, 0.0, G]):
        assert off <= tolerance + 1e-7
    elif 20.0 * np.cos(off) >= 5.0:
        assert np.tan(off) > np.tan(tolerance) / np.sqrt(2.0) - 1e-9


@given(st.floats(0.0, 3.0), st.floats(-30.0, 30.0), st.floats(-10.0, 10.0), angles)
def test_a_condition_on_thrust_counts_the_drag_that_turns_the_vehicle(
    drag: float, speed: float, wind: float, heading: float
) -> None:
    """The bound's value is that of a + g e3 + d (v − wind), whatever the motion."""
    balance = ForceBalance(9.0, drag, np.array([wind, 0.0, -wind]))
    direction = np.array([np.cos(heading), np.sin(heading), 0.5])
    motion = np.array([[1.0, 2.0, 3.0], [speed, -speed, 2.0], [4.0, 5.0, -6.0]])
    bound = Condition("specific_thrust", direction, lower=-1.0, upper=2.0).bound(balance)
    thrust = motion[2] + [0.0, 0.0, 9.0] + drag * (motion[1] - [wind, 0.0, -wind])
    assert bound.value(motion) == pytest.approx(direction @ thrust, abs=1e-9)
    assert bound.limits == (-1.0 - bound.constant, 2.0 - bound.constant)
    assert bound.excess(motion) == pytest.approx(
        max(-1.0 - direction @ thrust, direction @ thrust - 2.0, 0.0)
    )


@given(st.floats(23.0, 337.0), st.floats(-180.0, 180.0))
def test_a_flip_passes_a_gate_at_any_angle_of_its_turn_upright_there(
    turn_deg: float, axis_deg: float
) -> None:
    """The gate's stage asks the gate's own upright; those before and after it keep the order of the turn."""
    axis = np.deg2rad(axis_deg)
    gate = tilted_gate(np.zeros(3), axis, tilt=np.deg2rad(turn_deg))
    assert gate.normal @ [np.cos(axis), np.sin(axis), 0.0] == pytest.approx(1.0)
    stages = Flip(axis_deg).stage_sequence([gate], 50.0).stages
    (at_gate,) = (stage for stage in stages if stage.gate)
    np.testing.assert_array_equal(at_gate.explicit(gate).attitude.up, gate.up)
    assert at_gate.min_upright_thrust == 10.0
    others = [float(stage.name.rstrip("°")) for stage in stages if not stage.gate]
    before = others[: stages.index(at_gate)]
    assert others == sorted(others)
    assert all(angle < turn_deg + 1e-6 for angle in before)
    assert all(abs(angle - turn_deg) > 22.4 for angle in others)
    assert len(others) >= 3


@pytest.mark.parametrize(
    ("axis_deg", "heading_deg", "tilt_deg", "sentence"),
    [
        (0.0, 0.0, 0.0, "next to upright"),
        (0.0, 0.0, 10.0, "next to upright"),
        (0.0, 90.0, 90.0, "outside the plane .* turn about 90 or -90"),
        (90.0, 0.0, 120.0, "outside the plane .* turn about 0 or -180"),
    ],
)
def test_a_flip_that_contradicts_its_gate_is_refused_in_words(
    axis_deg: float, heading_deg: float, tilt_deg: float, sentence: str
) -> None:
    gate = tilted_gate(np.zeros(3), np.deg2rad(heading_deg), tilt=np.deg2rad(tilt_deg))
    with pytest.raises(SpecError, match=sentence):
        Flip(axis_deg).stage_sequence([gate], 50.0)


def test_a_maneuver_without_a_gate_refuses_to_say_how_one_is_passed() -> None:
    assert Flip().as_in_paper().stage_sequence((), 30.0).stages
    assert not Line().as_in_paper().stage_sequence((), 30.0).stages
    for kind, maneuver in (("flip", Flip), ("line", Line)):
        with pytest.raises(
            SpecError, match=rf"^maneuver\.passage needs a gate, and the {kind} has none; add one"
        ):
            maneuver(passage=GatePassage(speed=3.0)).stage_sequence((), 30.0)


def test_maneuvers_ask_their_gates_attitude_about_both_axes_within_a_tenth_of_its_tolerance() -> None:
    for name in ("flip-roll", "flip-pitch", "flip-roll-translation", "half-flip"):
        problem = load_problem(name)
        (gate,) = problem.gates
        (stage,) = (stage for stage in problem.stages(50.0).stages if stage.gate)
        for leaning in (gate.normal, gate.lateral):
            for angle, fits in ((0.0, True), (0.006, True), (0.012, False)):
                thrust = 30.0 * (np.cos(angle) * gate.up + np.sin(angle) * leaning)
                assert holds(stage, thrust - [0.0, 0.0, G]) is fits
        assert stage.attitude.tolerance == pytest.approx(np.deg2rad(0.5))


@given(st.floats(0.0, 0.9), st.floats(0.05, 1.0), st.integers(3, 60))
def test_a_window_holds_the_interval_ends_within_it(first: float, length: float, intervals: int) -> None:
    last = min(first + length, 1.0)
    ends = [(slot + 1) / intervals for slot in Stage("s", at=(first, last)).slots(intervals)]
    within = [k / intervals for k in range(1, intervals) if first - 1e-9 <= k / intervals <= last + 1e-9]
    assert ends == pytest.approx(within)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Stage("s", at=(0.6, 0.4)),
        lambda: Stage("s", at=(0.5, 1.5)),
        lambda: Stage("s", at="early"),
        lambda: Stage("s", at=True),
        lambda: Stage("s", at=(0.2, 0.4, 0.6)),
        lambda: Stage("s", min_upright_thrust=5.0),
        lambda: Stage("s", min_speed=1.0),
        lambda: Stage("s", gate="gate", min_speed=-1.0),
        lambda: Stage("s", gate="gate", min_upright_thrust=5.0, attitude=Attitude((0.0, 0.0, 1.0), 5.0)),
        lambda: Attitude((0.0, 0.0, 1.0), 5.0, tolerance=1.6),
        lambda: Attitude((0.0, 0.0, 1.0), min_thrust=-1.0),
        lambda: Flip(axis_deg=np.inf),
        lambda: Flip(min_lateral_thrust=-1.0),
        lambda: Flip(min_inverted_thrust=0.0),
        lambda: HalfFlip(min_lateral_thrust=np.nan),
        lambda: HalfFlip(18.0).stage_sequence([tilted_gate(np.zeros(3))], 50.0),
        lambda: HalfFlip().stage_sequence([tilted_gate(np.zeros(3), tilt=np.pi)], 50.0),
        lambda: HalfFlip().stage_sequence([], 50.0),
        lambda: Condition("position", (0.0, 0.0, 0.0), 0.0),
        lambda: Condition("velocity", (1.0, 0.0, 0.0), 2.0, 1.0),
        lambda: Stage("late", (), at=1.0),
        lambda: GatePassage(speed=-1.0),
    ],
)
def test_a_maneuver_that_cannot_be_is_refused(wrong) -> None:
    with pytest.raises(SpecError):
        wrong()


@pytest.mark.parametrize(
    ("condition", "sentence"),
    [
        (Condition("velocity", (1.0, 0.0, 0.0), lower=1.0), "start: its velocity along .* lies outside"),
        (Condition("specific_thrust", (0.0, 0.0, 1.0), lower=11.0), "start: its specific thrust along"),
        (Condition("position", (1.0, 0.0, 0.0), upper=2.0), "goal: its position along"),
    ],
)
def test_ends_that_contradict_what_is_asked_throughout_are_refused(condition, sentence) -> None:
    maneuver = CustomManeuver((Stage("kick"),), (condition,))
    with pytest.raises(SpecError, match=sentence):
        Problem("never", at_rest((0.0, 0.0, 0.0)), at_rest((5.0, 0.0, 0.0)), maneuver)


def test_a_window_in_which_no_interval_ends_is_told_as_such() -> None:
    stage = Stage("late", (Condition("velocity", (1.0, 0.0, 0.0), lower=1.0),), at=(0.0, 0.005))
    problem = Problem("window", at_rest((0.0, 0.0, 0.0)), at_rest((5.0, 0.0, 0.0)), CustomManeuver((stage,)))
    with pytest.raises(SpecError, match=r"'late' may hold between 0 and 0.005 .* none of 20 intervals"):
        Miqp().plan(problem)
