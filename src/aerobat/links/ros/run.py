"""The loop of a node: tick, and take what comes until the next one is due."""

from __future__ import annotations

from importlib.resources import files
from math import inf
from typing import Protocol

from aerobat.interchange.ros import NANOSECONDS
from aerobat.links.ros.middleware import Middleware

# by the class of the middleware: what shows the topics
_FOLDER = files("aerobat.links.ros") / "rviz"
RVIZ = {
    "RospyMiddleware": f"rviz -d {_FOLDER / 'ros1.rviz'}",
    "RclpyMiddleware": f"rviz2 -d {_FOLDER / 'ros2.rviz'}",
}
_MADE_UP_FOR = 5  # ticks that were missed and are done at once
_CATCHING_UP = 0.005  # [s] after more, in which messages are taken that a tick would count as lost;
# of the wall too, for a clock may stand still until this very node goes on


class Node(Protocol):
    """A node that is ticked."""

    origin: int  # [ns] when its clock began

    def tick(self, now: float) -> None:
        """Go on to this time [s]."""


def run(node: Node, ros: Middleware, rate: float, seconds: float = inf) -> None:
    """Tick a node.

    Args:
        node: which.
        ros: its clock, and its messages.
        rate: of ticks [1/s], each for its own time; of many that were missed all but the last are left out.
        seconds: after which it ends.
    """
    period, tick = round(NANOSECONDS / rate), 0
    while tick * period < seconds * NANOSECONDS:
        ros.work_until(node.origin + tick * period)
        node.tick(tick * period / NANOSECONDS)
        present = (ros.time() - node.origin) // period
        if present - tick > _MADE_UP_FOR:
            ros.work_until(ros.time() + round(_CATCHING_UP * NANOSECONDS), _CATCHING_UP)
            tick = present
        else:
            tick += 1
