"""Runs that are killed or interrupted at random instants: what is left of them.

    uv run python benchmarks/interruptions.py kill 200
    uv run python benchmarks/interruptions.py interrupt 60

`kill` sends SIGKILL to a child that replaces an earlier run, and looks at the folder: it must hold the old
run or the new one, whole, no process may be left, and after the next run nothing else. `interrupt` sends
SIGINT to children that plan with each planner, compare and repeat, and looks for exit code 130, the word
"interrupted" and nothing written. Children are forked when all is imported, so that instants fall where the
work is.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter
from contextlib import suppress
from pathlib import Path

from aerobat.cli import main

LINES = {
    "new": ("fly", "line", "--json"),
    "old": ("fly", "line", "--order", "4", "--json"),
}
BEFORE = 99  # the exit code of what was not begun
COMMANDS = [
    *(("plan", "line", "--planner", name) for name in ("miqp", "min-snap", "free-knots", "time-optimal")),
    ("fly", "flip-roll", "--backend", "gurobi"),
    ("fly", "half-flip", "--conditions", "lab"),
    ("compare", "line"),
    ("repeat", "kept"),
]


def run(command: tuple[str, ...], after: float | None = None, by: int = 0) -> tuple[int, float, str]:
    """The wait status of a child that runs a command, its time [s], and what it said on standard error.

    Args:
        command: The command line's arguments.
        after: The instant of a signal [s]; None sends none.
        by: The signal.
    """
    with tempfile.TemporaryFile() as said:
        began = time.perf_counter()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # what Python calls at a fork swallows it
        child = os.fork()
        if not child:
            os.setpgid(0, 0)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(said.fileno(), 2)
            try:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                main(command)
            except SystemExit as stop:
                os._exit(int(stop.code or 0))
            except BaseException as error:  # a signal before the run has begun, or a defect
                os.write(2, repr(error).encode())
                os._exit(BEFORE)
            os._exit(0)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        with suppress(PermissionError):
            os.setpgid(child, child)
        if after is not None:
            time.sleep(after)
            os.kill(child, by)
        _, status = os.waitpid(child, 0)
        with suppress(ProcessLookupError):
            os.killpg(child, 0)
            raise AssertionError("a process is left")
        said.seek(0)
        return status, time.perf_counter() - began, said.read().decode()


def folder_holds(folder: Path) -> str:
    """Which run a folder holds, "old" or "new", by its record and by its plan; both must agree."""
    from aerobat.planning import load_plan
    from aerobat.simulation import load_flight

    names = {"line.plan", "plan.csv", "flight.npz", "report.json", "report.png", "run.toml"}
    assert {path.name for path in folder.iterdir()} == names, list(folder.iterdir())
    load_flight(folder / "flight.npz")
    record = tomllib.loads((folder / "run.toml").read_text())
    order = load_plan(folder / "line.plan").order
    assert order == record["planner"].get("order", 5), "the folder is a mixture"
    return "old" if order == 4 else "new"


def kill(count: int) -> None:
    """Kill at random instants, and count what the folder then holds."""
    rng, held, strays = random.Random(0), Counter[str](), 0
    for name in ("new", "old"):
        run(LINES[name])
    usual = max(run(LINES["new"])[1] for _ in range(3))
    for _ in range(count):
        run(LINES["old"])  # clears what the last one left
        assert [path.name for path in Path("out").iterdir()] == ["line"], list(Path("out").iterdir())
        run(LINES["new"], rng.uniform(0.0, 1.2 * usual), signal.SIGKILL)
        held[folder_holds(Path("out/line"))] += 1
        strays += len(list(Path("out").iterdir())) > 1
    print(
        f"{count} kills within {1.2 * usual:.2f} s: {dict(held)}; strays until the next run {strays}, after 0"
    )


def interrupt(count: int) -> None:
    """Interrupt at random instants, and count how runs end."""
    rng, ended = random.Random(1), Counter[str]()
    run((*LINES["new"], "--out", "kept"))
    usual = {command: run((*command, "--out", "first"))[1] for command in COMMANDS}
    for i in range(count):
        command = COMMANDS[i % len(COMMANDS)]
        before = sorted(Path().rglob("*"))
        status, _, said = run((*command, "--out", "out"), rng.uniform(0.0, usual[command]), signal.SIGINT)
        code = os.waitstatus_to_exitcode(status)
        if code == 130:
            lines = [line for line in said.splitlines() if not line.startswith("aerobat: planning")]
            assert lines == ["aerobat: interrupted"], (command, said)
            assert sorted(Path().rglob("*")) == before, "something is written"
            ended["130, nothing written"] += 1
        elif code == BEFORE and said == "KeyboardInterrupt()":
            ended["before it began"] += 1
        else:  # it was done before the signal came
            assert code in (0, 1), (command, code, said)
            assert Path("out/run.toml").exists()
            ended["done before"] += 1
            for path in Path("out").iterdir():
                path.unlink()
            Path("out").rmdir()
    print(f"{count} interrupts: {dict(ended)}")


if __name__ == "__main__":
    with suppress(ImportError):
        __import__("gurobipy")
    with tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        with suppress(SystemExit):
            main(("fly", "line", "--out", "warm"))  # imports what commands need
        {"kill": kill, "interrupt": interrupt}[sys.argv[1]](int(sys.argv[2]))
