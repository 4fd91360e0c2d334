"""Waypoints: what is given becomes conditions, what is free asks nothing, nonsense is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem import Gate, Limits, Problem, Quantity, Waypoint, Waypoints, at_rest, tilted_gate

FREE = np.nan
components = st.lists(st.one_of(st.just(FREE), st.floats(-50, 50)), min_size=3, max_size=3)


def sequence(*waypoints: Waypoint, gates=()):
    return Waypoints(waypoints).stage_sequence(gates, 40.0)


@given(components, components, components)
def test_each_given_component_is_one_equality_a_free_one_none(position, velocity, acceleration) -> None:
    values = {"position": position, "velocity": velocity, "acceleration": acceleration}
    if np.isnan(np.concatenate([*values.values()])).all():
        with pytest.raises(SpecError, match="nothing is given"):
            Waypoint(**values)
        return
    (stage,) = sequence(Waypoint(**values)).stages
    asked = {(c.quantity.value, int(np.argmax(c.direction))): (c.lower, c.upper) for c in stage.conditions}
    assert asked == {
        (name, axis): (x, x) for name, xs in values.items() for axis, x in enumerate(xs) if not np.isnan(x)
    }


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda d: np.linalg.norm(d) > 0.1))
def test_an_attitude_holds_exactly_for_thrust_along_it(direction) -> None:
    """With a thrust, for that thrust alone; without, for at least a fifth of what the vehicle has."""
    up = np.array(direction) / np.linalg.norm(direction)
    for waypoint, least in ((Waypoint(up=direction, thrust=12.0), 12.0), (Waypoint(up=direction), 8.0)):
        (stage,) = sequence(waypoint).stages
        for thrust, holds in ((least * up, True), (0.9 * least * up, False), (-least * up, False)):
            asked = stage.explicit().conditions
            met = [c.lower - 1e-9 <= c.direction @ thrust <= c.upper + 1e-9 for c in asked]
            assert all(met) == holds
            assert {c.quantity for c in asked} == {Quantity.SPECIFIC_THRUST}


def test_waypoints_are_passed_in_order_and_the_gate_at_its_centre() -> None:
    gate = tilted_gate(np.array([1.0, 2.0, 3.0]))

    def problem(*gates: Gate) -> Problem:
        maneuver = Waypoints((Waypoint(position=(0, 0, 1)), Waypoint(gate="gate")))
        return Problem("course", at_rest((0, 0, 0)), at_rest((5, 0, 0)), maneuver, gates)

    passed = problem(gate).stages(40.0)
    assert passed.ordered
    assert [s.name for s in passed.stages] == ["waypoint 1", "gate"]
    assert [s.at for s in passed.stages] == ["free", "free"]
    assert [c.lower for c in passed.stages[1].conditions] == [1.0, 2.0, 3.0, 1.0]
    with pytest.raises(SpecError, match="no gate named 'gate'"):
        problem()


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: Waypoint(position=(0, 0)), "position must be three numbers"),
        (lambda: Waypoint(position=(0, 0, np.inf)), r"position\[2\] must be a finite number"),
        (lambda: Waypoint(thrust=5.0), "thrust needs up"),
        (lambda: Waypoint(up=(0, 0, 1), thrust=-5.0), "thrust must be positive"),
        (lambda: Waypoint(up=(0, 0, 0)), "up must be a direction"),
        (lambda: Waypoint(up=(0, 0, 1), acceleration=(0, 0, 1)), "give one of them"),
        (lambda: Waypoint(position=(0, 0, 1), time=0.0), "time must be positive"),
        (lambda: Waypoints(()), "waypoints must have 1 or more"),
        (lambda: Waypoints((Waypoint(position=(0, 0, 1)),), duration=np.inf), "duration must be a finite"),
        (lambda: Waypoints((Waypoint(position=(0, 0, 1), time=2.0),), duration=1.0), "times must rise"),
    ],
)
def test_nonsense_is_refused_in_a_sentence_that_names_it(wrong, sentence) -> None:
    with pytest.raises(SpecError, match=sentence):
        wrong()


def test_a_waypoint_under_ground_or_outside_the_limits_is_refused_by_its_name() -> None:
    low = Waypoints((Waypoint(position=(4.0, 0.0, 0.5)), Waypoint(position=(5.0, np.nan, -1.0))))
    with pytest.raises(
        SpecError, match=r"maneuver: 'waypoint 2' asks for z from -1 to -1 m, outside .*\[-0.5, inf]"
    ):
        Problem("low", at_rest((0, 0, 0)), at_rest((9, 0, 0)), low, environment=Environment(ground=-0.5))
    limits = Limits(upper=(3.0, 9.0, 9.0))
    with pytest.raises(SpecError, match=r"'waypoint 1' asks for x from 4 to 4 m, outside .*\[-inf, 3]"):
        Problem("far", at_rest((0, 0, 0)), at_rest((2, 0, 0)), low, limits=limits)
