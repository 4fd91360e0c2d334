"""How position varies over time: piecewise polynomials and their extremes."""

from aerobat.trajectory.piecewise import Extremum, Trajectory

__all__ = ["Extremum", "Trajectory"]
