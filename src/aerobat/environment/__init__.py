"""Where a vehicle flies: gravity, wind and ground, owned by the problem and by nobody else."""

from aerobat.environment.environment import Environment

__all__ = ["Environment"]
