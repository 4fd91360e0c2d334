"""Limits of time: by either clock, all of it or a share."""

from __future__ import annotations

from math import inf
from time import sleep

import pytest

from aerobat.optimization.deadline import out_of_time, processor, time_left, wall, within_share, within_time


def test_the_processor_s_time_does_not_pass_while_others_work() -> None:
    with within_time(0.05, processor), within_time(1e3):
        sleep(0.1)
        assert not out_of_time()
        end = processor() + 0.05
        while processor() < end:
            pass
        assert out_of_time()
        assert (time_left(wall) or 0.0) > 990.0


def test_a_share_is_of_what_is_left_by_each_clock() -> None:
    with within_share(0.5):
        assert time_left() is None
    with within_time(100.0), within_time(10.0, processor):
        with within_share(0.5):
            assert time_left(wall) == pytest.approx(50.0, abs=1.0)
            assert time_left(processor) == pytest.approx(5.0, abs=0.5)
        assert time_left(wall) == pytest.approx(100.0, abs=1.0)
    assert (time_left(wall) or inf) == inf
