"""The tracking controller's settings, and the numbers that follow from them for a vehicle."""

from aerobat.vehicle.controller import CONTROLLERS, Controller, named_controller

__all__ = ["CONTROLLERS", "Controller", "named_controller"]
