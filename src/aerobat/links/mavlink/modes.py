"""PX4's flight modes, as numbers in heartbeats and commands."""

from __future__ import annotations

from aerobat.links.goals import Mode

CUSTOM_MODE_ENABLED = 1  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
MAIN_AND_SUB = {  # PX4's main mode and, of its mode auto, the sub-mode
    Mode.TAKEOFF: (4, 2),
    Mode.HOLD: (4, 3),
    Mode.LAND: (4, 6),
    Mode.OFFBOARD: (6, 0),
}


def custom_mode(mode: Mode) -> int:
    """The number of a mode in heartbeats."""
    main, sub = MAIN_AND_SUB[mode]
    return main << 16 | sub << 24


def mode_of(number: int) -> Mode | None:
    """The mode of a number in heartbeats; None for one that is not among ours."""
    return next((mode for mode in MAIN_AND_SUB if custom_mode(mode) == number), None)
