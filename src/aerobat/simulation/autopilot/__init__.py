"""An autopilot, which follows points and attitudes, brakes, and recovers to a hover by itself."""

from aerobat.simulation.autopilot.recovery import Recoveries, UndeterminedAttitude, recoveries

__all__ = ["Recoveries", "UndeterminedAttitude", "recoveries"]
