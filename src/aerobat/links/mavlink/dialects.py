"""MAVLink dialects of autopilots: modes, thrust, states, take-off and refusals, one value for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from aerobat.links.goals import Mode

CUSTOM_MODE_ENABLED = 1  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED


class RequiredBits(NamedTuple):
    """Required bits of a parameter, without which set-points are not flown as intended."""

    mask: int
    bits: int
    meaning: str  # effect of other bits


@dataclass(frozen=True)
class Dialect:
    """The MAVLink conventions of one autopilot."""

    autopilot: int  # its number in heartbeats, MAV_AUTOPILOT
    firmware: int  # the version that the simulated vehicle reports to clients
    modes: Mapping[Mode, tuple[int, int]]  # main mode and sub-mode, as in orders
    mode_shift: int  # bit position of the main mode in a heartbeat's number; the sub-mode is 8 bits higher
    hover_thrust: str  # parameter of the hover thrust [-] of the maximum, by which thrusts are scaled
    silence: str  # the parameter of the time [s] after which a silent client counts as lost
    states: Mapping[str, int]  # messages to request, and their interval in states
    settings: Mapping[str, RequiredBits]  # parameters that must have certain bits
    offboard_takeoff: bool  # whether set-points lift it off the ground; else a take-off order does
    refused: int  # MAV_RESULT of a refused order
    refusal: str  # beginning of its sentences on a refused arming

    def custom_mode(self, mode: Mode) -> int:
        """Return the number of a mode in heartbeats."""
        main, sub = self.modes[mode]
        return main << self.mode_shift | sub << self.mode_shift + 8

    def mode_of(self, number: int) -> Mode | None:
        """Return the mode of a number in heartbeats; None for an unknown number."""
        return next((mode for mode in self.modes if self.custom_mode(mode) == number), None)


PX4 = Dialect(
    autopilot=12,
    firmware=0x010F00FF,  # 1.15.0
    modes={Mode.TAKEOFF: (4, 2), Mode.HOLD: (4, 3), Mode.LAND: (4, 6), Mode.OFFBOARD: (6, 0)},
    mode_shift=16,
    hover_thrust="MPC_THR_HOVER",
    silence="COM_OF_LOSS_T",
    states={"ODOMETRY": 1},
    settings={},
    offboard_takeoff=True,
    refused=2,  # denied
    refusal="Arming denied",
)
ARDUPILOT = Dialect(
    autopilot=3,
    firmware=0x040600FF,  # Copter 4.6.0
    modes={Mode.HOLD: (17, 0), Mode.LAND: (9, 0), Mode.OFFBOARD: (4, 0)},  # BRAKE, LAND, GUIDED
    mode_shift=0,
    hover_thrust="MOT_THST_HOVER",
    silence="GUID_TIMEOUT",
    states={"LOCAL_POSITION_NED": 1, "ATTITUDE_QUATERNION": 1, "EXTENDED_SYS_STATE": 20},
    settings={
        "GUID_OPTIONS": RequiredBits(8, 8, "thrusts are taken for climb rates"),
        "ATC_ANGLE_BOOST": RequiredBits(
            1, 0, "thrust is changed with the tilt, and none is left upside down"
        ),
    },
    offboard_takeoff=False,
    refused=4,  # failed
    refusal="Arm",
)
DIALECTS = {"px4": PX4, "ardupilot": ARDUPILOT}


def dialect_of(autopilot: int) -> Dialect:
    """Return the dialect of an autopilot by its number in heartbeats; PX4's for an unknown number."""
    return next((dialect for dialect in DIALECTS.values() if dialect.autopilot == autopilot), PX4)
