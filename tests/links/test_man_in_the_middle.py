"""Flights with a man in the middle, over real sockets: flown well, or given up in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from man_in_the_middle import Mischief, flown, flown_with
from mavlink_sky import flip

IN_FLIGHT = 7.0  # [s] since the client began, when the plan is flown


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plans") / "flip.plan"
    flip().save(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_whatever_comes_the_end_is_a_good_flight_or_a_sentence(seed: int, plan: Path) -> None:
    """Two hundred were flown, by this module's script."""
    flight = flown(seed, plan)
    assert not flight.wrong, str(flight)


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
