"""`aerobat feasibility`, and their folders: what is there, what is repeated, what is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat import cli
from aerobat.cli.progress import Progress
from aerobat.interchange import read_table
from aerobat.studies.kept import KeptParts

MAP = ("feasibility", "half-flip", "--over", "angle=0:90:90", "--over", "speed=4:12:8")
LEAST = ("--least", "gate", "--least", "ceiling", "--tolerance", "0.2", "--workers", "1")
NEED = ("feasibility", "half-flip", *LEAST)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def code(*arguments: str) -> int:
    try:
        cli.main(arguments)
    except SystemExit as stop:
        return int(stop.code or 0)
    return 0


@pytest.mark.slow
def test_a_map_writes_a_row_a_cell_which_is_what_plan_says(capsys) -> None:
    assert code(*MAP, "--json", "--workers", "1") == 0
    facts = json.loads(capsys.readouterr().out)
    folder = Path("out/half-flip-map-angle-0-90-90-speed-4-12-8")
    assert {path.name for path in folder.iterdir()} == {"map.csv", "map.json", "map.png", "run.toml"}
    assert facts == json.loads((folder / "map.json").read_bytes())
    table = read_table(folder / "map.csv")
    np.testing.assert_array_equal(table["angle"], [0.0, 0.0, 90.0, 90.0])
    np.testing.assert_array_equal(table["speed"], [4.0, 12.0] * 2)
    planned = [cell["duration_s"] for cell in facts["cells"]]
    np.testing.assert_array_equal(table["duration_s"], [np.nan if x is None else x for x in planned])
    assert [x is None for x in planned] == [False, True] * 2
    assert all("limits.velocity" in cell["limits"] for cell in facts["cells"][1::2])
    problem = ab.load_problem("half-flip")
    problem_file = Path("fast.toml")
    ab.write_problem(problem, problem_file)
    text = problem_file.read_text()
    problem_file.write_text(text.replace('kind = "half-flip"', 'kind = "half-flip"\npassage = {speed = 4.0}'))
    assert ab.plan(ab.load_problem(problem_file), vehicle="agile-quad").duration == planned[2]


@pytest.mark.slow
def test_a_repeated_map_comes_to_the_same_bits(capsys) -> None:
    quick = ("--planner", "min-snap", "--workers", "1")
    assert code("feasibility", "line", "--over", "goal.position.x=1:3:2", "--out", "map", *quick) == 0
    assert capsys.readouterr().out.endswith("written to map/\n")
    assert code("repeat", "map") == 0
    assert "the same as in map/, bit for bit" in capsys.readouterr().err
    again, old = (read_table(f"{name}/map.csv") for name in ("map-repeated", "map"))
    np.testing.assert_array_equal(again["duration_s"], old["duration_s"])
    (Path("map") / "map.csv").write_bytes(b"")
    assert code("repeat", "map") == 2


def test_what_is_needed_is_told_and_written_with_its_plan(capsys) -> None:
    least = ("feasibility", "half-flip", "--least", "gate", "--tolerance", "0.5", "--workers", "1")
    assert code(*least, "--out", "gate") == 0
    assert "of its size" in capsys.readouterr().out
    assert {path.name for path in Path("gate").iterdir()} == {"need.json", "run.toml", "half-flip-gate.plan"}
    facts = json.loads(Path("gate/need.json").read_bytes())["requirements"]["gate"]
    assert ab.load_plan("gate/half-flip-gate.plan").duration == facts["duration_s"]


@pytest.mark.slow
def test_what_is_needed_is_written_with_its_plans_and_repeated(capsys) -> None:
    assert code(*NEED) == 0
    shown = capsys.readouterr().out
    assert "of its size" in shown
    folder = Path("out/half-flip-need-gate-ceiling-tolerance-0.2")
    plans = {f"half-flip-{quantity}.plan" for quantity in ("gate", "ceiling")}
    assert {path.name for path in folder.iterdir()} == {"need.json", "run.toml", *plans}
    facts = json.loads((folder / "need.json").read_bytes())
    for quantity, each in facts["requirements"].items():
        plan = ab.load_plan(folder / f"half-flip-{quantity}.plan")
        assert plan.certified
        assert plan.flies
        assert plan.duration == each["duration_s"]
        assert each["refused"] < each["least"]
        assert each["refusal"]
    assert code("repeat", str(folder), "--json") == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == facts
    assert "bit for bit" in err
    (folder / "need.json").write_text("3")
    assert code("repeat", str(folder)) == 2
    assert "need.json holds other facts than were written" in capsys.readouterr().err


REFUSED = (
    (("feasibility", "half-flip", "--over", "sped=1:2:1"), "did you mean 'speed'?"),
    (("feasibility", "half-flip", "--over", "speed=2:1:1"), "the range of speed is empty"),
    (("feasibility", "half-flip", "--over", "speed=1:2:0"), "the step of speed is 0"),
    (("feasibility", "half-flip", "--over", "speed=0:1:1e-7"), "speed has 10000001 values, 10000 at most"),
    (("feasibility", "half-flip", "--over", "speed=0:1:1e-320"), "speed has too many values, 10000 at most"),
    (("feasibility", "half-flip", "--over", "speed=0:1:-1e-320"), "the range of speed is empty"),
    (("feasibility", "half-flip", "--over", "speed=-1e308:1e308:1"), "too many values, 10000 at most"),
    (
        ("feasibility", "line", "--over", "speed=1:200:1", "--over", "vehicle.mass=1:91:1"),
        "18200 cells are too",
    ),
    (("feasibility", "line", "--over", "speed=1", "--least", "gate"), "--least finds the least, --over maps"),
    (("feasibility", "line", "--table", "parquet"), "--table is for a map"),
    (("feasibility", "half-flip", "--over", "speed=1", "--over", "speed=2"), "--over names speed twice"),
    (("feasibility", "half-flip", "--over", "angle=0:100:50"), "angle must be from -90 to 90 degrees"),
    (("feasibility", "flip-roll", "--over", "angle=0:90:50"), "only the gate of a half-flip can be tilted"),
    (("feasibility", "line", "--over", "vehicle.mass=1", "--planner", "free-knot"), "did you mean"),
    (("feasibility", "line", "--over", "vehicle.mass=1", "--segments", "3"), "--segments is for --planner"),
    (("feasibility", "line", "--over", "vehicle.mass=1", "--out", "mine"), "mine/ holds thesis.tex"),
    (("feasibility", "half-flip", "--least", "weight"), "weight"),
    (("feasibility", "line", "--least", "gate"), "has no gate that could be smaller"),
    (("feasibility", "line", "--tolerance", "0"), "tolerance"),
    (("feasibility", "line", "--out", "mine"), "mine/ holds thesis.tex"),
)


@pytest.mark.parametrize(("arguments", "said"), REFUSED)
def test_what_makes_no_sense_is_refused_in_a_sentence(arguments: tuple[str, ...], said: str, capsys) -> None:
    Path("mine").mkdir()
    Path("mine/thesis.tex").write_text("years of work")
    assert code(*arguments) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1
    assert [path.name for path in Path().iterdir()] == ["mine"]


def test_what_nothing_suffices_for_ends_with_its_own_code(capsys) -> None:
    Path("stuck.py").write_text(
        "import aerobat as ab\n\n\n"
        '@ab.planner("stuck")\nclass Stuck(ab.Planner):\n'
        "    def plan(self, problem, vehicle=None, progress=None):\n"
        '        raise ab.Infeasible("nothing", ["one attempt"])\n'
    )
    arguments = ("line", "--import", "stuck.py", "--planner", "stuck", "--workers", "1")
    assert code("feasibility", *arguments) == 3
    assert "'line' has no plan on agile-quad" in capsys.readouterr().err
    assert code("feasibility", *arguments, "--over", "vehicle.mass=0.9,1") == 0
    assert capsys.readouterr().out.count("no plan") == 2
    assert [path.name for path in Path("out").iterdir()] == ["line-stuck-map-vehicle.mass-0.9-1"]


def test_a_map_goes_on_from_cells_of_its_own_grid_and_says_how_many(monkeypatch, capsys) -> None:
    """Cells at other values counted as finished."""
    write = KeptParts.write

    def write_and_interrupt(*cell: object) -> None:
        write(*cell)
        signal.raise_signal(signal.SIGINT)

    def made(values: str) -> list[str]:
        command = ("feasibility", "line", "--over", f"vehicle.mass={values}", "--planner", "min-snap")
        ended = code(*command, "--workers", "1", "--out", "there")
        return [str(ended), *capsys.readouterr().err.splitlines()]

    with monkeypatch.context() as patch:
        patch.setattr(KeptParts, "write", write_and_interrupt)
        told = "aerobat: 1 of 2 cells are kept: the same command goes on from there"
        assert made("3.5,4") == ["130", told, "aerobat: interrupted"]  # too heavy to hover
        assert made("4,5,6") == ["130", told.replace("of 2", "of 3"), "aerobat: interrupted"]
    assert made("5,4") == ["0", "aerobat: goes on from 1 of 2 cells, which are kept"]
    assert [path.name for path in Path().iterdir()] == ["there"]


# is interrupted when the first plan is there
INTERRUPTED = """
import os, signal, sys
from aerobat import cli
from aerobat.cli import progress

