"""Vehicle files: the presets hold the published numbers; whatever is wrong in a file is one sentence."""

import dataclasses
import os
import re
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from aerobat.declaration import from_table
from aerobat.errors import SpecError
from aerobat.planning import plan
from aerobat.problem import load_problem
from aerobat.vehicle import Rotor, Vehicle, implausibilities, load_vehicle, vehicle_names
from places import ROOT

PRESETS = files("aerobat.vehicle") / "presets"
ANNOTATED = ROOT / "examples" / "vehicles" / "annotated.toml"
AGILE_QUAD = (PRESETS / "agile-quad.toml").read_text(encoding="utf-8")


def test_the_presets_are_found_by_name_and_say_where_their_numbers_come_from() -> None:
    assert vehicle_names() == ("agile-quad", "agilicious", "crazyflie", "hexarotor", "section-v", "x500")
    for name in vehicle_names():
        vehicle = load_vehicle(name)
        assert vehicle.name == name
        assert vehicle.description


@pytest.mark.parametrize("name", vehicle_names())
def test_every_number_of_a_preset_has_its_source_beside_it(name: str) -> None:
    heading, _, _ = (PRESETS / f"{name}.toml").read_text(encoding="utf-8").partition("[[rotors]]")
    for line in heading.splitlines():
        value, _, comment = line.partition("#")
        if value.strip() and "=" in value and '"' not in value:
            assert len(comment) > len(" [kg] "), line


def test_agile_quad_is_the_published_one() -> None:
    """Mass, inertia, thrust-to-weight of rpg_time_optimal's quads/quad.yaml; moments of its src/quad.py."""
    quad = load_vehicle("agile-quad")
    assert quad.mass == 0.85
    np.testing.assert_array_equal(quad.inertia, np.diag([0.001, 0.001, 0.0017]))
    assert quad.thrust_to_weight == pytest.approx(3.3, rel=1e-9)
    arm = 0.15 / np.sqrt(2)
    published = np.array([[1, 1, 1, 1], [1, -1, -1, 1], [-1, -1, 1, 1], [1, -1, 1, -1]])
    np.testing.assert_allclose(quad.allocation, published * [[1], [arm], [arm], [0.05]], atol=1e-6)
    np.testing.assert_array_equal(quad.lags, 0.02)


def test_section_v_has_the_allocation_of_the_authors_code() -> None:
    """Its evalTrajFeasibility.m with d = 0.3 and c = 1."""
    d, c = 0.3, 1.0
    matrix = [[1, 1, 1, 1], [d, 0, -d, 0], [0, d, 0, -d], [-c, c, -c, c]]
    vehicle = load_vehicle("section-v")
    np.testing.assert_allclose(vehicle.allocation, matrix)
    assert vehicle.mass == 1.4


def test_x500_hovers_where_its_autopilot_looks_for_it() -> None:
    """At 60 % of the thrust there is: MPC_THR_HOVER of PX4's airframe 4001_gz_x500."""
    x500 = load_vehicle("x500")
    assert 1.0 / x500.thrust_to_weight == pytest.approx(0.60, abs=0.01)
    assert [rotor.spin for rotor in x500.rotors] == [
        1,
        1,
        -1,
        -1,
    ]  # front right and rear left counter-clockwise


def test_hexarotor_and_crazyflie_are_of_their_class() -> None:
    hexarotor, crazyflie = load_vehicle("hexarotor"), load_vehicle("crazyflie")
    arms = [np.linalg.norm(rotor.position_body) for rotor in hexarotor.rotors]
    np.testing.assert_allclose(arms, 0.165, atol=1e-6)
    assert hexarotor.thrust_to_weight == pytest.approx(5.0)
    grams = crazyflie.max_thrusts.sum() / 9.81 * 1e3
    assert grams == pytest.approx(57.9, abs=0.01)  # Bitcraze's measurement
    assert (crazyflie.drag_body > 0).all()


def table() -> dict[str, Any]:
    """A good vehicle file to spoil."""
    return tomllib.loads(AGILE_QUAD)


def written(folder: Path, content: dict[str, Any] | str | bytes) -> Path:
    content = tomli_w.dumps(content) if isinstance(content, dict) else content
    path = folder / "mine.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def same(one: Vehicle, other: Vehicle) -> bool:
    arrays = ("inertia", "drag_body", "allocation", "min_thrusts", "max_thrusts", "lags")
    return one.mass == other.mass and all(np.array_equal(getattr(one, a), getattr(other, a)) for a in arrays)


