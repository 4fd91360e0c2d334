"""The tracking controller's settings, and the numbers that follow from them for a vehicle."""

from aerobat.control.controller import Controller

__all__ = ["Controller"]
