"""Flights with a man in the middle, by MAVLink and by topics: flown well, or given up in a sentence.

The scripts in `tests/support` fly as many as one likes.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import ros_man_in_the_middle
from man_in_the_middle import Mischief, flown, flown_with
from mavlink_sky import flip

IN_FLIGHT = 7.0  # [s] since the client began, when the plan is flown


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plans") / "flip.plan"
    flip().save(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_whatever_comes_the_end_is_a_good_flight_or_a_sentence(seed: int, plan: Path) -> None:
    flight = flown(seed, plan)
    assert not flight.wrong, str(flight)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [*range(4), 163])
def test_whatever_odometry_says_a_maneuver_is_flown_well_or_given_up_in_a_sentence(seed: int) -> None:
    verdict, told = ros_man_in_the_middle.flown(seed)
    assert not verdict.startswith("wrong"), told


@pytest.mark.slow
@pytest.mark.parametrize("how", ["closed", "reset"])
@pytest.mark.parametrize(
    ("lasts", "ended", "last"), [(2.0, "landed", "landed"), (np.inf, "out of reach", "its own failsafe")]
)
def test_a_connection_by_tcp_that_breaks_in_flight_ends_in_a_report_and_is_opened_anew(
    how: str, lasts: float, ended: str, last: str, plan: Path
) -> None:
    """And nothing but the report is on standard output."""
    broken = Mischief(f"the connection {how}", IN_FLIGHT, IN_FLIGHT + lasts)
    flight = flown_with([broken], plan, tcp=True)
    assert not flight.wrong, str(flight)
    report = json.loads(flight.out)
    assert "no news of the vehicle for 0." in report["aborted"]
    assert report["ended"] == ended
    assert flight.said.strip().endswith(last)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("instant", "ended"), [(IN_FLIGHT, "hovering after the abort"), (IN_FLIGHT + 3.0, "landing")]
)
def test_a_flight_that_is_interrupted_ends_in_a_report_too(instant: float, ended: str, plan: Path) -> None:
    flight = flown_with([Mischief("an interrupt", instant, np.inf)], plan, tcp=False)
    report = json.loads(flight.out)
    assert flight.code == 130
    assert (report["aborted"], report["ended"]) == ("interrupted", ended)
    assert flight.said.strip().endswith("aerobat: interrupted")
