"""`aerobat vehicles`: what there is to fly."""

from __future__ import annotations

from aerobat.reporting.tables import show, vehicles_table
from aerobat.vehicle import load_vehicle, vehicle_names


def vehicles() -> None:
    """List the built-in vehicles."""
    show(vehicles_table(load_vehicle(name) for name in vehicle_names()))
