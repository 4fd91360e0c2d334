"""Problems, vehicles and maneuvers as declared values: what they refuse from Python, round trips, plugins."""

import json
import pickle
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError
from aerobat.problem import GatePassage, StageSequence
from aerobat.registry import Registry
from refusals import complaint

START, GOAL = ab.at_rest((0, 0, 0)), ab.at_rest((9, 0, 0))
THREE = tuple(ab.tilted_gate(np.array([x, 0.0, 1.0]), name=f"gate {x:g}") for x in (2.0, 4.0, 6.0))
QUAD = ab.load_vehicle("agile-quad")
HUGE = 10**400
GOOD: dict[type, dict[str, Any]] = {
    ab.Problem: {"name": "p", "start": START, "goal": GOAL, "gates": THREE},
    ab.EndState: {"position": (0, 0, 0)},
    ab.Limits: {},
    ab.Environment: {},
    ab.Gate: {"position": (0, 0, 0), "normal": (1, 0, 0), "up": (0, 0, 1)},
    ab.Stage: {"name": "s", "conditions": (ab.Condition("position", (1, 0, 0), 0.0),)},
    ab.Condition: {"quantity": "position", "direction": (1, 0, 0), "lower": 0.0},
    ab.Waypoint: {"position": (1, 0, 0)},
    ab.Waypoints: {"waypoints": (ab.Waypoint(position=(1, 0, 0)),)},
    ab.CustomManeuver: {"stages": (ab.Stage("s", ()),)},
    ab.Flip: {},
    ab.HalfFlip: {},
    ab.Line: {},
    GatePassage: {},
    ab.Rotor: {each.name: getattr(QUAD.rotors[0], each.name) for each in fields(ab.Rotor)},
    ab.Vehicle: {each.name: getattr(QUAD, each.name) for each in fields(ab.Vehicle)},
}
NO_NUMBERS = ("1", True, 1j, None, HUGE, np.nan, object())
FIELDS = [(cls, each.name) for cls in GOOD for each in fields(cls)]  # type: ignore[arg-type]


@pytest.mark.parametrize(("cls", "field"), FIELDS, ids=lambda x: getattr(x, "__name__", x))
def test_no_field_takes_an_object_a_complex_number_or_a_huge_one(cls: type, field: str) -> None:
    for wrong in (object(), 1j, -HUGE, b"bytes", {1}, [[[1]]], lambda: None):
        said = complaint(lambda: cls(**GOOD[cls] | {field: wrong}))  # noqa: B023
        assert said.startswith(f"{cls.__name__}.{field}"), (wrong, said)
        assert said.isprintable()
        assert len(said) < 250


@pytest.mark.parametrize(
    ("cls", "field"),
    [
        (ab.Problem, "heading"),
        (ab.Environment, "gravity"),
        (ab.Gate, "attitude_tolerance"),
        (ab.Flip, "axis_deg"),
        (GatePassage, "speed"),
        (ab.Condition, "lower"),
        (ab.Rotor, "max_thrust"),
        (ab.Vehicle, "mass"),
    ],
    ids=lambda x: getattr(x, "__name__", x),
)
def test_text_and_truth_are_not_numbers_and_nothing_only_where_declared(cls: type, field: str) -> None:
    for wrong in NO_NUMBERS:
        said = complaint(lambda: cls(**GOOD[cls] | {field: wrong}))  # noqa: B023
        assert said.startswith(f"{cls.__name__}.{field} must be")


@pytest.mark.parametrize(
    ("cls", "field"),
    [
        (ab.EndState, "velocity"),
        (ab.Gate, "normal"),
        (ab.Condition, "direction"),
        (ab.Rotor, "position_body"),
    ],
    ids=lambda x: getattr(x, "__name__", x),
)
def test_a_wrong_component_of_a_vector_is_named(cls: type, field: str) -> None:
    for wrong in NO_NUMBERS:
        said = complaint(lambda: cls(**GOOD[cls] | {field: (1.0, wrong, 0.0)}))  # noqa: B023
        assert said.startswith(f"{cls.__name__}.{field}[1] must be a ")


@pytest.mark.parametrize("wrong", NO_NUMBERS, ids=lambda wrong: type(wrong).__name__)
def test_short_ways_to_make_values_refuse_what_the_values_refuse(wrong: Any) -> None:
    assert complaint(lambda: ab.at_rest((0.0, wrong, 0.0))).startswith("at_rest: position[1] must be a ")
    for angle in ("heading", "elevation", "tilt"):
        said = complaint(lambda: ab.tilted_gate((0.0, 0.0, 0.0), **{angle: wrong}))  # noqa: B023
        assert said.startswith(f"tilted_gate: {angle} must be ")
    assert complaint(lambda: ab.at_rest(wrong)).startswith("at_rest: position must be ")


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=3),
    st.lists(st.one_of(st.floats(), st.none(), st.text(max_size=2)), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
    st.sampled_from([START, THREE, QUAD, ab.Flip(), ab.Quantity.VELOCITY, HUGE]),
)


