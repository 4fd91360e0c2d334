"""The two suites of tests: the default one of three minutes, and the full one, which `--full` runs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from typing import Any

from hypothesis import HealthCheck, settings

from aerobat.errors import BackendMissing
from aerobat.links.betaflight.process import require_firmware

FAST, FULL = "fast", "full"
FEW, MANY = 12, 50  # examples of a law that names no number, in either suite: the same ones on every run
SHARE = 4  # of the examples that a law names, the default suite draws one in so many,
FEWEST = 3  # and no fewer than these, where it names as many

# each group of tests that the default suite leaves out, and what its tests are
GROUPS = {
    "slow": "takes more than a second of the processor",
    "process": "starts processes of its own, sends them signals, or fills their terminals",
    "browser": "opens pages in a browser; needs Chromium, Chrome or Edge",
    "peer": "compares with programs that others wrote, at length",
    "ros": "flies a session with a real ROS; needs the interpreters of ROS_PYTHONS",
    "betaflight": "flies on Betaflight's own firmware; needs the package betaflight, gcc and Linux",
    "docs": "runs the documentation, its tutorials and its site",
}
BROWSERS = (
    "chromium",
    "google-chrome",
    "msedge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
ROS_PYTHONS = {name: f"AEROBAT_{name.upper()}_PYTHON" for name in ("ros1", "ros2")}


def register_profiles() -> None:
    """Register Hypothesis's profiles: the same examples on every run, and no deadline."""
    common: dict[str, Any] = {
        "derandomize": True,
        "deadline": None,
        "suppress_health_check": [HealthCheck.too_slow],
    }
    settings.register_profile(FAST, max_examples=FEW, **common)
    settings.register_profile(FULL, max_examples=MANY, **common)


def examples(count: int, few: int | None = None) -> Callable[[Any], Any]:
    """Return the settings of a law.

    Args:
        count: Of the examples that it draws in the full suite.
        few: Likewise in the default suite, where a share of these would let mutants live.
    """
    if settings.get_current_profile_name() == FULL:
        return settings(max_examples=count)
    return settings(max_examples=few or min(count, max(FEWEST, count // SHARE)))


def browser() -> str | None:
    """Return the path of the system's browser, or None where it has none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def missing(group: str) -> str | None:
    """Return a sentence on how to get the part of the system that a group needs, None where it is there."""
    if group == "browser" and browser() is None:
        return (
            "no browser was found, neither Chromium nor Chrome nor Edge; install one, as with "
            "`apt-get install chromium`, or leave the browser's tests out"
        )
    if group == "betaflight":
        try:
            require_firmware()
        except BackendMissing as error:
            return f"{error}; or leave the tests with Betaflight out"
    unset = [name for name in ROS_PYTHONS.values() if not os.path.isfile(os.environ.get(name, ""))]
    if group == "ros" and unset:
        return (
            f"sessions with ROS need an interpreter that has it and Aerobat, named by {' and '.join(unset)}; "
            ".ci/run shows how to make both, or leave the tests with ROS out"
        )
    return None
