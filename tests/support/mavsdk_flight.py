"""MAVSDK flies whatever listens at an address: up, to a place, offboard to another, down. Run by a test.

In a process of its own: MAVSDK ends the process of who lets go of its parts in an order that it dislikes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.offboard import Offboard, PositionNedYaw
from mavsdk.plugins.telemetry import Telemetry

PATIENCE = 60.0  # [s]


def wait(reached: Callable[[], bool]) -> None:
    """Until something holds."""
    end = time.monotonic() + PATIENCE
    while not reached():
        assert time.monotonic() < end
        time.sleep(0.02)


def main(address: str) -> None:
    """Fly, and print what was reached."""
    client = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    assert client.add_any_connection(address) == 0
    autopilot = client.first_autopilot(PATIENCE)
    action, telemetry, offboard = Action(autopilot), Telemetry(autopilot), Offboard(autopilot)

    def near(north: float, east: float, down: float) -> bool:
        ned = telemetry.position_velocity_ned().position
        return float(np.linalg.norm([ned.north_m - north, ned.east_m - east, ned.down_m - down])) < 0.1

    wait(telemetry.health_all_ok)
    action.set_takeoff_altitude(2.0)
    action.arm()
    action.takeoff()
    wait(lambda: near(0.0, 0.0, -2.0))
    assert telemetry.in_air()
    print("took off")
    home = telemetry.home()  # on the ground: the vehicle may still be a few centimetres below its height
    action.goto_location(home.latitude_deg + 2e-5, home.longitude_deg, home.absolute_altitude_m + 3.0, 0.0)
    wait(lambda: near(2.22, 0.0, -3.0))
    print("went there")
    offboard.set_position_ned(PositionNedYaw(0.0, 1.0, -2.0, 0.0))
    offboard.start()
    wait(lambda: near(0.0, 1.0, -2.0))
    offboard.stop()
    print("flew offboard")
    action.land()
    wait(lambda: not telemetry.armed() and not telemetry.in_air())
    assert abs(telemetry.position().relative_altitude_m) < 0.01
    print("landed")


if __name__ == "__main__":
    main(sys.argv[1])
