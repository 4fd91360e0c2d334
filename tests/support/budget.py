"""The time of the processor that a test of the default suite may take."""

from __future__ import annotations

import os
import sys
import time

# a worker a core: threads of OpenBLAS, started when NumPy is first imported, would only wait for one another
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

LIMIT = 1.0  # [s] of the processor that the calibration's REFERENCE was measured on
REFERENCE = 0.005  # [s] that the loop below takes there
LOOPS = 200_000
TRIES = 5


def processor_seconds() -> float:
    """Return the time [s] that this process, and the children that it has waited for, have computed."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def exceeded(spent: float) -> float | None:
    """Return the limit [s] on this machine at this moment that a time [s] is beyond; None where it is not.

    A slower machine than the reference gets longer; how fast it is, is asked only where a test took long.
    """
    if spent <= LIMIT:
        return None
    limit = LIMIT * max(1.0, min(_loop() for _ in range(TRIES)) / REFERENCE)
    return limit if spent > limit else None


def is_measured() -> bool:
    """Return False where every line is traced, as for coverage, and times mean nothing."""
    return sys.gettrace() is None


def _loop() -> float:
    """Return the time [s] that a fixed piece of work takes."""
    began, total = time.process_time(), 0
    for k in range(LOOPS):
        total += k & 7
    return time.process_time() - began
