"""The contact of a vehicle, where its plant feels one."""

from __future__ import annotations

from enum import IntEnum


class Contact(IntEnum):
    """The object that a vehicle touches: of several, an obstacle before a gate before the ground."""

    NOTHING = 0
    GROUND = 1
    GATE = 2
    OBSTACLE = 3