@given(st.sampled_from(FIELDS), JUNK)
def test_any_value_in_any_field_makes_a_value_that_survives_its_table_or_one_sentence(
    where: tuple[type, str], junk: Any
) -> None:
    cls, field = where
    made: list[Any] = []
    said = complaint(lambda: made.append(cls(**GOOD[cls] | {field: junk})))
    assert said.isprintable()
    assert made or said.startswith((f"{cls.__name__}.", f"{cls.__name__}: "))
    for value in made:
        table = json.loads(json.dumps(to_table(value)))
        again = from_table(cls, {key: each for key, each in table.items() if key != "kind"})
        assert again == value
        assert hash(again) == hash(value)
        assert pickle.loads(pickle.dumps(value)) == value


finite = st.floats(-1e6, 1e6)
angles = st.floats(-6.28, 6.28)
bounds = st.one_of(st.just(np.inf), st.floats(1e-15, 1e6))


@given(
    x=finite,
    heading=angles,
    floor=st.floats(-10, 10),
    velocity=st.tuples(bounds, bounds, bounds),
    axes=st.tuples(*[angles] * 3, *[finite] * 3),
)
def test_every_problem_survives_its_file_bit_by_bit(
    x: float, heading: float, floor: float, velocity: tuple[float, ...], axes: tuple[float, ...],
    tmp_path_factory: pytest.TempPathFactory,
) -> None:  # fmt: skip
    """Headings that no number of degrees says, floors without walls, gates at any attitude."""
    turn = ab.tilted_gate((x, 1.0, 20.0), *axes[:3], name="the gate")
    problem = ab.Problem(
        "any",
        ab.at_rest((x, axes[3], 20.0)),
        ab.at_rest((axes[4], axes[5], 20.0)),
        ab.Line(GatePassage(speed=abs(x) / 1e6)),
        gates=(turn,),
        limits=ab.Limits(lower=(-np.inf, -np.inf, floor), velocity=velocity),
        heading=heading,
        environment=ab.Environment(gravity=abs(x) + 0.1, ground=floor),
    )
    path = tmp_path_factory.getbasetemp() / "any.toml"
    ab.write_problem(problem, path)
    assert ab.load_problem(path) == problem


@pytest.mark.parametrize("name", ab.vehicle_names())
def test_a_vehicle_survives_its_file(name: str, tmp_path: Path) -> None:
    lopsided = np.array([[2e-3, 1e-4, 0.0], [1e-4, 2e-3, 0.0], [0.0, 0.0, 3e-3]])
    stock = ab.load_vehicle(name)
    odd = replace(stock.rotors[0], radius=0.5)
    for vehicle in (stock, replace(stock, inertia=lopsided, rotors=(odd, *stock.rotors[1:]), body=None)):
        ab.write_vehicle(vehicle, tmp_path / "written.toml")
        again = ab.load_vehicle(tmp_path / "written.toml")
        assert again == vehicle
        assert hash(again) == hash(vehicle)


def test_typed_angles_are_written_as_they_were_typed(tmp_path: Path) -> None:
    ab.write_problem(ab.load_problem("flip-roll-translation"), tmp_path / "written.toml")
    written = (tmp_path / "written.toml").read_text()
    assert "heading_deg = 30.0" in written
    assert "tilt_deg = 180.0" in written
    assert "normal" not in written


def test_a_heading_is_given_in_degrees_or_radians_not_both() -> None:
    table = to_table(ab.load_problem("line"))
    assert from_table(ab.Problem, table | {"heading": 1.0}).heading == ab.Heading(1.0)
    assert from_table(ab.Problem, table | {"heading_deg": 180}).heading == ab.Heading(np.pi)
    with pytest.raises(SpecError, match="heading and heading_deg are both given"):
        from_table(ab.Problem, table | {"heading": 1.0, "heading_deg": 3.0})


def test_two_gates_of_one_name_are_refused() -> None:
    with pytest.raises(SpecError, match=r"^Problem\.gates\[2\]\.name: there are two gates named 'gate 2'"):
        ab.Problem("twins", START, GOAL, gates=(*THREE[:2], THREE[0]))


def test_a_flip_through_two_gates_is_refused() -> None:
    with pytest.raises(SpecError, match="a flip passes one gate, there are 2"):
        ab.Problem("two", START, GOAL, ab.Flip(), THREE[:2])


def test_a_line_passes_three_gates_in_their_order_at_times_of_the_planners_choice() -> None:
    sequence = ab.Problem("slalom", START, GOAL, ab.Line(), THREE).stages(30.0)
    assert [stage.gate for stage in sequence.stages] == ["gate 2", "gate 4", "gate 6"]
    assert [stage.at for stage in sequence.stages] == ["free"] * 3
    assert sequence.ordered
    centres = [[c.lower for c in stage.conditions if c.quantity == "position"] for stage in sequence.stages]
    assert centres == [[2.0, 0.0, 1.0], [4.0, 0.0, 1.0], [6.0, 0.0, 1.0]]


