"""The report's picture, drawn by a second process that loads matplotlib while the first plans and flies.

Loading and drawing take longer than all the rest of the main job; side by side they hardly show.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import subprocess
import sys
from importlib import import_module
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any

from aerobat.errors import AerobatError

if TYPE_CHECKING:
    from aerobat.flight import Flight
    from aerobat.metrics import Score
    from aerobat.planning import Plan
    from aerobat.vehicle import Vehicle


class Illustrator:
    """A process that draws one report page: enter early, `begin` when all is known, take the `picture`."""

    def __enter__(self) -> Illustrator:
        """Start the process; it loads what drawing needs."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process, drawn or not."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def begin(self, plan: Plan, vehicle: Vehicle, flight: Flight | None, score: Score | None) -> None:
        """Hand over what the page shows."""
        with self._pipe(self._process.stdin) as stdin:
            pickle.dump((plan, vehicle, flight, score), stdin)

    def picture(self) -> bytes:
        """The page as PNG, once it is drawn. Raises AerobatError when the process failed."""
        with self._pipe(self._process.stdout) as stdout:
            picture = stdout.read()
        if self._process.wait() or not picture:
            raise AerobatError("the picture could not be drawn; the process that draws it said why above")
        return picture

    @staticmethod
    def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
        if pipe is None:
            raise AerobatError("the picture has been drawn already; enter another Illustrator")
        return pipe


def unhurried_collector() -> None:
    """Let cyclic garbage lie longer: a short process spends a tenth of its time looking for it."""
    gc.set_threshold(100_000, 50, 50)


def main() -> None:
    """Load first, then wait for what to draw; end quietly when nothing comes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the first process to answer
    unhurried_collector()
    for name in (
        "matplotlib.figure",
        "matplotlib.backends.backend_agg",
        "aerobat.planning",
        "aerobat.flight",
    ):
        import_module(name)
    from aerobat.reporting.figures import png, report_figure

    try:
        page: Any = pickle.load(sys.stdin.buffer)
    except EOFError:
        return
    sys.stdout.buffer.write(png(report_figure(*page)))
    sys.stdout.buffer.flush()
    os._exit(0)  # the picture is out, and somebody waits: no time for taking matplotlib apart


if __name__ == "__main__":
    main()
