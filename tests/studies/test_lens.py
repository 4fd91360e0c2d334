"""Fields by their dotted names: what a file with that key says, and nothing else; ranges; contradictions."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from math import degrees
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.declaration import from_table, to_table
from aerobat.planning.assessment.contradiction import contradiction
from aerobat.studies.feasibility import Axis
from aerobat.studies.lens import Scenario, lens
from aerobat.studies.units import OF, UNITS
from places import ROOT

NAMES = {  # of fields: the place of the same in a file's tables, and values that it takes
    "gate.width": (("gates", 0, "width"), (0.5, 3.0)),
    "gates[0].position.y": (("gates", 0, "position", 1), (-3.0, 3.0)),
    "gate.tilt_deg": (("gates", 0, "tilt_deg"), (-90.0, 90.0)),
    "tilt_deg": (("gates", 0, "tilt_deg"), (-90.0, 90.0)),
    "heading_deg": (("heading_deg",), (-180.0, 180.0)),
    "limits.velocity": (("limits", "velocity"), (1.0, 30.0)),
    "limits.velocity[2]": (("limits", "velocity", 2), (1.0, 30.0)),
    "goal.position.x": (("goal", "position", 0), (-9.0, 9.0)),
    "speed": (("maneuver", "passage", "speed"), (0.0, 9.0)),
    "maneuver.min_lateral_thrust": (("maneuver", "min_lateral_thrust"), (0.1, 9.0)),
    "environment.ground": (("environment", "ground"), (-9.0, -0.1)),
    "vehicle.mass": (("vehicle", "mass"), (0.5, 2.0)),
    "vehicle.drag_body.z": (("vehicle", "drag_body", 2), (0.0, 1.0)),
    "vehicle.rotor_defaults.lag": (("vehicle", "rotor_defaults", "lag"), (0.0, 0.1)),
    "max_thrust": (("vehicle", "rotor_defaults", "max_thrust"), (5.0, 9.0)),
}
OTHERS = {  # of fields of what is no file's problem or vehicle: values that they take
    "planner.reserve": (0.0, 0.4),
    "planner.time_limit": (1.0, 30.0),
    "conditions.mass": (0.0, 0.9),
    "conditions.gusts.mean_wind": (0.0, 9.0),
    "conditions.motion_capture.attitude_noise_deg": (0.0, 9.0),
}


@cache
def scenario() -> Scenario:
    conditions = ab.load_dispersion("lab")
    return Scenario(ab.load_problem("half-flip"), ab.load_vehicle("agile-quad"), ab.Miqp(), conditions)


def by_file(keys: tuple[Any, ...], value: float) -> Scenario:
    """The scenario as its files read with one key at another value."""
    base = scenario()
    tables: dict[str, Any] = {"problem": to_table(base.problem), "vehicle": to_table(base.vehicle)}
    table: Any = tables["vehicle"] if keys[0] == "vehicle" else tables["problem"]
    *path, last = keys[1:] if keys[0] == "vehicle" else keys
    for key in path:
        if isinstance(table, dict) and key not in table:
            table[key] = [0.0, 0.0, 0.0] if key == "drag_body" else {}
        table = table[key]
    table[last] = value
    problem, vehicle = from_table(ab.Problem, tables["problem"]), from_table(ab.Vehicle, tables["vehicle"])
    return replace(base, problem=problem, vehicle=vehicle)


def test_units_are_those_that_the_page_on_files_tells() -> None:
    page = (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    files, _, conditions = page.partition("## Conditions")
    told, under = units_in(files), units_in(conditions)
    for key, unit in UNITS.items():
        assert told[key] == {unit}, key
    for key, unit in OF["conditions"].items():
        assert under[key] == {unit.replace("°", "deg") or "-"}, key
    for name in NAMES:
        field = lens(name, scenario())
        key = str(next(key for key in reversed(field.keys) if isinstance(key, str)))
        assert field.unit.replace("°", "deg") in told[key]
    units = {
        "angle": "°",
        "vehicle.rotor_defaults.min_thrust": "N",
        "limits.upper[2]": "m",
        "planner.order": "",
    }
    units |= {"tolerance.attitude": "rad", "limits.max_tilt": "rad", "planner.clearance": "m"}
    units |= {"planner.time_limit": "s", "conditions.mass": "", "conditions.imu.gyro_range_deg": "°/s"}
    for name, unit in units.items():
        assert lens(name, scenario()).unit == unit


def units_in(page: str) -> dict[str, set[str]]:
    """The units that tables of a page give, by the keys."""
    rows = re.findall(r"^\| `(\w+)` \| .* \| (\S+) \| [^|]* \|$", page, re.MULTILINE)
    return {key: {unit for name, unit in rows if name == key} for key, _ in rows}


@given(name=st.sampled_from(sorted(NAMES)), data=st.data())
def test_a_field_changes_what_its_files_key_does(name: str, data: st.DataObject) -> None:
    keys, (low, high) = NAMES[name]
    value = data.draw(st.one_of(st.floats(low, high), st.integers(int(np.ceil(low)), int(high))))
    assert lens(name, scenario()).set(scenario(), value) == by_file(keys, value)


@given(name=st.sampled_from(sorted({**NAMES, **OTHERS})), data=st.data())
def test_what_is_set_is_got_and_nothing_else_is_changed(name: str, data: st.DataObject) -> None:
    low, high = OTHERS[name] if name in OTHERS else NAMES[name][1]
    value, field = data.draw(st.floats(low, high)), lens(name, scenario())
    changed = field.set(scenario(), value)
    assert field.get(changed) == pytest.approx(value, abs=1e-9)
    assert field.set(changed, field.get(scenario())) == field.set(scenario(), field.get(scenario()))
    holder = name.partition(".")[0]
    for other in {"problem", "vehicle", "planner", "conditions"} - {holder, "problem"}:
        if holder in ("vehicle", "planner", "conditions"):
            assert getattr(changed, other) == getattr(scenario(), other)


@given(st.floats(-90.0, 90.0))
def test_the_angle_is_the_tilt_of_a_half_flips_gate(angle: float) -> None:
    gate = lens("angle", scenario()).set(scenario(), angle).problem.gates[0]
    assert degrees(gate.angles[2]) == pytest.approx(angle, abs=1e-9)
    assert (gate.position == scenario().problem.gates[0].position).all()


@given(st.floats(0.5, 20.0))
def test_the_thrust_to_weight_ratio_is_what_it_is_set_to_and_shared_as_before(ratio: float) -> None:
    changed = lens("vehicle.thrust_to_weight", scenario()).set(scenario(), ratio).vehicle
    before = scenario().vehicle
    assert changed.thrust_to_weight == pytest.approx(ratio)
    shares = changed.max_thrusts / changed.max_thrusts.sum()
    np.testing.assert_allclose(shares, before.max_thrusts / before.max_thrusts.sum())
    assert replace(changed, rotors=before.rotors) == before


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("spede", "no field named 'spede'; did you mean 'speed'?"),
        ("gate.witdh", "gates[0].witdh is not a known key; did you mean 'width'?"),
        ("vehicle.masss", "vehicle.masss is not a known key; did you mean 'mass'?"),
        (
            "velocity",
            "velocity may be start.velocity or goal.velocity or gates[0].velocity or limits.velocity; "
            "give the whole name",
        ),
        ("gates[3].width", "gates has no [3]; give a number from [0] to [0]"),
        ("goal.position", "goal.position: this is an array of the shape (3,), which cannot be varied"),
        ("name", "name: this is 'half-flip', which cannot be varied"),
        ("vehicle.body.centre.x", "vehicle.body is not given; give it first"),
        ("planner.resreve", "planner is not given; give it first"),
        ("a..b", "'a..b' is no field's name"),
        ("", "'' is no field's name"),
    ],
)
def test_a_name_of_no_number_is_refused_with_the_nearest(name: str, said: str) -> None:
    with pytest.raises(ab.SpecError) as refused:
        ab.feasibility_map(scenario().problem, {name: [1.0]}, scenario().vehicle, workers=1)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("speed", [2.0, -1.0], "speed at -1: maneuver.passage.speed must be 0 or more"),
        ("gate.width", [0.0], "gate.width at 0: gates[0].width must be positive"),
        ("limits.velocity.z", [-1.0], "limits.velocity must be positive"),
        ("angle", [0.0, 100.0], "angle must be from -90 to 90 degrees, got 100"),
        ("thrust_to_weight", [0.0], "vehicle.thrust_to_weight must be positive"),
        ("heading_deg", [1e4], "heading must be an angle in radians"),
        ("speed", [], "speed must have from 1 to 10000 values, got 0"),
        ("speed", [1.0, 1.0], "speed has a value twice"),
        ("speed", [np.nan], "speed must be finite numbers in a row"),
        ("speed", "fast", "speed must be finite numbers in a row"),
    ],
)
def test_values_that_a_field_cannot_take_are_refused_before_anything_is_planned(
    name: str, values: Any, said: str
) -> None:
    with pytest.raises(ab.SpecError) as refused:
        ab.feasibility_map(scenario().problem, {name: values}, scenario().vehicle, workers=1)
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("over", "said"),
    [
        ({}, "over must name one field or two, got 0"),
        ({"speed": [1], "angle": [1], "gate.width": [1]}, "over must name one field or two, got 3"),
        ({"speed": [1], "maneuver.passage.speed": [2]}, "are the same field"),
        ({"speed": range(200), "gate.width": range(1, 101)}, "20000 cells are too many"),
    ],
)
def test_what_is_no_map_is_refused(over: dict[str, Any], said: str) -> None:
    with pytest.raises(ab.SpecError, match=said):
        ab.feasibility_map(scenario().problem, over, scenario().vehicle, workers=1)


@given(first=st.integers(-1000, 1000), step=st.integers(1, 300), count=st.integers(1, 60), turn=st.booleans())
def test_a_range_has_its_first_value_and_then_every_step_as_far_as_its_last(
    first: int, step: int, count: int, turn: bool
) -> None:
    """In tenths, whose sums are no round binary numbers."""
    sign = -1 if turn else 1
    ends = (sign * (first + (count - 1) * step) / 10, sign * step / 10)
    for slack in (0.0, 0.4 * ends[1]):  # a last value that no step ends at is not there
        axis = Axis.parse(f"speed={sign * first / 10!r}:{ends[0] + slack!r}:{ends[1]!r}")
        assert axis.values == tuple(sign * (first + k * step) / 10 for k in range(count))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("speed=1:9:0", "the step of speed is 0"),
        ("speed=9:1:1", "the range of speed is empty"),
        ("speed=1:9:-1", "the range of speed is empty"),
        ("speed=0:1:1e-9", "10000 at most"),
        ("speed=1:9", "a range is FIRST:LAST:STEP"),
        ("speed=1:9:1:1", "a range is FIRST:LAST:STEP"),
        ("speed=1:ten:1", "is no finite number"),
        ("speed=1:inf:1", "is no finite number"),
        ("speed=1,,2", "is no finite number"),
        ("speed", "give a field and its values"),
        ("=1", "give a field and its values"),
        ("speed=", "give a field and its values"),
    ],
)
def test_a_text_that_is_no_range_is_refused(text: str, said: str) -> None:
    with pytest.raises(ab.SpecError, match=said):
        Axis.parse(text)


@pytest.mark.parametrize("name", ab.problem_names())
def test_no_built_in_problem_contradicts_itself(name: str) -> None:
    assert contradiction(ab.load_problem(name), ab.load_vehicle("agile-quad")) is None


@given(
    speed=st.floats(0.5, 20.0),
    heading=st.floats(-180.0, 180.0),
    climb=st.floats(-80.0, 80.0),
    limit=st.tuples(*[st.floats(1.0, 20.0)] * 3),
)
def test_a_speed_is_refused_at_sight_exactly_where_no_velocity_along_the_gate_keeps_the_limits(
    speed: float, heading: float, climb: float, limit: tuple[float, float, float]
) -> None:
    gate = ab.tilted_gate((2.5, 2.0, 3.5), np.radians(heading), np.radians(climb))
    maneuver = ab.HalfFlip(passage=ab.GatePassage(speed=speed))
    problem = replace(
        scenario().problem, gates=(gate,), maneuver=maneuver, limits=ab.Limits(velocity=np.array(limit))
    )
    with np.errstate(divide="ignore"):
        fastest = float((np.array(limit) / np.abs(gate.normal)).min())
    found = contradiction(problem, scenario().vehicle)
    if abs(speed / fastest - 1.0) > 1e-6:
        assert (found is not None) == (speed > fastest)
    assert found is None or found.limits == ("limits.velocity",)
