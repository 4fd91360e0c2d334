"""Differential flatness: what a vehicle must do to fly a trajectory, inverted or not."""

from aerobat.flatness.setpoints import (
    Reference,
    axial_drag,
    end_thrust,
    lateral_drag,
    reference,
    reference_of,
)
from aerobat.flatness.transport import Span

__all__ = ["Reference", "Span", "axial_drag", "end_thrust", "lateral_drag", "reference", "reference_of"]
