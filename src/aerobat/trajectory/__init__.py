"""Position over time: piecewise polynomials, their extrema, and minimum-effort polynomials."""

from aerobat.trajectory.files import load_trajectory, save_trajectory
from aerobat.trajectory.minimum_effort import ContinuityRule, minimum_effort
from aerobat.trajectory.piecewise import Carrier, Extremum, HasTrajectory, Trajectory, as_trajectory

__all__ = [
    "Carrier",
    "ContinuityRule",
    "Extremum",
    "HasTrajectory",
    "Trajectory",
    "as_trajectory",
    "load_trajectory",
    "minimum_effort",
    "save_trajectory",
]
