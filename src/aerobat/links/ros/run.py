"""The loop of a node: tick, and process messages until the next tick is due."""

from __future__ import annotations

from math import inf
from typing import Protocol

from aerobat.interchange.ros import NANOSECONDS
from aerobat.links.ros.middleware import Middleware

_MAX_MISSED_TICKS = 5  # largest number of missed ticks that are made up for at once
# [s] after more missed ticks, for processing messages that a tick would count as lost; also the limit in wall
# time, since a clock may stand still until this node goes on
_CATCH_UP_TIME = 0.005


class Node(Protocol):
    """A node that is ticked."""

    origin: int  # [ns] start of its clock

    def tick(self, now: float) -> None:
        """Advance to this time [s]."""


def run(node: Node, ros: Middleware, rate: float, seconds: float = inf) -> None:
    """Tick a node.

    Args:
        node: the node.
        ros: its clock, and its messages.
        rate: of ticks [1/s], each with its own time; of many missed ticks only the last is made up for.
        seconds: after which it ends.
    """
    period, tick = round(NANOSECONDS / rate), 0
    while tick * period < seconds * NANOSECONDS:
        ros.work_until(node.origin + tick * period)
        node.tick(tick * period / NANOSECONDS)
        present = (ros.time() - node.origin) // period
        if present - tick > _MAX_MISSED_TICKS:
            ros.work_until(ros.time() + round(_CATCH_UP_TIME * NANOSECONDS), _CATCH_UP_TIME)
            tick = present
        else:
            tick += 1
