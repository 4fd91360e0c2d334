"""The paper's reference [1] approach: the rigid body itself, collocated, at its rotors' limits."""

from aerobat.planning.time_optimal.time_optimal import TimeOptimal

__all__ = ["TimeOptimal"]