def interrupt(self, *arguments):
    os.kill(os.getpid(), signal.SIGINT)
progress.Progress.tell = interrupt
cli.main(sys.argv[1:])
"""


@pytest.mark.process
@pytest.mark.parametrize("workers", ["1", "2"])
@pytest.mark.parametrize("is_map", [True, False])
def test_an_interrupt_leaves_what_is_finished_and_a_word(is_map: bool, workers: str) -> None:
    command = ("feasibility", "half-flip", "--over", "speed=4:8:2") if is_map else NEED[:-2]
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, *command, "--workers", workers],
        capture_output=True,  # to its end: the pipes close when the last process that holds them ends
        text=True,
        env=os.environ | {"AEROBAT_PROGRESS": "1000"},
    )
    kept = "aerobat: 1 of 3 cells are kept: the same command goes on from there\n" if is_map else ""
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", f"{kept}aerobat: interrupted\n")
    left = ["half-flip-map-speed-4-8-2-unfinished"] if is_map else []
    assert [path.name for path in Path().glob("out/*")] == left


def test_progress_says_how_many_and_how_long_still() -> None:
    now = [0.0]
    progress = Progress("cells", 100, lambda: now[0])
    assert str(progress) == "cells 0 of 100 in 0 s"
    now[0] = 5.0
    progress.counting("planned")(20, 12)
    assert str(progress) == "cells 20 of 100 in 5 s: 12 planned; 20 s to go"
    resumed = Progress("cells", 100, lambda: now[0], kept=80)  # by an earlier run: they take no time
    now[0] = 10.0
    resumed.counting("planned")(80, 60)
    assert str(resumed) == "cells 80 of 100 in 5 s: 60 planned"
    resumed.counting("planned")(90, 70)
    assert str(resumed) == "cells 90 of 100 in 5 s: 70 planned; 5 s to go"
    tried = Progress("plans tried", clock=lambda: now[0])
    for note in ("ceiling 3.51 planned", "gate 0.5 refused"):
        tried.step(note)
    assert str(tried) == "plans tried 2 in 0 s: gate 0.5 refused"
