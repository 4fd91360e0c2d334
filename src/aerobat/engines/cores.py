"""Processors that there are."""

from __future__ import annotations

import os


def available_cores() -> int:
    """The processors that this process may use; where the system does not say, all there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