def test_a_file_is_loaded_by_its_path_and_named_after_itself(tmp_path: Path) -> None:
    path = written(tmp_path, AGILE_QUAD)
    for way in (path, str(path), os.path.relpath(path)):
        mine = load_vehicle(way)
        assert mine.name == "mine"
        assert same(mine, load_vehicle("agile-quad"))
    assert load_vehicle(written(tmp_path, table() | {"name": "other"})).name == "other"


def test_a_rotor_overrides_what_the_defaults_say(tmp_path: Path) -> None:
    content = table()
    content["rotors"][2]["max_thrust"] = 5
    np.testing.assert_array_equal(
        load_vehicle(written(tmp_path, content)).max_thrusts, [6.8792625, 6.8792625, 5, 6.8792625]
    )


def test_a_file_without_defaults_spells_every_rotor_out(tmp_path: Path) -> None:
    content = table()
    defaults = content.pop("rotor_defaults")
    content["rotors"] = [defaults | rotor for rotor in content["rotors"]]
    assert same(load_vehicle(written(tmp_path, content)), load_vehicle("agile-quad"))


def test_inertia_is_three_principal_moments_or_a_matrix(tmp_path: Path) -> None:
    matrix = [[0.001, 0.0001, 0], [0.0001, 0.001, 0], [0, 0, 0.0017]]
    np.testing.assert_array_equal(
        load_vehicle(written(tmp_path, table() | {"inertia": matrix})).inertia, matrix
    )


def put(*place: str | int, value: Any) -> Callable[[], dict[str, Any]]:
    def spoiled() -> dict[str, Any]:
        content = table()
        inner: Any = content
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = value
        return content

    return spoiled


def without(*place: str | int) -> Callable[[], dict[str, Any]]:
    def spoiled() -> dict[str, Any]:
        content = table()
        inner: Any = content
        for key in place[:-1]:
            inner = inner[key]
        del inner[place[-1]]
        return content

    return spoiled


def renamed(old: str, new: str) -> Callable[[], dict[str, Any]]:
    return lambda: {new if key == old else key: value for key, value in table().items()}


