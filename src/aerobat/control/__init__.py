"""Settings of the tracking controller, its kernel parameters, and custom control laws."""

from aerobat.control.law import CONTROL_LAWS, ControlLaw, Seen, as_controller, controller, named_controller
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
