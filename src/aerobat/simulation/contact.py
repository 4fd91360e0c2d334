"""The contact of a vehicle, where its plant feels one."""

from __future__ import annotations

from enum import IntEnum


class Contact(IntEnum):
    """The object that a vehicle touches; the gate where the vehicle touches both gate and ground."""

    NOTHING = 0
    GROUND = 1
    GATE = 2
