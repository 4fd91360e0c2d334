"""Whatever is wrong with the input: one sentence, exit code 2, nothing written."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from aerobat import cli
from command_lines import without_pictures

Document = dict[str, Any]
NAN, INF = float("nan"), float("inf")


def preset(room: str, name: str) -> Document:
    return tomllib.loads((files(f"aerobat.{room}") / "presets" / f"{name}.toml").read_text("utf-8"))


def setting(path: str, value: Any) -> Callable[[Document], None]:
    """Set the field at a dotted path; digits index lists."""

    def change(document: Document) -> None:
        *parents, last = [int(p) if p.isdigit() else p for p in path.split(".")]
        for part in parents:
            document = document[part]
        document[last] = value

    return change


def dropping(path: str) -> Callable[[Document], None]:
    def change(document: Document) -> None:
        *parents, last = path.split(".")
        for part in parents:
            document = document[part]
        del document[last]

    return change


VEHICLE_FAULTS = {
    "negative mass": (setting("mass", -1.0), "mass"),
    "no mass": (dropping("mass"), "mass"),
    "mass in words": (setting("mass", "heavy"), "mass"),
    "mass not a number": (setting("mass", NAN), "mass"),
    "infinite mass": (setting("mass", INF), "mass"),
    "too heavy to hover": (setting("mass", 100.0), "mass"),
    "flat inertia": (setting("inertia", [0.001, 0.001, 0.0]), "inertia"),
    "inertia of no body": (setting("inertia", [0.001, 0.001, 0.01]), "inertia"),
    "two moments of inertia": (setting("inertia", [0.001, 0.001]), "inertia"),
    "unknown key": (setting("colour", "red"), "colour"),
    "unknown key of a rotor": (setting("rotors.0.max_trust", 5.0), "max_trust"),
    "three rotors": (lambda d: d["rotors"].pop(), "rotors"),
    "no rotors": (dropping("rotors"), "rotors"),
    "a spin of two": (setting("rotors.0.spin", 2), "spin"),
    "all rotors at one place": (
        lambda d: [r.update(position_body=[0.1, 0.1, 0.0]) for r in d["rotors"]],
        "rotors",
    ),
    "thrust range upside down": (setting("rotor_defaults.min_thrust", 50.0), "thrust"),
    "a thrust beyond all reason": (setting("rotor_defaults.min_thrust", -1e300), "min_thrust"),
    "negative lag": (setting("rotor_defaults.lag", -0.01), "lag"),
    "position of two numbers": (setting("rotors.1.position_body", [0.1, 0.1]), "position_body"),
}

PROBLEM_FAULTS = {
    "no start": (dropping("start"), "start"),
    "no goal position": (dropping("goal.position"), "goal.position"),
    "start not a number": (setting("start.position", [NAN, 0.0, 0.0]), "start.position"),
    "start in the plane": (setting("start.position", [0.0, 0.0]), "start.position"),
    "unknown maneuver": (setting("maneuver.kind", "loop"), "maneuver.kind"),
    "maneuver without kind": (dropping("maneuver.kind"), "maneuver.kind"),
    "unknown key": (setting("maneuver.axis", 3.0), "maneuver.axis"),
    "unknown table": (setting("obstacles", {}), "obstacles"),
    "flip in a gate that is not there": (setting("maneuver.gate", "red"), "no gate named 'red'"),
    "gate without width": (setting("gate.width", 0.0), "gate.width"),
    "negative limit": (setting("limits.velocity", -10.0), "limits.velocity"),
    "limit in words": (setting("limits.velocity", "fast"), "limits.velocity"),
    "goal outside the volume": (setting("limits.lower", [1.0, -9.0, -9.0]), "start.position"),
    "volume upside down": (
        lambda d: d["limits"].update(lower=[9.0, 9.0, 9.0], upper=[-9.0, -9.0, -9.0]),
        "limits",
    ),
    "start too fast": (setting("start.velocity", [11.0, 0.0, 0.0]), "start.velocity"),
    "ground beyond all reason": (setting("environment", {"ground": -1e300}), "environment.ground"),
    "weightless": (setting("environment", {"gravity": 0.0}), "environment.gravity"),
    "name with a slash": (setting("name", "a/b"), "name"),
    "infinite yaw": (setting("heading_deg", INF), "heading_deg"),
    "snap limit for a chain of jerk": (setting("limits.snap", 100.0), "limits.snap"),
    "stages of nothing": (setting("maneuver", {"kind": "stages", "stages": []}), "maneuver.stages"),
    "stage after the end": (
        setting("maneuver", {"kind": "stages", "stages": [{"name": "late", "at": 1.5}]}),
        "at",
    ),
    "backward through the gate": (setting("maneuver.passage", {"speed": -2.0}), "maneuver.passage.speed"),
    "no waypoints": (setting("maneuver", {"kind": "waypoints", "waypoints": []}), "maneuver.waypoints"),
    "an empty waypoint": (
        setting("maneuver", {"kind": "waypoints", "waypoints": [{"time": 1.0}]}),
        "maneuver.waypoints[0]",
    ),
    "a waypoint in w": (
        setting("maneuver", {"kind": "waypoints", "waypoints": [{"position": {"w": 1.0}}]}),
        "maneuver.waypoints[0].position",
    ),
    "a thrust without attitude": (
        setting("maneuver", {"kind": "waypoints", "waypoints": [{"gate": "gate", "thrust": 9.0}]}),
        "thrust",
    ),
    "waypoints back in time": (
        setting(
            "maneuver",
            {"kind": "waypoints", "duration": 0.5, "waypoints": [{"position": {"z": 1.0}, "time": 1.0}]},
        ),
        "times",
    ),
    "condition without bounds": (
        setting(
            "maneuver",
            {
                "kind": "stages",
                "stages": [
                    {"name": "s", "conditions": [{"quantity": "position", "direction": [1.0, 0.0, 0.0]}]}
                ],
            },
        ),
        "lower",
    ),
}

ARGUMENT_FAULTS = {
    "unknown problem": (["fly", "flip-rol"], "flip-roll"),
    "no such file": (["fly", "nowhere.toml"], "nowhere.toml"),
    "a folder for a file": (["fly", "folder.toml"], "folder.toml"),
    "unknown vehicle": (["fly", "line", "--vehicle", "agile-qad"], "agile-quad"),
    "unknown backend": (["plan", "line", "--backend", "gurobbi"], "gurobi"),
    "order 6": (["plan", "line", "--order", "6"], "order"),
    "order in words": (["plan", "line", "--order", "snap"], "order"),
    "no intervals": (["plan", "line", "--intervals", "0"], "intervals"),
    "a program too large for any memory": (["plan", "line", "--intervals", "3000"], "intervals"),
    "two intervals for five stages": (["plan", "flip-roll", "--intervals", "2"], "intervals"),
    "paper with order 4": (["plan", "line", "--paper", "--order", "4"], "--paper"),
    "angle of a flip": (["plan", "flip-roll", "--angle", "45"], "--angle"),
    "angle past 90": (["plan", "half-flip", "--angle", "120"], "--angle"),
    "angle not a number": (["plan", "half-flip", "--angle", "nan"], "--angle"),
    "unknown option": (["plan", "line", "--fast"], "--fast"),
    "unknown command": (["loop", "line"], "loop"),
    "no problem": (["fly"], "`aerobat fly` needs a PROBLEM; see `aerobat fly --help`"),
    "unknown conditions": (["fly", "line", "--conditions", "lap"], "conditions"),
    "conditions without a name": (["fly", "line", "--conditions", ""], "conditions"),
    "unknown controller": (["fly", "line", "--controller", "papr"], "did you mean 'paper'?"),
    "negative seed": (["fly", "line", "--seed", "-1"], "seed"),
    "negative time": (["plan", "line", "--time-limit", "-1"], "time_limit"),
    "output over a file": (["plan", "line", "--planner", "min-snap", "--out", "taken"], "taken"),
    "output to a name too long": (["plan", "line", "--planner", "min-snap", "--out", "x" * 300], "x" * 300),
    "unknown planner": (["plan", "line", "--planner", "magic"], "planner"),
    "segments of another planner": (["plan", "line", "--segments", "4"], "--segments"),
    "a solver for the closed form": (
        ["plan", "line", "--planner", "min-snap", "--backend", "scip"],
        "--backend",
    ),
    "the paper's program by another planner": (
        ["plan", "line", "--planner", "free-knots", "--paper"],
        "--paper",
    ),
    "no segments": (["plan", "line", "--planner", "free-knots", "--segments", "0"], "segments"),
    "segments without end": (["plan", "line", "--planner", "free-knots", "--segments", "1000"], "segments"),
    "closed form of order 6": (["plan", "line", "--planner", "min-snap", "--order", "6"], "order"),
    "stopped before it began": (
        ["plan", "line", "--planner", "min-snap", "--stop-after", "-1"],
        "stop_after",
    ),
    "no plan to check": (["check", "nowhere.npz"], "nowhere.npz"),
    "a file that holds no plan": (["check", "taken"], "taken"),
    "a folder without a plan": (["check", "folder.toml"], ".plan file"),
    "a vehicle to check with that is none": (["check", "taken", "--vehicle", "agile-qad"], "agile-quad"),
    "a limit below zero": (["check", "taken", "--max-speed", "-1"], "max-speed"),
    "rows at no rate": (["check", "taken", "--rate", "0"], "rate"),
    "a heading of degrees without end": (["check", "taken", "--heading", "1e9"], "--heading"),
    "a heading that is no number": (["fly", "taken.csv", "--heading", "nan"], "--heading"),
    "a problem to check": (["check", "flip-roll"], "`aerobat fly PROBLEM` writes one"),
    "a picture over another file": (["inspect", "taken", "--figure", "plan.csv"], "--figure"),
    "the paper's columns beside others": (
        ["plan", "line", "--columns", "paper,time"],
        "leave the others out",
    ),
    "conditions of a plan that need not pass": (["plan", "line", "--conditions", "lab"], "--pass"),
    "an autopilot of a plan that need not pass": (["plan", "line", "--autopilot", "betaflight"], "--pass"),
    "a controller that gives no rates": (
        ["plan", "line", "--pass", "0.9", "--autopilot", "betaflight", "--controller", "lee"],
        "leave --controller out",
    ),
    "to pass for certain": (["fly", "line", "--pass", "1", "--conditions", "lab"], "--pass"),
    "to pass as in the paper": (
        ["plan", "line", "--paper", "--pass", "0.9", "--conditions", "lab"],
        "--paper",
    ),
    "to pass without a reserve": (
        ["plan", "line", "--pass", "0.9", "--conditions", "lab", "--planner", "min-snap"],
        "miqp",
    ),
    "two problems": (
        ["plan", "line", "flip-roll"],
        "`aerobat plan` has no use for 'flip-roll'; leave it out",
    ),
    "an option without its value": (["plan", "line", "--seed"], "`aerobat plan` needs a value after --seed"),
    "a comparison of nothing": (["compare", "flip-rol"], "flip-roll"),
}


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The sentence with which the command line refuses."""
    before = snapshot(Path())
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    out, err = capsys.readouterr()
    assert stop.value.code == 2, err
    assert out == ""
    *suspicions, sentence = err.splitlines()
    assert all(line.startswith("aerobat: warning: ") for line in suspicions)
    assert sentence.startswith("aerobat: ")
    assert snapshot(Path()) == before
    return sentence


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    Path("taken").write_text("a file")
    Path("folder.toml").mkdir()


