"""The page on the architecture follows the code: the way of a plan is the one that is gone."""

from __future__ import annotations

import re
import traceback
from pathlib import Path

import pytest

from aerobat import cli
from aerobat.planning import evidence
from places import ROOT

ROW = re.compile(r"^\| `([\w/]+\.py)` \| `(\w+)` \| .* \|$", re.MULTILINE)
DECORATORS = ("declaration/validated.py",)


def test_the_way_of_a_plan_is_as_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ways: list[list[tuple[str, str]]] = []

    def certify(*arguments: object) -> object:
        frames = [
            (Path(frame.filename).as_posix().rpartition("src/aerobat/")[2], frame.name)
            for frame in traceback.extract_stack()
            if "src/aerobat/" in Path(frame.filename).as_posix()
        ]
        ways.append([frame for frame in frames if frame[0] not in DECORATORS])
        return certified(*arguments)

    certified = evidence.certify
    monkeypatch.setattr(evidence, "certify", certify)
    cli.main(["plan", "flip-roll", "--out", str(tmp_path / "out")])
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert ways[0] == ROW.findall(page)
    assert len(ways[0]) <= 21
