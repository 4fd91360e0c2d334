"""An autopilot, which follows points and attitudes, brakes, and recovers to a hover by itself."""

from aerobat.simulation.autopilot.recovery import Recoveries as Recoveries
from aerobat.simulation.autopilot.recovery import UndeterminedAttitude as UndeterminedAttitude
from aerobat.simulation.autopilot.recovery import recoveries as recoveries
