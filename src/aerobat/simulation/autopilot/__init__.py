"""What an autopilot does by itself: it follows points and attitudes, brakes, and recovers to a hover."""

from aerobat.simulation.autopilot.recovery import Recoveries, UndeterminedAttitude, recoveries

__all__ = ["Recoveries", "UndeterminedAttitude", "recoveries"]