MALFORMED: dict[str, tuple[Callable[[], Any], str]] = {
    "empty": (lambda: b"", "mass, inertia and rotors are missing; add them"),
    "not UTF-8": (lambda: b'description = "\xff\xfe"', "byte 15 is not UTF-8 text"),
    "not TOML": (lambda: "mass: 0.85\n", "this is not valid TOML: "),
    "truncated": (lambda: AGILE_QUAD[: AGILE_QUAD.index("0.85")], "this is not valid TOML: "),
    "a key twice": (lambda: AGILE_QUAD.replace("lag =", "min_thrust ="), "this is not valid TOML: "),
    "binary": (lambda: bytes(range(256)), "byte 128 is not UTF-8"),
    "deep": (
        lambda: f"mass = {'[' * 5000}{']' * 5000}",
        "this is not a TOML file that can be read: it nests too deeply",
    ),
    "thousands of digits": (
        lambda: f"mass = {'9' * 5000}",
        "this is not a TOML file that can be read: line 1",
    ),
    "a body without length": (
        put("body", value={"semi_axes": [1e-300, 1.0, 1.0]}),
        "body must enclose rotors[0] with its propeller; inf times",
    ),
    "huge integer": (put("mass", value=10**400), "mass must be a number, got 1000"),
    "no mass": (without("mass"), "mass is missing; add it"),
    "mass misspelt": (renamed("mass", "mas"), "mas is not a known key; did you mean 'mass'?"),
    "Mass": (renamed("mass", "Mass"), "Mass is not a known key; did you mean 'mass'?"),
    "mass of text": (put("mass", value="0.85 kg"), "mass must be a number, got '0.85 kg'"),
    "mass true": (put("mass", value=True), "mass must be a number, got True"),
    "mass nan": (put("mass", value=float("nan")), "mass must be a finite number, got nan"),
    "mass infinite": (put("mass", value=float("inf")), "mass must be a finite number, got inf"),
    "mass negative": (put("mass", value=-1.0), "mass must be positive, got -1.0"),
    "mass a table": (put("mass", value={"kg": 0.85}), "mass must be a number, got a table"),
    "inertia short": (put("inertia", value=[1e-3, 1e-3]), "inertia must be 3 numbers, got a list of 2"),
    "inertia a number": (put("inertia", value=1e-3), "inertia must be 3 numbers, got 0.001"),
    "inertia ragged": (
        put("inertia", value=[[1], [1], [1]]),
        "inertia[0] must be 3 numbers, got a list of 1",
    ),
    "inertia of text": (put("inertia", value=[1e-3, "x", 1e-3]), "inertia[1] must be a number, got 'x'"),
    "inertia no body's": (put("inertia", value=[1e-3, 1e-3, 3e-3]), "inertia belongs to no rigid body"),
    "inertia negative": (put("inertia", value=[1e-3, 1e-3, -1e-3]), "inertia must be positive definite"),
    "inertia lopsided": (
        put("inertia", value=[[1, 0.2, 0], [0, 1, 0], [0, 0, 1]]),
        "inertia must be symmetric",
    ),
    "drag long": (put("drag_body", value=[0.1] * 4), "drag_body must be 3 numbers, got a list of 4"),
    "drag negative": (put("drag_body", value=[0.0, -0.1, 0.0]), "drag_body must not be negative"),
    "gravity": (put("gravity", value=9.81), "gravity is not a known key"),
    "name a number": (put("name", value=7), "name must be text, got 7"),
    "name of two lines": (put("name", value="a\nb"), "name must be one line of text"),
    "no rotors": (without("rotors"), "rotors is missing; add it"),
    "rotors a table": (put("rotors", value={"front": 1}), "rotors must be a list, got a table"),
    "a rotor a number": (put("rotors", 1, value=3), "rotors[1] must be a Rotor, in a file a table, got 3"),
    "three rotors": (without("rotors", 3), "rotors must be 4 or more, got 3"),
    "spin of three": (put("rotors", 2, "spin", value=3), "rotors[2].spin must be 1 or -1, got 3"),
    "spin a fraction": (put("rotors", 2, "spin", value=0.5), "rotors[2].spin must be 1 or -1, got 0.5"),
    "no spin": (without("rotors", 2, "spin"), "rotors[2].spin is missing; add it"),
    "spins alike": (put("rotors", 1, "spin", value=-1), "rotors cannot hold a level hover"),
    "position flat": (
        put("rotors", 0, "position_body", value=[0.1, 0.1]),
        "rotors[0].position_body must be 3 numbers, got a list of 2",
    ),
    "position unknown": (
        put("rotors", 3, "position", value=[0.1, 0.1, 0.0]),
        "rotors[3].position is not a known key; did you mean 'position_body'?",
    ),
    "no thrust limit": (
        without("rotor_defaults", "max_thrust"),
        "rotors[0].max_thrust is missing; add it there or, for all rotors, in [rotor_defaults]",
    ),
    "limits crossed": (
        put("rotors", 1, "min_thrust", value=9.0),
        "rotors[1].min_thrust must be below max_thrust, got 9 N and 6.87926 N",
    ),
    "lag negative": (put("rotor_defaults", "lag", value=-0.02), "rotor_defaults.lag must be 0 or more"),
    "lag of time": (
        lambda: AGILE_QUAD.replace("lag = 0.02", "lag = 00:00:02"),
        "rotor_defaults.lag must be a number, got datetime.time(0, 0, 2)",
    ),
    "default unknown": (
        put("rotor_defaults", "max_trust", value=3.0),
        "rotor_defaults.max_trust is not a known key; did you mean 'max_thrust'?",
    ),
    "table unknown": (
        put("engine", value={"cylinders": 4}),
        "engine is not a known key; known keys are name, mass, inertia, rotors, drag_body",
    ),
    "key of two lines": (put("a\nb", value=1), r"'a\nb' is not a known key"),
}


@pytest.mark.parametrize("fault", MALFORMED)
def test_a_malformed_file_is_one_sentence_that_names_the_file_and_the_field(
    fault: str, tmp_path: Path
) -> None:
    make, complaint = MALFORMED[fault]
    path = written(tmp_path, make())
    with pytest.raises(SpecError) as caught:
        load_vehicle(path)
    message = str(caught.value)
    assert message.startswith(f"vehicle file {path}: {complaint}")
    assert message.isprintable()
    assert len(message) < len(str(path)) + 220


def test_a_path_holds_no_nul() -> None:
    with pytest.raises(SpecError, match=r"^load_vehicle: name_or_path must be a path, got 'null.x00.toml'$"):
        load_vehicle("null\0.toml")


