"""Tutorials run from top to bottom, and show what they showed."""

import re

import nbformat
import pytest
from nbclient import NotebookClient

from places import ROOT

NUMBER = re.compile(r"\d+(?:\.\d+)?")
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))


def beginnings(text):
    """How lines begin: words, and numbers, which rounding on another processor changes a little."""
    lines = [line[:24] for line in text.splitlines()]
    return [NUMBER.sub("#", line) for line in lines], list(map(float, NUMBER.findall(" ".join(lines))))


def texts(notebook):
    """What the cells print."""
    return [
        [output["text"] for output in cell.outputs if output.output_type == "stream"]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


@pytest.mark.docs
@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_runs_from_top_to_bottom_and_shows_pictures_and_sentences(path, tmp_path):
    kept = nbformat.read(path, as_version=4)
    assert any("image/png" in o.get("data", {}) for c in kept.cells for o in c.get("outputs", ()))
    again = nbformat.read(path, as_version=4)
    NotebookClient(again, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    for before, after in zip(texts(kept), texts(again), strict=True):
        assert len(before) == len(after)
        for one, other in zip(before, after, strict=True):
            (words, numbers), (words_again, numbers_again) = beginnings(one), beginnings(other)
            assert words == words_again
            assert numbers == pytest.approx(numbers_again, rel=0.01)
