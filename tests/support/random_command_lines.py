"""Command lines at random, most of them wrong somewhere: values, files, options of others, odd combinations.

    uv run python tests/support/random_command_lines.py 800

runs so many and prints what is not as it should be.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from aerobat import cli
from aerobat.interchange import write_columns
from command_lines import without_pictures
from shared_plans import shared_plan

SLOW = 20.0  # [s]
CODES = {0, 1, 2, 3}  # what a run may come to that nobody interrupts
CHEAP = ("line", "line", "half-flip", "flip-roll", "short.toml")  # quickly planned
BROKEN = (
    "lien", "nowhere.toml", "broken.toml", "folder", "empty", "path.csv", "short.csv", "kept",
    "kept/line.plan", "kept/report.png", "", ".", "..", "/dev/null", "-", "--", "kept/flight.npz",
    "name\nwith lines", "ü.toml", "x" * 300, "nul\0.toml",
)  # fmt: skip
NUMBERS = (
    "0", "1", "2", "3", "5", "-1", "0.5", "1e-9", "1e9", "1e308", "1e999", "nan", "inf", "-inf", "", "ten",
    "0x10", "1_000", "٣", "3,5", "99999999999999999999", "--", "True", "None", " 4",
)  # fmt: skip
FEW = tuple(n for n in NUMBERS if n not in ("1e9", "1e308", "99999999999999999999"))  # nothing that lasts
VALUES: dict[str, tuple[str, ...]] = {
    "--vehicle": (
        "agile-quad",
        "crazyflie",
        "hexarotor",
        "agile",
        "broken.toml",
        "nowhere.toml",
        "folder",
        "",
    ),
    "--angle": ("30", "-90", *NUMBERS),
    "--out": (
        "here",
        "kept",
        "kept/deeper",
        "broken.toml",
        "mine",
        "/dev/null/x",
        "",
        ".",
        "x" * 300,
        "/proc/x",
    ),
    "--plan": ("kept", "kept/line.plan", "path.csv", "empty", "missing", "x" * 300),
    "--figure": ("picture.png", "folder", "", "/dev/null/x", "x" * 300),
    "--html": ("page.html", "kept/replay.html", "kept/plan.csv", "folder", "", "/dev/null/x", "x" * 300),
    "--video": ("video.gif", "video.avi", "folder", "", "/dev/null/x.gif", "x" * 300 + ".mp4"),
    "--speed": ("5", *(n for n in NUMBERS if n not in ("1", "0.5"))),
    "--planner": ("miqp", "min-snap", "free-knot", "", "None"),
    "--order": ("3", "4", "5", *NUMBERS),
    "--intervals": ("10", "20", "30", "1001", *(n for n in NUMBERS if n != "1e308")),
    "--backend": ("builtin", "gurobi", "cplex", ""),
    "--time-limit": ("0.001", "10", *NUMBERS),
    "--reserve": ("0.1", "0.499", "0.5", *NUMBERS),
    "--segments": ("1000", "1", "0", "-3", "many"),
    "--stop-after": ("1", "3", *NUMBERS),
    "--starts": ("0", "-1", "few"),
    "--conditions": ("none", "lab", "field", "lap", "../lab.toml"),
    "--seed": ("7", *NUMBERS),
    "--controller": ("full", "paper", "none", ""),
    "--runs": FEW,
    "--workers": FEW,
    "--table": ("csv", "xlsx", ""),
    "--flights": FEW,
    "--evaluations": FEW,
    "--connect": (
        "udp:127.0.0.1:9",
        "udp:127.0.0.1",
        "udp:127.0.0.1:70000",
        "/dev/null",
        "kept",
        "ftp:x:1",
        "",
    ),
    "--listen": ("udp:127.0.0.1:0", "udp:127.0.0.1", "udp:nowhere.invalid:9", "tcp", ""),
    "--wait": ("0.01", "-1", "nan", "ten"),
    "--hover-thrust": ("0.5", *NUMBERS),
    "--origin": ("0", "nan", "x"),
    "--max-error": NUMBERS,
    "--loss": NUMBERS,
    "--delay": NUMBERS,
    "--for": ("0.05", "-1", "nan", "ten"),
    "--columns": ("time", "paper", "time,position", "time,time", "speed", ",", ""),
    "--rate": ("50", *NUMBERS),
    "--heading": ("45", *NUMBERS),
    "--max-speed": ("3", *NUMBERS),
    "--max-tilt": ("60", *NUMBERS),
    "--max-rate": ("400", *NUMBERS),
    "--max-moment": ("0.1", *NUMBERS),
    "--to": ("csv", "crazyflie", "px4", "blender", "mcap", "ros1-bag", "ros2-bag", "csw", ""),
    "--import": ("plugin.py", "nowhere.py", "broken.toml", "raises.py", ""),
    "--over": (
        "vehicle.mass=0.9",
        "goal.position.x=1:2:1",
        "speed=2,3",
        "angle=0:90:90",
        "velocity=1",
        "masss=1",
        "x",
        "=",
        "",
        "vehicle.mass=1:0:1",
        "vehicle.mass=0:1:0",
        "vehicle.mass=0:1:1e-9",
        "vehicle.mass=1:2",
        "vehicle.mass=nan",
        "limits.upper.z=inf",
        "gate.width=0",
        "name=1",
        "gates[7].width=1",
        "a..b=1",
    ),
    "--least": ("ceiling", "gate", "thrust", ""),
    "--tolerance": ("0.3", "0.5", *NUMBERS),
    "--paper": (),
    "--json": (),
    "--no-rescue": (),
    "--planar": (),
    "--help": (),
    "--fast": (),
}
OWN = {
    "fly": [name for name in VALUES if not name.startswith("--max")],
    "plan": [
        name for name in VALUES if not name.startswith("--max") and name not in ("--conditions", "--seed")
    ],
    "check": [
        name for name in VALUES if name.startswith(("--max", "--veh", "--rate", "--head", "--json", "--imp"))
    ],
    "repeat": ["--out", "--json", "--import"],
    "view": ["--html", "--video", "--speed", "--json", "--import", "--vehicle"],
    "export": ["--to", "--out", "--rate", "--json", "--import"],
    "inspect": ["--plan", "--figure", "--json", "--import", "--vehicle"],
    "show": ["--help"],
    "compare": ["--out", "--angle", "--json", "--vehicle"],
    "sweep": ["--runs", "--workers", "--table", "--conditions", "--seed", "--vehicle", "--out", "--json"],
    "causes": ["--flights", "--conditions", "--seed", "--vehicle", "--angle", "--reserve", "--json"],
    "feasibility": [
        "--over", "--least", "--tolerance", "--workers", "--table", "--angle", "--vehicle", "--planner",
        "--out", "--json",
    ],
    "tune": ["--flights", "--evaluations", "--conditions", "--seed", "--vehicle", "--out", "--time-limit"],
    "link mavlink": [
        "--connect", "--wait", "--rate", "--hover-thrust", "--vehicle", "--origin", "--max-error", "--speed",
    ],
    "link mavlink-vehicle": ["--listen", "--loss", "--delay", "--seed", "--speed", "--for"],
}  # fmt: skip
SHORT = {
    "sweep": {"--runs": "3", "--workers": "1"},
    "causes": {"--flights": "2"},
    "feasibility": {"--over": "vehicle.mass=0.9", "--workers": "1", "--time-limit": "2"},
    "tune": {"--flights": "2", "--evaluations": "2"},
    "link mavlink": {"--wait": "0.05", "--connect": "udp:127.0.0.1:9"},
    "link mavlink-vehicle": {"--for": "0.05", "--listen": "udp:127.0.0.1:0"},
}  # what makes commands end soon


def fill(folder: Path) -> None:
    """The files that the command lines name."""
    (folder / "folder").mkdir()
    (folder / "empty").write_bytes(b"")
    (folder / "mine").mkdir()
    (folder / "mine" / "thesis.tex").write_text("years of work")
    (folder / "broken.toml").write_text("name = 'x'\n[start]\nposition = [0, 0]\n")
    (folder / "plugin.py").write_text("")
    (folder / "raises.py").write_text("raise RuntimeError('two\\nlines')")
    (folder / "short.toml").write_text(
        "name = 'short'\nstart = { position = [0, 0, 1] }\ngoal = { position = [1, 0, 1] }\n"
        "maneuver = { kind = 'line' }\n"
    )
    (folder / "short.csv").write_text("t,x,y,z\n0,0,0,1\n1,1,0,1\n2,1,0,1\n")
    write_columns(shared_plan("line"), folder / "path.csv", rate=50.0)
    shared_plan("line").save(folder / "line.plan")
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.chdir(folder),
        pytest.MonkeyPatch.context() as patch,
    ):
        without_pictures(patch)
        cli.main(["fly", "line.plan", "--out", "kept"])
    (folder / "line.plan").unlink()


def command_lines(count: int, seed: int) -> Iterator[list[str]]:
    """So many of them; the same for the same seed."""
    rng = random.Random(seed)
    for _ in range(count):
        yield _command_line(rng)


def _command_line(rng: random.Random) -> list[str]:
    often = ["fly", "plan", "check", "repeat", "view", "inspect", "export"]
    seldom = ["compare", "show", "show", "flyy", ""]
    command = rng.choice([*often * 4, *SHORT, *SHORT, *seldom])
    line = command.split()
    names = OWN.get(command, list(VALUES))
    if command != "show" and rng.random() < 0.95:
        right = {
            "check": ("kept", "path.csv", "kept/line.plan"),
            "repeat": ("kept",),
            "view": ("kept", "kept/line.plan", "kept/flight.npz"),
            "inspect": ("kept", "kept/flight.npz"),
            "export": ("kept", "kept/line.plan"),
            "compare": ("lien",),
            "causes": ("half-flip", "line"),
            "feasibility": ("line", "short.toml"),
            "tune": ("line", "kept"),
            "link mavlink": ("kept", "kept/line.plan"),
            "link mavlink-vehicle": ("agile-quad", "hexarotor"),
        }
        line.append(rng.choice(right.get(command, CHEAP) if rng.random() < 0.6 else BROKEN))
    if command == "compare" and line[-1] in CHEAP:  # all planners take long
        line[-1] = "lien"
    if command == "export" and rng.random() < 0.9:
        line += ["--to", rng.choice(VALUES["--to"])]
    for _ in range(rng.choice((0, 1, 1, 2, 2, 3, 5))):
        option = rng.choice(names if rng.random() < 0.9 else list(VALUES))
        line.append(option)
        if VALUES[option] and rng.random() < 0.97:
            line.append(rng.choice(VALUES[option]))
    for option, value in SHORT.get(command, {}).items():
        if option not in line:
            line += [option, value]
    return line


def faults(arguments: list[str], err: io.StringIO | None = None) -> list[str]:
    """All that is not as it should be about a command line in the working folder.

    Args:
        arguments: The command line's.
        err: What stands for standard error.
    """
    before = _content()
    out, err = io.StringIO(), io.StringIO() if err is None else err
    found = []
    code: object = 0
    with warnings.catch_warnings(record=True) as warned, contextlib.redirect_stdout(out):
        warnings.simplefilter("always")
        with contextlib.redirect_stderr(err):
            try:
                cli.main(arguments)
            except SystemExit as stop:
                code = int(stop.code) if isinstance(stop.code, int) else stop.code
            except BaseException as error:
                found.append(f"{type(error).__name__}: {error}")
    if code not in CODES:
        found.append(f"exit code {code}")
    found += [f"warning: {each.message}" for each in warned if issubclass(each.category, RuntimeWarning)]
    lines = err.getvalue().splitlines()
    found += [f"not one of our sentences: {line}" for line in lines if not line.startswith("aerobat: ")]
    asides = ("aerobat: warning:", "aerobat: planning with")
    said = [line for line in lines if not line.startswith(asides)]
    if code in (2, 3):
        if len(said) != 1 or not _is_silent(out.getvalue(), "--json" in arguments):
            found.append(f"{len(said)} sentences, {len(out.getvalue())} characters of output")
        if _content() != before:
            found.append("something is written")
    if list(Path().rglob("*.aerobat-part*")):
        found.append("a part is left")
    return found


def _is_silent(output: str, as_data: bool) -> bool:
    """True if standard output holds nothing, or the error as data where that is asked for."""
    return set(json.loads(output)) == {"error"} if as_data and output else not output


def _content() -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def main(count: int) -> None:
    """Run so many, and print what is wrong."""
    wrong = 0
    os.environ["AEROBAT_PROGRESS"] = "1e6"
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        fill(Path())
        for i, line in enumerate(command_lines(count, seed=count)):
            began = time.process_time()
            found = faults(line)
            if time.process_time() - began > SLOW:
                found.append(f"{time.process_time() - began:.1f} s of the processor")
            wrong += bool(found)
            if found:
                print(i, line, *found, sep="\n    ", flush=True)
    print(f"{wrong} of {count} are not as they should be")


if __name__ == "__main__":
    main(int(sys.argv[1]))
