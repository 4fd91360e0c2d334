"""Differential flatness: what a vehicle must do to fly a trajectory, inverted or not."""

from aerobat.flatness.setpoints import Reference, reference, reference_of
from aerobat.flatness.transport import Span

__all__ = ["Reference", "Span", "reference", "reference_of"]
