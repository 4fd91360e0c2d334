"""Files drawn at random from the keys of docs/files.md: all of them, flown or refused in a sentence."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from own_files import random_files, verdict
from places import ROOT

DRAWS = [random_files(0, case) for case in range(200)]
KEY_ROW = re.compile(r"^\| `(\w+)` \| .* \|$", re.MULTILINE)


def keys(table: Any) -> Iterator[str]:
    """All keys in a table, however deep."""
    if isinstance(table, dict):
        yield from table
        table = list(table.values())
    if isinstance(table, list):
        for inner in table:
            yield from keys(inner)


def test_every_key_that_the_page_on_files_names_is_drawn_and_no_other() -> None:
    page = (ROOT / "docs" / "files.md").read_text(encoding="utf-8").partition("## Conditions")[0]
    documented = set(KEY_ROW.findall(page)) - {"rotor_defaults"}
    drawn = {key for draw in DRAWS for key in (*keys(draw.problem), *keys(draw.vehicle))}
    assert documented <= drawn
    assert drawn - documented <= {"kind", "rotor_defaults", "x", "y", "z"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("begin", "end", "flown"),
    [(11, 14, 2), (15, 21, 3)],  # earlier ones take minutes to refuse
)
def test_own_vehicles_and_maneuvers_are_flown_or_refused_in_one_sentence(
    begin: int, end: int, flown: int, tmp_path: Path
) -> None:
    found = [verdict(draw, tmp_path) for draw in DRAWS[begin:end]]
    for each in found:
        assert each.kind in ("flown", "told poor", "refused", "no plan"), each
        assert each.sentence.isprintable()
    assert [each.kind for each in found].count("flown") >= flown
