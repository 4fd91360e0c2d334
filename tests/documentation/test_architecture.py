"""The page on the architecture follows the code: the ways of a plan and of a gate are those that are gone."""

from __future__ import annotations

import itertools
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import TypeVar

import pytest

import aerobat as ab
from aerobat import cli
from aerobat.kernels.gates.progress import GateProgress
from aerobat.kernels.gates.section import GatePlane
from aerobat.kernels.running_metrics import RunningMetrics
from aerobat.planning import PlacedStage, evidence
from aerobat.problem import StageSequence
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.simulation.metrics import Criteria
from places import ROOT

Found = TypeVar("Found")

ROW = re.compile(r"^\| `([\w/]+\.py)` \| `(\w+)` \| .* \|$", re.MULTILINE)
DECORATORS = ("declaration/validated.py",)
FORMS = (  # of a gate, from its file to its score
    ab.Problem,
    ab.Gate,
    ab.Stage,
    StageSequence,
    PlacedStage,
    PlannedPassage,
    Criteria,
    GatePlane,
    GateProgress,
    RunningMetrics,
    ab.Passage,
    ab.Score,
)
ROOMS = ("problem", "planning", "certification", "simulation", "kernels", "evaluation")
# who asks for a score, looks something up by its name, or takes one flight's part of many
HANDED_ON = (
    "score",
    "stages",
    "gate",
    "named_gate",
    "init",
    "of_flight",
    "map_arrays",
    "__getitem__",
)
WINDOW = """
name = "window"
maneuver = { kind = "line" }
start = { position = [0.0, 0.0, 1.0] }
goal = { position = [6.0, 0.0, 1.0] }
gates = [{ name = "window", position = [3.0, 0.0, 1.2] }]
"""


def test_the_way_of_a_plan_is_as_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ways: list[list[tuple[str, str]]] = []

    def certify(*arguments: object) -> object:
        frames = [
            (Path(frame.filename).as_posix().rpartition("src/aerobat/")[2], frame.name)
            for frame in traceback.extract_stack()
            if "src/aerobat/" in Path(frame.filename).as_posix()
        ]
        ways.append([frame for frame in frames if frame[0] not in DECORATORS])
        raise SystemExit

    monkeypatch.setattr(evidence, "certify", certify)
    with pytest.raises(SystemExit):
        cli.main(["plan", "flip-roll", "--out", str(tmp_path / "out")])
    assert ways[0] == way_of_a("plan")
    assert len(ways[0]) <= 21


def way_of_a(subject: str) -> list[tuple[str, str]]:
    """The files and functions that the page names in a section."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    [section] = (part for part in page.split("\n## ") if part.startswith(f"The way of a {subject}\n"))
    return ROW.findall(section)


def makers(run: Callable[[], Found]) -> tuple[Found, list[tuple[str, str]]]:
    """What is run, and the functions that return a gate in one of its forms, in the order of their calls."""
    calls: dict[int, int] = {}
    found: dict[tuple[str, str], int] = {}

    def heed(frame: FrameType, event: str, value: object) -> None:
        if event == "call":
            calls[id(frame)] = next(numbers)
        elif event == "return" and holds_form(value):
            file = Path(frame.f_code.co_filename).as_posix().rpartition("src/aerobat/")[2]
            name = frame.f_code.co_name
            within = "<" in frame.f_code.co_qualname  # another function, whose part it is
            if file.split("/")[0] in ROOMS and not within:
                found.setdefault((file, name), calls.get(id(frame), 0))

    numbers = itertools.count()
    before = sys.getprofile()
    sys.setprofile(heed)
    try:
        result = run()
    finally:
        sys.setprofile(before)
    return result, sorted(found, key=lambda maker: found[maker])


def holds_form(value: object, depth: int = 0) -> bool:
    """True for a gate in one of its forms, and for lists of such."""
    if isinstance(value, FORMS):
        return True
    parts = value if depth < 2 and isinstance(value, list | tuple) else ()
    return any(holds_form(each, depth + 1) for each in parts)


@pytest.mark.slow
def test_the_way_of_a_gate_is_as_the_page_says(tmp_path: Path) -> None:
    file = tmp_path / "window.toml"
    file.write_text(WINDOW)
    problem, read = makers(lambda: ab.load_problem(file))
    plan, planned = makers(lambda: ab.plan(problem, ab.MinSnap(), "agile-quad"))
    flight = ab.fly(plan, log_rate=62.5)  # rows so few that the kernel runs on floats as it is written
    score, scored = makers(lambda: ab.score(flight, plan))
    assert score.passages[0].inside
    way = way_of_a("gate")
    assert read[:1] == way[:1]
    assert set(way[1:3]) <= set(planned)
    assert [maker for maker in scored if maker[1] not in HANDED_ON] == way[3:]
    assert len(way) <= 12
