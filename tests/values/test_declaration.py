"""Declared values of any kind: how what does not fit reads, and tables of them, from files and back."""

import pickle
import runpy
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from aerobat.declaration import (
    FieldError,
    Positive,
    UnitVector,
    Vector3,
    declared,
    from_table,
    number,
    shown,
    to_table,
    unit,
    unknown_name,
)
from aerobat.documents import read_document, within, write_document
from aerobat.errors import SpecError
from places import ROOT


@declared
class Box:
    sides: Vector3
    hollow: bool = False


@declared
class Item:
    size: float = 1.0

    SHORTHANDS: ClassVar = {"half": "half the size"}

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        return {"size": 2.0 * number(table["half"], "half")} if "half" in table else table


@declared
class Scene:
    shape: Box
    scale: Positive = 1.0
    color: Literal["red", "green"] = "red"
    copies: Annotated[int, Field(ge=1, lt=10)] = 1
    extras: tuple[Box, ...] = ()
    item: Item = Item()
    label: str | None = None

    SHORTHANDS: ClassVar = {"twice": "two copies"}

    def __post_init__(self) -> None:
        if self.color == "green" and self.shape.hollow:
            raise FieldError("color", "must be red for a hollow shape")
        if self.copies == 9:
            raise SpecError("nine lives are for cats")

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        return table | {"copies": 2} if table.pop("twice", False) else table


BOX = {"sides": [1.0, 2.0, 3.0]}
WRONG = [
    ({}, "shape is missing; add it"),
    ({"shape": 3}, "shape must be a Box, in a file a table, got 3"),
    ({"shape": {}}, "shape.sides is missing; add it"),
    ({"shape": BOX | {"holow": 1}}, "shape.holow is not a known key; did you mean 'hollow'?"),
    ({"shape": BOX | {"q": 1}}, "shape.q is not a known key; known keys are sides, hollow"),
    ({"shape": BOX, "scale": 0}, "scale must be positive, got 0"),
    ({"shape": BOX, "scale": 1e-300}, "scale must be from 1e-15 to 1e+15, got 1e-300; check its unit"),
    ({"shape": BOX, "scale": 1e29}, "scale must be from 1e-15 to 1e+15, got 1e+29; check its unit"),
    ({"shape": {"sides": [1.0, 2.0]}}, "shape.sides must be 3 numbers, got a list of 2"),
    ({"shape": {"sides": [1.0, 1e300, 1.0]}}, "shape.sides[1] must be from -1e+15 to 1e+15, got 1e+300"),
    ({"shape": {"sides": [1.0, "x", 1.0]}}, "shape.sides[1] must be a number, got 'x'"),
    ({"shape": {"sides": [1.0, True, 1.0]}}, "shape.sides[1] must be a number, got True"),
    ({"shape": {"sides": [1.0, [], 1.0]}}, "shape.sides[1] must be a number, got an empty list"),
    ({"shape": {"sides": {"x": 1.0}}}, "shape.sides must be 3 numbers, got a table"),
    ({"shape": BOX | {"hollow": "very"}}, "shape.hollow must be true or false, got 'very'"),
    ({"shape": BOX | {"hollow": 1}}, "shape.hollow must be true or false, got 1"),
    ({"shape": BOX, "scale": "big"}, "scale must be a number, got 'big'"),
    ({"shape": BOX, "scale": True}, "scale must be a number, got True"),
    ({"shape": BOX, "color": "blue"}, "color must be 'red' or 'green', got 'blue'"),
    ({"shape": BOX, "copies": 0}, "copies must be 1 or more, got 0"),
    ({"shape": BOX, "copies": 10}, "copies must be less than 10, got 10"),
    ({"shape": BOX, "copies": 1.5}, "copies must be a whole number, got 1.5"),
    ({"shape": BOX, "extras": [BOX, 7]}, "extras[1] must be a Box, in a file a table, got 7"),
    ({"shape": BOX, "extras": 7}, "extras must be a list, got 7"),
    ({"shape": BOX, "item": 7}, "item must be an Item, in a file a table, got 7"),
    ({"shape": BOX, "item": {"half": 1e18}}, "item.half must be from -1e+15 to 1e+15, got 1e+18"),
    ({"shape": BOX, "label": 7}, "label must be text, got 7"),
    ({"shape": BOX | {"hollow": True}, "color": "green"}, "color must be red for a hollow shape"),
]


@pytest.mark.parametrize(("content", "complaint"), WRONG)
def test_what_does_not_fit_is_the_same_sentence_in_a_file_and_in_python(
    content: dict, complaint: str, tmp_path: Path
) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    for prefix, make in (
        (f"scene file {path}: ", lambda: read_document(path, Scene, "scene")),
        ("Scene.", lambda: Scene(**content)),
    ):
        with pytest.raises(SpecError) as caught:
            make()
        assert str(caught.value).startswith(prefix + complaint)
        assert str(caught.value).isprintable()


