"""What a vehicle touches, where its plant feels that."""

from __future__ import annotations

from enum import IntEnum


class Contact(IntEnum):
    """What a vehicle touches; where it is both, the gate."""

    NOTHING = 0
    GROUND = 1
    GATE = 2
