"""Outcomes of a flight: what it came to, as something that can be counted, with a sentence each."""

from __future__ import annotations

from enum import Enum

DIVERGENCE_RADIUS = 5.0  # [m] of position error: no controller is expected back from there


class Outcome(Enum):
    """The end of a flight; the value is a sentence to be filled with its numbers."""

    COMPLETE = "flown to the end"
    THROUGH_GATES = "through {gate} at {speed:.1f} m/s, {miss_mm:.1f} mm off its centre"
    MISSED_GATE = "missed {gate}, {miss:.2f} m off its centre at {time:.2f} s"
    HIT_FRAME = "hit the frame of {gate}, {excess_cm:.1f} cm too wide at {time:.2f} s"
    HIT_GROUND = "hit the ground at {time:.2f} s"
    DIVERGED = "diverged at {time:.2f} s: position error above {radius:g} m"
    STATE_NOT_FINITE = "diverged at {time:.2f} s: its state is no longer a number"

    @property
    def is_success(self) -> bool:
        """True where nothing went wrong."""
        return self in (Outcome.COMPLETE, Outcome.THROUGH_GATES)

    def sentence(self, **numbers: object) -> str:
        """The sentence with its numbers."""
        return self.value.format(**{"radius": DIVERGENCE_RADIUS, **numbers})