def test_what_is_no_file_is_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "flights").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SpecError, match=r"^vehicle file flights: this is a folder; give the path of a file"):
        load_vehicle("flights")
    for way, complaint in [
        (tmp_path / "none.toml", "there is no such file"),
        (tmp_path, "this is a folder"),
        (tmp_path / ("long" * 99), "cannot be read: File name too long"),
        (written(tmp_path, "") / "inside.toml", "cannot be read: Not a directory"),
    ]:
        with pytest.raises(SpecError, match=f"^vehicle file .*: {complaint}") as caught:
            load_vehicle(way)
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        (
            "agile-qad",
            "no vehicle named 'agile-qad'; did you mean 'agile-quad'? Known: agile-quad, agilicious",
        ),
        ("Crazyflie", "no vehicle named 'Crazyflie'; did you mean 'crazyflie'? Known: agile-quad"),
        ("zeppelin", "no vehicle named 'zeppelin'; known: agile-quad, agilicious, crazyflie, hexarotor"),
        ("", "no vehicle named ''; known: agile-quad"),
    ],
)
def test_a_name_that_no_preset_has_is_met_with_the_closest_one(name: str, hint: str) -> None:
    with pytest.raises(SpecError) as caught:
        load_vehicle(name)
    assert str(caught.value).startswith(hint)


def complaint_about(path: Path) -> str:
    """What is wrong with a file, if anything; an error of any other kind passes through."""
    try:
        load_vehicle(path)
    except SpecError as error:
        return str(error)
    return ""


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=4),
)


@given(st.integers(0, len(AGILE_QUAD)), st.binary(max_size=3))
def test_a_file_spoilt_anywhere_loads_or_is_one_sentence(
    tmp_path_factory: pytest.TempPathFactory, at: int, junk: bytes
) -> None:
    folder = tmp_path_factory.getbasetemp()
    for rest in (b"", AGILE_QUAD[at:].encode()):
        assert complaint_about(written(folder, AGILE_QUAD[:at].encode() + junk + rest)).isprintable()


@given(st.data())
def test_any_value_anywhere_loads_or_is_one_sentence(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content: Any = table()
    inner = content
    while True:
        key = data.draw(st.sampled_from(list(inner) if isinstance(inner, dict) else range(len(inner))))
        if not isinstance(inner[key], dict | list) or data.draw(st.booleans()):
            break
        inner = inner[key]
    junk = data.draw(JUNK)
    if junk is None:
        del inner[key]
    else:
        inner[key] = junk
    assert complaint_about(written(tmp_path_factory.getbasetemp(), content)).isprintable()


def test_the_annotated_example_has_every_key_that_a_vehicle_may_have() -> None:
    text = ANNOTATED.read_text(encoding="utf-8")
    keys = {field.name for cls in (Vehicle, Rotor) for field in dataclasses.fields(cls)}
    for key in keys | set(Vehicle.SHORTHANDS) | set(Rotor.SHORTHANDS):
        assert f"{key}]" in text or f"{key} = " in text, key
    racer = load_vehicle(ANNOTATED)
    assert implausibilities(racer) == ()
    np.testing.assert_allclose(racer.max_thrusts, 7.2, rtol=1e-3)
    np.testing.assert_allclose(racer.rotors[0].position_body, [0.094, 0.088, -0.011])


def test_what_the_annotated_example_says_instead_is_as_good() -> None:
    """Each commented key, put in the place of what it stands for, gives nearly the same vehicle."""
    racer = load_vehicle(ANNOTATED)
    content = tomllib.loads(ANNOTATED.read_text(encoding="utf-8"))
    lines = ANNOTATED.read_text(encoding="utf-8").splitlines()
    commented = [line.removeprefix("# ") for line in lines if re.match(r"# \w+ = ", line)]
    instead = tomllib.loads("\n".join(commented))
    others = {key: content["rotor_defaults"][key] for key in ("lag", "radius")}
    curve = {"thrust_curve": instead.pop("thrust_curve")}
    matrix = {"inertia": instead.pop("inertia")}
    for defaults in (curve, instead):
        other = from_table(Vehicle, content | matrix | {"rotor_defaults": others | defaults})
        np.testing.assert_allclose(other.max_thrusts, racer.max_thrusts, rtol=1e-3)
        np.testing.assert_allclose(other.allocation, racer.allocation, rtol=0, atol=5e-4)


@pytest.mark.slow
def test_a_maneuver_is_flown_by_the_annotated_example() -> None:
    found = plan(load_problem("flip-roll"), vehicle=load_vehicle(ANNOTATED))
    assert found.certificate.certified
    assert found.flies