@pytest.mark.parametrize("fault", VEHICLE_FAULTS)
def test_a_malformed_vehicle_is_refused_by_its_field(fault: str, capsys) -> None:
    change, field = VEHICLE_FAULTS[fault]
    document = copy.deepcopy(preset("vehicle", "agile-quad"))
    change(document)
    Path("vehicle.toml").write_text(tomli_w.dumps(document))
    assert field in refused(["fly", "line", "--vehicle", "vehicle.toml"], capsys)


@pytest.mark.parametrize("fault", PROBLEM_FAULTS)
def test_a_malformed_problem_is_refused_by_its_field(fault: str, capsys) -> None:
    change, field = PROBLEM_FAULTS[fault]
    document = copy.deepcopy(preset("problem", "flip-roll"))
    change(document)
    Path("problem.toml").write_text(tomli_w.dumps(document))
    assert field in refused(["fly", "problem.toml", "--order", "3"], capsys)


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(fault, marks=pytest.mark.slow) if fault == "output to a name too long" else fault
        for fault in ARGUMENT_FAULTS
    ],
)
def test_an_argument_that_makes_no_sense_is_refused_by_its_name(fault: str, capsys) -> None:
    arguments, named = ARGUMENT_FAULTS[fault]
    assert named in refused(arguments, capsys)


@pytest.mark.parametrize("kept", [0.1, 0.3, 0.5])
@pytest.mark.parametrize("room", ["vehicle", "problem"])
def test_a_truncated_file_is_refused(room: str, kept: float, capsys) -> None:
    name = {"vehicle": "agile-quad", "problem": "flip-roll"}[room]
    whole = (files(f"aerobat.{room}") / "presets" / f"{name}.toml").read_bytes()
    Path("half.toml").write_bytes(whole[: int(kept * len(whole))])
    arguments = ["plan", "half.toml"] if room == "problem" else ["plan", "line", "--vehicle", "half.toml"]
    assert "half.toml" in refused(arguments, capsys)


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\x00", b"{}", b"[start\n", b"x = " + b"[" * 5000])
def test_a_file_that_is_no_problem_is_refused(content: bytes, capsys) -> None:
    Path("noise.toml").write_bytes(content)
    assert "noise.toml" in refused(["plan", "noise.toml"], capsys)
