"""TOML documents of any kind: how what does not fit a model reads, and writing them back."""

from pathlib import Path
from typing import Annotated, Literal

import pytest
import tomli_w
from pydantic import BaseModel, ConfigDict, Field, model_validator

from aerobat.documents import read_document, unknown_name, within, write_document
from aerobat.errors import SpecError


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Circle(Table):
    kind: Literal["circle"]
    radius: Annotated[float, Field(gt=0)]


class Box(Table):
    kind: Literal["box"]
    sides: tuple[float, float, float]
    hollow: bool = False


class Scene(Table):
    shape: Annotated[Circle | Box, Field(discriminator="kind")]
    scale: float | tuple[float, float, float] = 1.0
    color: Literal["red", "green"] = "red"
    copies: Annotated[int, Field(ge=1, lt=10)] = 1
    extras: list[Circle | Box] = []

    @model_validator(mode="after")
    def red_circles_only(self) -> "Scene":
        if self.color == "green" and self.shape.kind == "circle":
            raise ValueError("color must be red for a circle")
        return self


CIRCLE = {"kind": "circle", "radius": 1.0}
BOX = {"kind": "box", "sides": [1.0, 2.0, 3.0]}


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ({}, "shape is missing; add it"),
        ({"shape": 3}, "shape must be a table, got 3"),
        ({"shape": {}}, "shape.kind is missing; add it"),
        ({"shape": {"kind": "ball"}}, "shape.kind must be one of 'circle', 'box', got 'ball'"),
        ({"shape": {"kind": "circle"}}, "shape.radius is missing; add it"),
        ({"shape": CIRCLE | {"radios": 1}}, "shape.radios is not a known key; did you mean 'radius'?"),
        ({"shape": CIRCLE | {"sides": 1}}, "shape.sides is not a known key; known keys are kind, radius"),
        ({"shape": CIRCLE | {"radius": 0}}, "shape.radius must be greater than 0.0, got 0"),
        ({"shape": BOX | {"sides": [1.0, 2.0]}}, "shape.sides[2] is missing; add it"),
        ({"shape": BOX | {"sides": [1, 2, 3, 4]}}, "shape.sides must have at most 3 entries, got 4"),
        ({"shape": BOX | {"hollow": "very"}}, "shape.hollow"),
        ({"shape": BOX, "scale": "big"}, "scale must be a number, got 'big'"),
        ({"shape": BOX, "scale": [1.0, "x", 1.0]}, "scale[1] must be a number, got 'x'"),
        ({"shape": BOX, "color": "blue"}, "color must be 'red' or 'green', got 'blue'"),
        ({"shape": BOX, "copies": 0}, "copies must be at least 1, got 0"),
        ({"shape": BOX, "copies": 10}, "copies must be less than 10, got 10"),
        ({"shape": BOX, "copies": 1.5}, "copies must be a whole number, got 1.5"),
        ({"shape": BOX, "extras": [CIRCLE, 7]}, "extras[1] must be a table, got 7"),
        ({"shape": CIRCLE, "color": "green"}, "color must be red for a circle"),
    ],
)
def test_what_does_not_fit_the_model_is_a_sentence_about_its_field(
    content: dict, complaint: str, tmp_path: Path
) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        read_document(path, Scene, "scene")
    message = str(caught.value)
    assert message.startswith(f"scene file {path}: {complaint}")
    assert message.isprintable()


def test_a_document_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    content = {"shape": BOX, "scale": 2.0, "extras": [CIRCLE]}
    write_document(path, content, "scene")
    assert read_document(str(path), Scene, "scene") == Scene.model_validate(content)
    assert [entry.name for entry in tmp_path.iterdir()] == ["scene.toml"]


def test_a_document_that_cannot_be_written_is_a_sentence_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(SpecError, match=r"^scene file .*scene\.toml: "):
        write_document(tmp_path / "file" / "scene.toml", {"shape": CIRCLE}, "scene")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_prefixes_nest() -> None:
    with pytest.raises(SpecError, match=r"^stages\[2\]\.lower must not exceed upper$"), within("stages[2]."):
        raise SpecError("lower must not exceed upper")


def test_an_unknown_name_is_met_with_all_known_ones_even_of_an_iterator() -> None:
    error = unknown_name("solver", "gurobo", iter(["scip", "gurobi"]))
    assert str(error) == "no solver named 'gurobo'; did you mean 'gurobi'? Known: scip, gurobi"
