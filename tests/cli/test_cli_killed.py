"""A run that is killed at any instant leaves the old run or the new one, whole, and the next one clears up.

The instants are those of what the process has done: it kills itself when a function is called. Children are
forked from a process that has imported everything, so that each takes as long as its work.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

KILLED_AT = """
import json, os, signal, sys
from pathlib import Path
from aerobat.cli import main

def child(arguments, function=None, left=0):
    pid = os.fork()
    if pid:
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    def watch(frame, event, argument):
        nonlocal left
        if event == "call" and frame.f_code.co_name == function:
            left -= 1
            if not left:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.setprofile(watch if function else None)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    try:
        main(arguments)
    except SystemExit as stop:
        os._exit(stop.code)
    os._exit(0)

try:
    main(["fly", "line", "--json", "--out", "warm/run"])
except SystemExit:
    pass
for order in "45":
    child(["plan", "line", "--order", order, "--json", "--out", f"plans/{order}"])
for function, nth in json.loads(sys.argv[1]):
    child(["fly", "plans/4", "--json", "--out", "runs/run"])
    cleared = sorted(os.listdir("runs"))
    code = child(["fly", "plans/5", "--json", "--out", "runs/run"], function, nth)
    files = {path.name: path.read_bytes().hex() for path in Path("runs/run").iterdir()}
    order = json.loads(bytes.fromhex(files["report.json"]))["plan"]["order"]
    print(json.dumps([function, nth, code, cleared, order, files]), file=sys.stderr)
"""
INSTANTS = [  # a function on the way, and which of its calls
    ["whole_folder", 1],
    ["write_columns", 1],
    ["write_record", 1],
    ["_sync", 6],
    ["end_interrupts", 1],
    ["_exchange", 1],
    ["rmtree", 2],  # of the old run, which is aside by then
    ["_rmtree_safe_fd", 1],
    ["print_json", 1],
]


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="two folders change places at once on Linux")
def test_killed_at_any_instant_a_folder_holds_the_old_run_or_the_new_one_whole(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", KILLED_AT, json.dumps(INSTANTS)], capture_output=True, text=True, cwd=tmp_path
    )
    found = [json.loads(line) for line in done.stderr.splitlines()]
    assert [[function, nth] for function, nth, *_ in found] == INSTANTS, done.stderr
    wholes: dict[int, list[dict[str, str]]] = {4: [], 5: []}
    for function, _, code, cleared, order, files in found:
        assert code == -9, function  # it was killed there
        assert cleared == ["run"]  # by the run before, whatever the last one left
        wholes[order].append(files)
    names = {"flight.npz", "line.plan", "plan.csv", "report.json", "report.png", "run.toml"}
    for runs in wholes.values():
        assert runs
        for files in runs:
            assert files.keys() == names
            for name in ("plan.csv", "run.toml"):  # pictures show the time taken
                assert files[name] == runs[0][name]  # the same run's, not the other's
    assert wholes[4][0]["plan.csv"] != wholes[5][0]["plan.csv"]
