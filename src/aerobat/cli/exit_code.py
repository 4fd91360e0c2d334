"""Outcomes of runs, as exit codes for scripts."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Outcome of a run, as an exit code for scripts."""

    WELL = 0
    NOT_WELL = 1  # not certified, or not flown as it should be
    BAD_INPUT = 2
    NO_PLAN = 3
    INTERRUPTED = 130  # as shells say it, and the next two
    BROKEN_PIPE = 141
    TERMINATED = 143
