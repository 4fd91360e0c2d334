from .autopilot.vehicle import SimulatedVehicle
from .clock import Clock, WallClock
from .commander import Commander, Doing
from .goals import AttitudeGoal, Mode, Observed, PathGoal, PathPiece, PositionGoal
from .mission import Mission, MissionSettings, Phase, require_flyable
from .path_follower import PathFollower
from .report import LinkReport, link_report
from .stream import SetpointStream

__all__ = [
    "AttitudeGoal",
    "Clock",
    "Commander",
    "Doing",
    "LinkReport",
    "Mission",
    "MissionSettings",
    "Mode",
    "Observed",
    "PathFollower",
    "PathGoal",
    "PathPiece",
    "Phase",
    "PositionGoal",
    "SetpointStream",
    "SimulatedVehicle",
    "WallClock",
    "link_report",
    "require_flyable",
]
