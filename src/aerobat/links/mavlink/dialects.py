"""The dialects of autopilots' MAVLink: modes, thrust, states, taking off, refusals. One value for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from aerobat.links.goals import Mode

CUSTOM_MODE_ENABLED = 1  # MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED


class RequiredBits(NamedTuple):
    """Bits of a parameter without which no set-point is flown as it is meant."""

    mask: int
    bits: int
    meaning: str  # of other bits


@dataclass(frozen=True)
class Dialect:
    """The words in which one autopilot speaks MAVLink."""

    autopilot: int  # its number in heartbeats, MAV_AUTOPILOT
    firmware: int  # the version for which clients take the simulated vehicle
    modes: Mapping[Mode, tuple[int, int]]  # main mode and sub-mode, as orders have them
    mode_shift: int  # by which the main mode's bits stand in a heartbeat's number, the sub-mode's 8 higher
    hover_thrust: str  # the parameter by whose value thrusts are scaled: the part at which it hovers
    silence: str  # the parameter of the time [s] after which a silent client is taken for lost
    states: Mapping[str, int]  # messages to be asked for, and every how many states each is needed
    settings: Mapping[str, RequiredBits]  # parameters that have to have a value
    leads_off: bool  # whether set-points lead it off the ground; else an order to take off does
    refused: int  # MAV_RESULT of an order that is not obeyed
    refusal: str  # how its sentences on a refused arming begin

    def custom_mode(self, mode: Mode) -> int:
        """The number of a mode in heartbeats."""
        main, sub = self.modes[mode]
        return main << self.mode_shift | sub << self.mode_shift + 8

    def mode_of(self, number: int) -> Mode | None:
        """The mode of a number in heartbeats; None for one that is not among ours."""
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
    leads_off=True,
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
    leads_off=False,
    refused=4,  # failed
    refusal="Arm",
)
DIALECTS = {"px4": PX4, "ardupilot": ARDUPILOT}


def dialect_of(autopilot: int) -> Dialect:
    """The dialect of an autopilot by its number in heartbeats; PX4's for one that is not known."""
    return next((dialect for dialect in DIALECTS.values() if dialect.autopilot == autopilot), PX4)
