"""Courses: elements one after another, in laps; read aloud; nonsense refused in one sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError

RED = ab.tilted_gate((2.0, 0.0, 2.0), name="red")
SECOND = ab.tilted_gate((8.0, 0.0, 3.0), tilt=np.pi, name="second")
ENDS = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((12.0, 0.0, 0.0))
ELEMENTS = (
    ab.PassGate("red"),
    ab.SplitS((5.0, 0.0, 4.0)),
    ab.Flip(axis_deg=0.0, gate="second"),
    ab.PassWaypoint((10.0, 0.0, 1.0)),
)


def problem(*elements: ab.Maneuver, gates=(RED, SECOND), **course: int) -> ab.Problem:
    """A problem of a course through two gates."""
    return ab.Problem("course", *ENDS, ab.Course(elements, **course), gates)


def gates_of(element: ab.Maneuver) -> tuple[ab.Gate, ...]:
    """The gate that an element names."""
    return tuple(gate for gate in (RED, SECOND) if gate.name == getattr(element, "gate", None))


@given(st.lists(st.sampled_from(ELEMENTS), min_size=1, max_size=4), st.integers(1, 4), st.data())
def test_a_course_is_its_elements_one_after_another_in_every_lap(elements, laps: int, data) -> None:
    """The last lap ends early where that is said."""
    last = data.draw(st.integers(1, len(elements)))
    course = ab.Course(tuple(elements), laps, last).stage_sequence((RED, SECOND), 30.0)
    flown = [*((lap, each) for lap in range(1, laps) for each in elements)]
    flown += [(laps, each) for each in elements[:last]]
    alone = [
        (lap, stage.gate, stage.conditions, stage.attitude)
        for lap, element in flown
        for stage in element.stage_sequence(gates_of(element), 30.0).stages
    ]
    assert [(s.lap, s.gate, s.conditions, s.attitude) for s in course.stages] == alone
    assert course.ordered


def test_a_course_of_one_element_is_that_maneuver() -> None:
    """Also in what it finds of its gate, and in what holds throughout."""
    half_flip = ab.load_problem("half-flip")
    course = replace(half_flip, maneuver=ab.Course((half_flip.maneuver,)))
    assert course.stages(30.0) == half_flip.stages(30.0)


def test_stages_of_one_name_are_numbered_within_their_lap() -> None:
    waypoints = tuple(ab.PassWaypoint((x, 0.0, 1.0)) for x in (1.0, 2.0))
    names = [stage.name for stage in problem(*waypoints, laps=2).stages(30.0).stages]
    assert names == 2 * ["waypoint 1", "waypoint 2"]


def test_a_course_reads_aloud() -> None:
    ground = replace(problem(*ELEMENTS), environment=ab.Environment(ground=0.0))
    assert str(ground) == (
        "course: from (0, 0, 0) m: through the red gate, Split-S, flip right in the second gate, "
        "by a waypoint, land at (12, 0, 0) m"
    )
    laps = replace(
        problem(*3 * ELEMENTS[3:], ELEMENTS[0], laps=3, last_lap=2), goal=ab.EndState((1, 0, 0), (1, 0, 0))
    )
    assert str(laps) == (
        "course: from (0, 0, 0) m: 3 laps of by a waypoint, 3 times, through the red gate, the last of 2 "
        "elements, pass (1, 0, 0) m"
    )


def test_a_course_is_written_and_read_exactly() -> None:
    course = problem(*ELEMENTS, laps=3, last_lap=2)
    table = to_table(course)
    assert table["maneuver"]["elements"][0] == {"kind": "gate", "gate": "red"}
    assert from_table(ab.Problem, table) == course


def test_the_course_of_the_record_has_19_waypoints_in_three_laps() -> None:
    """Foehn, Romero, Scaramuzza: three laps of seven, the last of five."""
    lap = [stage.conditions for stage in ab.load_problem("race-7").stages(30.0).linear.stages]
    stages = ab.load_problem("split-s-19").stages(30.0).linear.stages
    assert [stage.conditions for stage in stages] == [*lap, *lap, *lap[:5]]
    assert [stage.lap for stage in stages] == [1] * 7 + [2] * 7 + [3] * 5


@pytest.mark.parametrize(
    ("course", "sentence"),
    [
        ({"elements": []}, "maneuver.elements must have 1 or more entries, got 0"),
        (
            {"elements": [{"kind": "gate", "gate": "red"}], "laps": 0},
            "maneuver.laps must be 1 or more, got 0",
        ),
        (
            {"elements": [{"kind": "gate", "gate": "red"}], "last_lap": 2},
            "maneuver.last_lap must be 1, the number of elements, or less, got 2",
        ),
        (
            {"elements": [{"kind": "gate", "gate": "red"}, {"kind": "gate", "gate": "rad"}]},
            "maneuver.elements[1]: no gate named 'rad'; did you mean 'red'? Known: red, second",
        ),
        (
            {"elements": [{"kind": "gate", "gate": "red"}, {"kind": "half-flip"}]},
            "maneuver.elements[1]: a half-flip passes one gate, there are none; give one table [[gates]] "
            "with a position, or the name of its gate",
        ),
        (
            {"elements": [{"kind": "power-loop"}]},
            "maneuver.elements[0].position or gate says where the figure is entered; give one of them",
        ),
        (
            {"elements": [{"kind": "gate", "gate": "red"}], "laps": 10**6},
            "maneuver.laps must be 1000 or less, got 1000000",
        ),
        (
            {"elements": [{"kind": "barrel-roll", "position": [5, 0, 1], "count": 10**6}]},
            "maneuver.elements[0].count must be 1000 or less, got 1000000",
        ),
        (
            {"elements": [{"kind": "loop"}]},
            "maneuver.elements[0].kind must be one of",
        ),
        (
            {"elements": [{"kind": "gate", "gate": "red"}, {"kind": "flip", "ordered": False}]},
            "maneuver.elements[1]: its stages come in any order, which those of a course do not; order them",
        ),
    ],
)
def test_a_malformed_course_is_refused_in_one_sentence(course, sentence: str) -> None:
    table = to_table(problem(*ELEMENTS)) | {"maneuver": {"kind": "course", **course}}
    with pytest.raises(SpecError) as refused:
        from_table(ab.Problem, table)
    assert str(refused.value).startswith(sentence)


def test_a_figure_with_no_room_under_the_ceiling_is_refused() -> None:
    low = ab.Limits(lower=(-20.0, -20.0, 0.0), upper=(20.0, 20.0, 2.0))
    with pytest.raises(SpecError, match=r"'top' asks for z from 2.625 to 3.375 m, outside the limits"):
        ab.Problem("low", *ENDS, ab.Course((ab.PowerLoop((5.0, 0.0, 0.0)),)), limits=low)


@given(st.floats(-np.pi, np.pi), st.floats(0.1, 0.4), st.floats(-0.05, 0.05), st.booleans())
def test_a_gate_inside_another_is_refused_one_beside_it_is_not(heading, size, off, in_plane) -> None:
    """Whichever of them comes first, in its plane or across it."""
    outer = ab.tilted_gate((0.0, 0.0, 1.0), heading, width=1.0, height=1.0, name="outer")
    turn = 0.0 if in_plane else np.pi / 2
    place = outer.position if in_plane else outer.position + off * outer.normal
    inner = ab.tilted_gate(place, heading + turn, width=2.0 * abs(off) + size, height=size, name="inner")
    for gates in ((outer, inner), (inner, outer)):
        with pytest.raises(SpecError, match="gate 'inner' stands in the opening of gate 'outer'; move one"):
            problem(ab.PassGate("inner"), gates=gates)
    beside = replace(inner, position=inner.position + (0.51 + size) * outer.lateral)
    assert problem(ab.PassGate("inner"), gates=(beside, outer)).gates == (beside, outer)


def test_a_gate_may_stand_once_for_each_way_through_it() -> None:
    back = ab.tilted_gate(RED.position, np.pi, name="back")
    assert problem(ab.PassGate("red"), ab.PassGate("back"), gates=(RED, back)).gates == (RED, back)


def test_a_course_within_a_course_and_a_maneuver_of_ones_own_are_given_the_gates_that_they_name() -> None:
    inner = ab.Course((ab.PassGate("red"), ab.PassWaypoint((5.0, 0.0, 2.0))))
    own = ab.CustomManeuver((ab.Stage("through", gate="second"),))
    flat = problem(*inner.elements, ab.PassGate("second")).stages(30.0).stages
    nested = problem(inner, own).stages(30.0).stages
    assert [stage.gate for stage in nested] == [stage.gate for stage in flat] == ["red", None, "second"]
    assert nested[0].conditions == flat[0].conditions
