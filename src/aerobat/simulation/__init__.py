"""What the controller flies: the plant, and the errors of what it sees."""

from aerobat.simulation.noise import StateNoise

__all__ = ["StateNoise"]
