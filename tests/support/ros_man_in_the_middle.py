"""Maneuvers by topics with a man in the middle, who changes what odometry says, or keeps goals back.

    uv run --dev python tests/support/ros_man_in_the_middle.py 200

flies so many and prints what came of them.
"""

from __future__ import annotations

import heapq
import sys
import traceback
from collections import Counter
from collections.abc import Callable
from copy import deepcopy
from itertools import count
from operator import attrgetter
from typing import Any

import numpy as np

from aerobat.links.commander import Doing
from aerobat.links.ros import topics
from ros_sky import BEGAN, Reply, Sky, aloft, at_the_flips_begin

OFF = 0.3  # [m] off its plan that a vehicle may be that is said to have flown it
Random = np.random.Generator
NUMBERS = (
    "pose.pose.position.x", "pose.pose.position.z", "pose.pose.orientation.w", "pose.pose.orientation.y",
    "twist.twist.linear.x", "twist.twist.linear.z", "twist.twist.angular.y",
)  # fmt: skip


def spoilt(value: float) -> Callable[[Any, Random], None]:
    """A number, whichever, replaced."""

    def change(message: Any, rng: Random) -> None:
        whole, _, last = NUMBERS[rng.integers(len(NUMBERS))].rpartition(".")
        setattr(attrgetter(whole)(message), last, value)

    return change


def stamped(seconds: Callable[[Random], float]) -> Callable[[Any, Random], None]:
    """A stamp that is so many seconds off."""

    def change(message: Any, rng: Random) -> None:
        stamp = message.header.stamp
        total = max(topics.nanoseconds(stamp) + round(1e9 * seconds(rng)), 0)
        stamp.sec, stamp.nanosec = divmod(total, 10**9)

    return change


def aside(message: Any, rng: Random) -> None:
    message.pose.pose.position.x += 5.0


def shrunk(message: Any, rng: Random) -> None:
    message.pose.pose.orientation.w *= 0.3
    message.pose.pose.orientation.z += 0.5


# what happens to a share of states
CHANGES: dict[str, Callable[[Any, Random], None]] = {
    "NaN": spoilt(np.nan),
    "infinity": spoilt(-np.inf),
    "a huge number": spoilt(1e300),
    "no attitude": shrunk,
    "5 m aside": aside,
    "stamps far ahead": stamped(lambda rng: 1e6),
    "stamps ahead": stamped(lambda rng: rng.uniform(0.0, 2.0)),
    "old stamps": stamped(lambda rng: -rng.uniform(0.0, 2.0)),
    "no stamps": stamped(lambda rng: -1e12),
    **{f"a clock {off:+g} s off": stamped(lambda rng, off=off: off) for off in (-0.3, -0.03, 0.03, 0.3)},
}
DELAYS = {"other order": 0.03, "delays": 0.2, "long delays": 1.0}  # [s] at most
OTHERS = ("copies", "losses", "silence", "goals lost", "no goals")


class Middle:
    """The man in the middle of one flight, and what he does from when to when."""

    def __init__(self, sky: Sky, seed: int) -> None:
        self._sky, self._rng, self._order = sky, np.random.default_rng(seed), count()
        names, rng = [*CHANGES, *DELAYS, *OTHERS], self._rng
        self.mischief = []
        for _ in range(0 if seed % 10 == 0 else rng.integers(1, 4)):
            begin = sky.now + rng.uniform(0.0, 4.0)
            span = float(begin), float(begin + rng.choice([0.3, 1.0, 3.0, np.inf]))
            self.mischief.append((str(rng.choice(names)), rng.choice([0.1, 0.5, 1.0]), span))
        self.not_finite = 0  # goals
        self._coming: list[tuple[float, int, Any]] = []
        sky.graph.change[topics.ODOMETRY] = self._odometry
        sky.graph.change[topics.GOAL] = self._goal

    def _on(self) -> list[str]:
        now = self._sky.now
        hits = [(name, share) for name, share, (begin, end) in self.mischief if begin <= now < end]
        return [name for name, share in hits if self._rng.random() < share]

    def _odometry(self, message: Any) -> list[Any]:
        message, names, rng, now = deepcopy(message), self._on(), self._rng, self._sky.now
        for name in names:
            CHANGES.get(name, lambda message, rng: None)(message, rng)
        if not {"losses", "silence"} & set(names):
            delay = sum(rng.uniform(0.0, DELAYS.get(name, 0.0)) for name in names)
            for due in (now + delay, now + delay + 0.1)[: 1 + ("copies" in names)]:
                heapq.heappush(self._coming, (due, next(self._order), message))
        arrived = []
        while self._coming and self._coming[0][0] <= now:
            arrived.append(heapq.heappop(self._coming)[2])
        return arrived

    def _goal(self, message: Any) -> list[Any]:
        self.not_finite += topics.read_goal(message, BEGAN) is None
        return [] if {"goals lost", "no goals"} & set(self._on()) else [message]


def flown(seed: int) -> tuple[str, str]:
    """A verdict on a flight with what a seed draws, and what it was."""
    is_begun = seed % 2 == 0
    sky = at_the_flips_begin() if is_begun else aloft(generation=1 + seed // 2 % 2)
    sky.said.clear()
    middle = Middle(sky, seed)
    told = f"{seed}: {'; '.join(f'{n} ({s:g}) {b:.1f}-{e:.1f} s' for n, s, (b, e) in middle.mischief)}"
    reply = Reply()
    try:
        if not is_begun:
            sky.graph.services["/aerobat/flip"](reply)
            sky.run(lambda: reply.success is not None)
        if is_begun or reply.success:
            sky.run(lambda: bool(sky.reports))
        sky.run_for(3.0)
        landing = sky.call("land")
        sky.run(lambda: sky.node.commander.doing is Doing.NOTHING or not landing.success, limit=90.0)
        sky.run_for(5.0)
    except Exception:
        return "wrong", f"{told}: {traceback.format_exc()}"
    verdict = verdict_on(sky, middle, reply)
    return verdict, f"{told}: {verdict}: {sky.reports or reply.sentence}; {sky.said[-2:]}; {landing.sentence}"


def verdict_on(sky: Sky, middle: Middle, reply: Reply) -> str:
    """Whether it was flown well, given up or refused in a sentence, or something was wrong."""
    if middle.not_finite:
        return f"wrong: {middle.not_finite} goals that are not finite"
    if sky.vehicle.crashed:
        return "wrong: a crash"
    if not (sky.hovers or sky.stands):
        return "wrong: it neither hovers nor stands"
    if reply.success is False:
        return "refused in a sentence" if reply.sentence else "wrong: refused without a word"
    (report,) = sky.reports
    if report.startswith("flown within"):
        return "flown well" if max(sky.errors) < OFF else f"wrong: {max(sky.errors):.2f} m off, unsaid"
    if not middle.mischief:
        return "wrong: a good flight that was given up"
    return "given up in a sentence" if "aborted: " in report else "missed its gate, as it says"


def main() -> None:
    """Fly, and print what came of each and of all."""
    first, last = (int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else (0, int(sys.argv[1]))
    counts: Counter[str] = Counter()
    for seed in range(first, last):
        verdict, told = flown(seed)
        counts[verdict] += 1
        print(told, flush=True)
    for verdict, number in sorted(counts.items()):
        print(f"| {verdict} | {number} |")


if __name__ == "__main__":
    main()
