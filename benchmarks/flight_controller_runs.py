"""Repeatability of flights on Betaflight's own firmware, and what aborted ones leave behind.

Flies one half-flip of a lab ten times in processes of their own, two at a time, and prints how far their
largest errors differ. Then starts as many programs that fly as asked, ends each at some instant by Ctrl-C, by
SIGTERM or by SIGKILL, and prints which firmware, folder or port of theirs is left. Needs the firmware:
`uv sync --dev --group betaflight`. Argument: aborted programs (50).
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RUNS, AT_ONCE, LEFT_AFTER = 10, 2, 10.0  # [-], [-], [s] until what ends by itself has ended
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
FLIGHT = """
import aerobat as ab
plan = ab.plan("half-flip", ab.Miqp(reserve=0.1), "agile-quad")
flown = ab.fly(plan, autopilot="betaflight", conditions="lab", seed=1, flights=range(1))[0]
print(repr(float(flown.position_error.max())))
"""
LONG = """
import aerobat as ab, numpy as np
path = ab.Trajectory(np.array([600.0]), np.array([[[0.0, 0.0, 1.0]]]))
ab.fly(path, "agile-quad", autopilot="betaflight")
"""


def main(aborted: int) -> None:
    """Fly, abort, and print."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    errors = []
    for _ in range(RUNS // AT_ONCE):
        programs = [started(FLIGHT, subprocess.PIPE) for _ in range(AT_ONCE)]
        errors += [float(program.communicate()[0] or "nan") for program in programs]
    spread = 1e3 * (max(errors) - min(errors))
    print(
        f"{RUNS} flights: {100 * max(errors):.2f} cm off the path at most, {spread:.3g} mm apart", flush=True
    )
    ended = 0
    with tempfile.TemporaryDirectory() as folder:
        for k in range(0, aborted, AT_ONCE):
            programs = [started(LONG, subprocess.DEVNULL, folder) for _ in range(min(AT_ONCE, aborted - k))]
            time.sleep(random.Random(k).uniform(0.5, 8.0))
            for j, program in enumerate(programs):
                program.send_signal(SIGNALS[(k + j) % len(SIGNALS)])
                program.wait()
                ended += 1
        time.sleep(LEFT_AFTER)
        processes = [pid for pid in Path("/proc").glob("[0-9]*") if flew_in(pid, folder)]
        folders = [each.name for each in Path(folder).iterdir()]
    print(f"{ended} programs ended: {len(processes)} processes and ports left, {len(folders)} folders")


def started(script: str, output: int, folder: str | None = None) -> subprocess.Popen[bytes]:
    """A program that runs a script, its temporary files in a folder of ours."""
    own = {**os.environ} | ({"TMPDIR": folder} if folder else {})
    command = [sys.executable, "-c", script]
    return subprocess.Popen(
        command, stdout=output, stderr=None if output == subprocess.PIPE else output, env=own
    )


def flew_in(process: Path, folder: str) -> bool:
    """True of a process, not yet reaped ones among them, whose working folder is in a folder."""
    try:
        return str((process / "cwd").readlink()).startswith(folder)
    except OSError:
        return False


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