def test_an_unknown_key_is_told_before_the_field_that_lacks_it() -> None:
    with pytest.raises(SpecError, match=r"^shap is not a known key; did you mean 'shape'"):
        from_table(Scene, {"scale": 0, "shap": BOX})
    with pytest.raises(SpecError, match=r"^extras\[0\].side is not a known key"):
        from_table(Scene, {"shape": 3, "extras": [{"side": 1}]})


def test_a_sentence_about_the_whole_stands_after_its_place() -> None:
    with pytest.raises(SpecError, match=r"^nine lives are for cats$"):
        from_table(Scene, {"shape": BOX, "copies": 9})
    with pytest.raises(SpecError, match=r"^Scene: nine lives are for cats$"):
        Scene(Box((1, 2, 3)), copies=9)


def test_too_many_values_and_values_given_twice_are_refused() -> None:
    with pytest.raises(SpecError, match=r"^Box takes 2 values, got 3$"):
        Box((1, 2, 3), True, 5)  # type: ignore[call-arg]
    with pytest.raises(SpecError, match=r"^Box.sides is given twice"):
        Box((1, 2, 3), sides=(1, 2, 3))  # type: ignore[misc]


def test_a_document_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    scene = Scene(Box((1, 2, 3), True), 2.0, extras=[Box((4, 5, 6))])
    write_document(path, to_table(scene))
    assert read_document(str(path), Scene, "scene") == scene
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene.toml"]


def test_a_shorthand_stands_for_fields_in_tables_only() -> None:
    assert from_table(Scene, {"shape": BOX, "twice": True}).copies == 2
    with pytest.raises(SpecError, match="twice is not a known key"):
        Scene(Box((1, 2, 3)), twice=True)  # type: ignore[call-arg]


def test_values_are_equal_by_content_and_so_are_their_hashes() -> None:
    one, same, other = Box((0.0, 2, 3)), Box(np.array([-0.0, 2, 3])), Box((1, 2, 4))
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert len({one, same, other}) == 2
    assert pickle.loads(pickle.dumps(one)) == one
    assert not pickle.loads(pickle.dumps(one)).sides.flags.writeable


@pytest.mark.parametrize("number", [np.float32(2.0), np.int64(2), np.array(2.0), 2])
def test_numbers_of_numpy_are_numbers(number: Any) -> None:
    assert Scene(Box((1, 2, 3)), scale=number) == Scene(Box((1, 2, 3)), scale=2.0)


@given(st.tuples(*[st.floats(-1e3, 1e3)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-6))
def test_a_unit_vector_made_again_is_the_same_bit_by_bit(vector: tuple[float, ...]) -> None:
    once = unit(vector)
    assert np.linalg.norm(once) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_array_equal(unit(once), once)


@declared
class Arrow:
    toward: UnitVector
    length: float = 1.0


def attempt(cls: type, *values: Any) -> tuple[str, Any]:
    """What is wrong with the values, or what they make; an error of any other kind passes through."""
    try:
        return "", cls(*values)
    except SpecError as error:
        return str(error), None


JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.just(10**400),
    st.floats(),
    st.complex_numbers(),
    st.text(max_size=3),
    st.binary(max_size=2),
    st.lists(st.one_of(st.none(), st.booleans(), st.floats(), st.text(max_size=2)), max_size=4),
    st.dictionaries(st.one_of(st.text(max_size=2), st.integers()), st.integers(), max_size=2),
)


@given(JUNK, JUNK)
def test_any_value_in_python_makes_a_value_or_one_sentence(toward: Any, length: Any) -> None:
    complaint, made = attempt(Arrow, toward, length)
    assert made is not None or complaint.startswith("Arrow.")
    assert complaint.isprintable()
    assert made is None or from_table(Arrow, to_table(made)) == made


def test_a_document_that_cannot_be_written_is_a_sentence_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SpecError, match=r"^cannot write .*scene\.toml: "):
        write_document(tmp_path / "file" / "scene.toml", {"shape": BOX})
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_prefixes_nest() -> None:
    with pytest.raises(SpecError, match=r"^stages\[2\]\.lower must not exceed upper$"), within("stages[2]."):
        raise SpecError("lower must not exceed upper")


def test_an_unknown_name_is_met_with_all_known_ones_even_of_an_iterator() -> None:
    error = unknown_name("solver", "gurobo", iter(["scip", "gurobi"]))
    assert str(error) == "no solver named 'gurobo'; did you mean 'gurobi'? Known: scip, gurobi"


def test_the_page_on_files_says_what_the_declarations_say() -> None:
    """After a change of them: uv run python docs/make_files_page.py."""
    maker = runpy.run_path(str(ROOT / "docs" / "make_files_page.py"))
    assert maker["page"]() == (ROOT / "docs" / "files.md").read_text(encoding="utf-8")
    declared_part = maker["page"]().partition(maker["WRITTEN"])[0]
    assert {row.count("|") for row in declared_part.splitlines() if row.startswith("|")} == {
        6,
        3,
    }  # keys, imports


def test_a_number_too_long_to_be_printed_is_shown_in_words() -> None:
    assert shown(16**5000) == "a huge number"