PLUGIN = '''
"""A maneuver of one's own."""

import aerobat as ab
from aerobat.declaration import Positive
from aerobat.problem import StageSequence


@ab.maneuver("zoom")
class Zoom(ab.Maneuver):
    """Upward at some speed on the way."""

    speed: Positive = 3.0  # [m/s] at least

    def stage_sequence(self, gates, max_specific_thrust):
        """One stage."""
        return StageSequence((ab.Stage("zoom", (ab.Condition("velocity", (0, 0, 1), self.speed),)),))
'''
ZOOMING = """
name = "zooming"
start = { position = [0.0, 0.0, 0.0] }
goal = { position = [0.0, 0.0, 6.0] }
maneuver = { kind = "zoom", speed = 4.0 }
"""


def test_a_maneuver_of_a_users_file_is_known_by_name_checked_planned_and_written(tmp_path: Path) -> None:
    (tmp_path / "zoom.py").write_text(PLUGIN)
    (tmp_path / "zooming.toml").write_text(ZOOMING)
    with pytest.raises(SpecError, match=r"maneuver\.kind must be one of .*'flip', .* got 'zoom'"):
        ab.load_problem(tmp_path / "zooming.toml")
    ab.import_plugin(tmp_path / "zoom.py")
    ab.import_plugin(tmp_path / "zoom.py")  # once is enough, twice is no harm
    assert "zoom" in ab.registered_maneuvers()
    problem = ab.load_problem(tmp_path / "zooming.toml")
    planned = ab.plan(problem, ab.Miqp(intervals=10), vehicle=None)
    assert planned.trajectory.evaluate(np.array([planned.stages[0].time]), 1)[0, 2] >= 4.0 - 1e-6
    ab.write_problem(problem, tmp_path / "again.toml")
    assert ab.load_problem(tmp_path / "again.toml") == problem
    assert pickle.loads(pickle.dumps(problem)) == problem
    (tmp_path / "zooming.toml").write_text(ZOOMING.replace("4.0", "-4.0"))
    with pytest.raises(SpecError, match=r"maneuver\.speed must be positive, got -4\.0$"):
        ab.load_problem(tmp_path / "zooming.toml")
    with pytest.raises(SpecError, match=r"only the gate of a half-flip .* is a zoom"):
        problem.maneuver.with_gate_tilt(THREE, 0.5)


@pytest.mark.parametrize(
    ("code", "sentence"),
    [
        (None, r"there is no such Python file"),
        ("import aerobat_of_nobody", r"cannot be imported: ModuleNotFoundError"),
        ("def f(:", r"cannot be imported: SyntaxError"),
        (PLUGIN.replace("zoom", "flip"), r"there are two maneuvers named 'flip'"),
        (PLUGIN.replace("(ab.Maneuver)", "").replace("zoom", "room"), r"must inherit from Maneuver"),
    ],
)
def test_a_file_that_is_no_plugin_is_one_sentence(code: str | None, sentence: str, tmp_path: Path) -> None:
    if code is not None:
        (tmp_path / "wrong.py").write_text(code)
    for _ in range(2):  # a failed import leaves nothing behind
        with pytest.raises(SpecError, match=f"^plugin .*wrong.py.*{sentence}"):
            ab.import_plugin(tmp_path / "wrong.py")
    assert ab.registered_maneuvers()["flip"] is ab.Flip


def test_installed_packages_bring_maneuvers_by_entry_points(monkeypatch: pytest.MonkeyPatch) -> None:
    """Imported when a name is asked for that nobody has registered yet."""
    registry: Registry[ab.Maneuver] = Registry(ab.Maneuver, "maneuver", "some.group")

    class Hover(ab.Maneuver):
        def stage_sequence(self, gates: Any, max_specific_thrust: float) -> StageSequence:
            return StageSequence()

    entry = SimpleNamespace(value="hovering", load=lambda: registry.add("hover", Hover))
    monkeypatch.setattr(
        "importlib.metadata.entry_points", lambda group: [entry] if group == "some.group" else []
    )
    assert registry["hover"].kind == "hover"
    assert list(registry) == ["hover"]
    with pytest.raises(SpecError, match="no maneuver named 'hoover'; did you mean 'hover'"):
        registry["hoover"]


def test_a_maneuver_that_nobody_registered_has_no_place_in_a_file() -> None:
    class Tumble(ab.Flip):
        pass

    with pytest.raises(SpecError, match="Tumble has no place in a file: it is not registered"):
        to_table(Tumble())


def test_a_field_called_kind_would_hide_a_maneuvers_name() -> None:
    with pytest.raises(ab.SpecError, match=r"Mine\.kind hides the name of the maneuver in files"):

        @ab.maneuver("with-a-kind")
        class Mine(ab.Maneuver):
            kind: str = "x"  # type: ignore[misc]

            def stage_sequence(self, gates: object, max_specific_thrust: float) -> ab.StageSequence:
                return ab.StageSequence(())
