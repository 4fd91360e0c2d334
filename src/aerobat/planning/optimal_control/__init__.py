"""The paper's reference [1] approach: the rigid body itself, collocated, at its rotors' limits."""

from aerobat.planning.optimal_control.time_optimal import TimeOptimal

__all__ = ["TimeOptimal"]
