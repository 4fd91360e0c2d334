"""A fault that a log shows of a flight controller's inner loop, or of rotors."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """A fault that a log shows, whatever it cost."""

    cause: str  # of CAUSES
    evidence: str  # a sentence with its numbers

    def __str__(self) -> str:
        """One line for people."""
        return self.evidence
