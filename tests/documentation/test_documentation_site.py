"""What the site makes from the code: all names, all maneuvers, and links that lead somewhere."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from places import ROOT

sys.path.insert(0, str(ROOT / "docs"))

from site_pages import docstrings, gallery, outside, reference


def test_every_public_name_is_in_the_reference_once() -> None:
    listed = Counter(name for names in reference.public_names().values() for name in names)
    assert listed == Counter(ab.__all__)
    for room, names in reference.public_names().items():
        page = reference.page(room, names)
        assert all(page.count(f":: aerobat.{name}\n") == 1 for name in names)


def test_every_built_in_maneuver_and_every_example_is_in_the_gallery() -> None:
    shown = [exhibit.problem.name for exhibit in gallery.exhibits()]
    assert set(ab.problem_names()) <= set(shown)
    commands = {exhibit.command for exhibit in gallery.exhibits()}
    assert {f"aerobat fly examples/{file.name}" for file in (ROOT / "examples").glob("*.toml")} <= commands
    assert len(shown) == len(set(shown))


def test_links_of_pages_that_are_copied_into_the_site_lead_where_they_led(tmp_path: Path) -> None:
    generated = ROOT / "docs" / "generated"
    copies = outside.copies(generated)
    assert (ROOT / "CONTRIBUTING.md") in copies
    for page, copy in copies.items():
        before, after = (
            outside.LINK.findall(text)
            for text in (
                page.read_text(encoding="utf-8"),
                outside.relinked(page.read_text(encoding="utf-8"), page, copy, generated),
            )
        )
        for old, new in zip(before, after, strict=True):
            target = (page.parent / old).resolve()
            assert (copy.parent / new).resolve() == copies.get(target, target)
            assert target.exists()


@given(st.text(alphabet="ab*|_\\` ", max_size=30))
def test_docstrings_keep_their_words_and_lose_nothing_but_markup(line: str) -> None:
    escaped = docstrings.escaped(line)
    parts, kept = docstrings.CODE.split(line), docstrings.CODE.split(escaped)
    assert kept[1::2] == parts[1::2]  # code as it stands
    for part, plain in zip(kept[::2], parts[::2], strict=True):
        read, rest = "", iter(part)
        for character in rest:
            read += next(rest) if character == "\\" else character
        assert read == plain


@pytest.mark.parametrize(
    ("text", "readable"),
    [
        ("float | None", "float | None"),
        ("~typing.Annotated[float, Gt(gt=0), FieldInfo(description='positive number')]", "positive number"),
        ("Annotated[list[int], Check(x)] | None", "list[int] | None"),
        ("~typing.Annotated[int, A()] | ~typing.Annotated[str, FieldInfo(description='text')]", "int | text"),
    ],
)
def test_types_with_checks_are_told_by_what_they_ask(text: str, readable: str) -> None:
    assert docstrings.without_checks(text) == readable
