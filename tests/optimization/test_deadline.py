"""Limits of time and of work: all of it or a share."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from math import inf

import pytest

from aerobat.optimization import deadline
from aerobat.optimization.deadline import (
    count_work,
    out_of_time,
    time_left,
    wall,
    within_share,
    within_time,
    work,
)


def test_a_work_limit_ends_at_the_same_step_whatever_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    def steps() -> int:
        with within_time(0.05, work):
            return next(k for k in range(100) if out_of_time() or count_work(0.02))

    expected = steps()
    monkeypatch.setattr(deadline, "clock", lambda: 1e9)
    assert steps() == expected == 3


def test_work_in_another_thread_does_not_count() -> None:
    before = work()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(count_work, 1.0).result()
    assert work() == before


def test_a_share_is_of_what_is_left_by_each_clock() -> None:
    with within_share(0.5):
        assert time_left() is None
    with within_time(100.0), within_time(10.0, work):
        with within_share(0.5):
            assert time_left(wall) == pytest.approx(50.0, abs=1.0)
            assert time_left(work) == pytest.approx(5.0, abs=0.5)
        assert time_left(wall) == pytest.approx(100.0, abs=1.0)
    assert (time_left(wall) or inf) == inf
