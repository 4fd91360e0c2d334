"""The tracking controller's settings, the numbers that follow from them, and control laws of one's own."""

from aerobat.control.law import (
    CONTROL_LAWS,
    ControlLaw,
    Seen,
    as_controller,
    controller,
    named_controller,
)
from aerobat.vehicle.controller import Controller

__all__ = [
    "CONTROL_LAWS",
    "ControlLaw",
    "Controller",
    "Seen",
    "as_controller",
    "controller",
    "named_controller",
]
