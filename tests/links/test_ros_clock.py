"""Time that waits for who is late, and ticks that are made up for; by a wall whose time the tests tell."""

from __future__ import annotations

from math import inf
from threading import Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.links.ros import middleware
from aerobat.links.ros.middleware import Middleware, PacedClock
from aerobat.links.ros.run import run

SECOND = 10**9  # [ns]


class Told(Middleware):
    """A node whose ROS tells one time after the other, and the last for ever."""

    make = publisher = subscribe = offer = None  # type: ignore[assignment]  # nothing travels here

    def __init__(self, *times: int) -> None:
        super().__init__(None)
        self._times = list(times)

    def ros_time(self) -> int:
        return self._times.pop(0) if len(self._times) > 1 else self._times[0]


class Wall:
    """What stands in for the module `time`."""

    def __init__(self) -> None:
        self.now = 0.0  # [s]

    def monotonic(self) -> float:
        return self.now

    def time_ns(self) -> int:
        return 5 * SECOND

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@given(steps=st.lists(st.floats(0.0, 0.3), max_size=40), speed=st.floats(0.1, 4.0))
def test_a_clock_never_runs_ahead_of_who_is_waited_for_nor_back(steps: list[float], speed: float) -> None:
    wall = Wall()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(middleware, "time", wall)
        clock = PacedClock(speed)
        before, end = clock.time(), 5 * SECOND + SECOND // 5
        clock.wait_at(end)
        for step in steps:
            wall.now += step
            now = clock.time()
            assert before <= now
            assert now - before <= speed * step * SECOND + 1
            assert now <= end or wall.now >= 5.0
            before = now


def test_a_clock_goes_on_without_who_never_comes() -> None:
    wall = Wall()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(middleware, "time", wall)
        clock = PacedClock(1.0)
        clock.wait_at(5 * SECOND + SECOND // 100)
        for _ in range(1000):
            wall.now += 0.01
            clock.time()
        assert clock.time() - 5 * SECOND == pytest.approx(5.0 * SECOND, rel=0.01)


class Late:
    """ROS whose time jumps, and a node that notes for when it is ticked."""

    def __init__(self, jumps: dict[int, int]) -> None:
        self.origin, self.now = 7 * SECOND, 7 * SECOND
        self.jumps = jumps  # [ns] after which tick
        self.ticks: list[float] = []
        self.patience = inf  # [s] the least with which was waited

    def time(self) -> int:
        return self.now

    def work_until(self, instant: int, patience: float = inf) -> None:
        self.patience = min(self.patience, patience)
        self.now = max(self.now, instant)

    def tick(self, now: float) -> None:
        self.now += self.jumps.get(len(self.ticks), 0)
        self.ticks.append(now)


def test_a_few_ticks_that_were_missed_are_made_up_for_and_of_many_the_last() -> None:
    node = Late({3: SECOND // 20, 20: SECOND // 2})
    run(node, node, 100.0, 1.0)  # type: ignore[arg-type]
    numbers = [round(100.0 * now) for now in node.ticks]
    assert numbers == [*range(21), *range(70, 100)]
    assert node.patience < 0.1  # where time stands still until this node goes on


def test_calls_are_done_for_no_longer_than_patience_where_time_stands_still() -> None:
    done: list[str] = []
    node = Told(0)
    node.request(done.append, "what waited")
    node.work_until(1, patience=0.02)
    assert done == ["what waited"]


def test_a_clock_that_waits_tells_its_time_again_and_one_that_runs_does_not() -> None:
    wall, told = Wall(), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(middleware, "time", wall)
        clock = PacedClock(1.0)
        clock.resend = lambda: told.append(wall.now)
        clock.wait_at(5 * SECOND + SECOND)
        for _ in range(150):  # a second until it waits, and half a second of waiting
            wall.now += 0.01
            clock.time()
    assert 4 <= len(told) <= 6
    assert min(told) > 0.99


def test_whoever_still_waits_is_answered_when_the_node_ends() -> None:
    node, answers = Told(0, 1), []
    asking = Thread(target=lambda: answers.append(node.answer(lambda answer: None)))
    asking.start()
    while not node._unanswered:
        node.work_until(1)
    node.close()
    asking.join()
    assert answers == [(False, "the node has ended")]


def test_time_that_nobody_tells_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "time", Wall())
    with pytest.raises(SpecError, match="/clock"):
        Told(0).require_time()
    Told(SECOND).require_time()
