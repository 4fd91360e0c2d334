"""`aerobat mavlink-vehicle`: the simulator as a vehicle that MAVLink clients fly."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.link_options import MavlinkVehicleOptions
from aerobat.cli.runs.saved_plans import named_vehicle
from aerobat.cli.terminal import say
from aerobat.environment import Environment

_RATE = 250.0  # [1/s] at which messages are taken and sent


def mavlink_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: Annotated[MavlinkVehicleOptions, Parameter(name="*")] = MavlinkVehicleOptions(),
) -> None:
    """Simulate a vehicle that MAVLink clients take for a PX4: `aerobat mavlink`, MAVSDK, ground stations.

    It stands on the ground until it is armed, and runs until it is interrupted. A client that falls silent
    while it is obeyed leaves it hovering.

    Parameters
    ----------
    vehicle
        A name that `aerobat vehicles` lists, or a vehicle's TOML file.
    """
    found = named_vehicle(vehicle)
    from aerobat.links.autopilot.vehicle import SimulatedVehicle
    from aerobat.links.clock import WallClock
    from aerobat.links.mavlink.connection import LossyConnection, connect
    from aerobat.links.mavlink.front_end import SYSTEM, FrontEnd

    connection = connect(options.listen, listen=True, system=SYSTEM)
    simulated = SimulatedVehicle(found, Environment())
    clock = WallClock(options.speed)
    if options.loss or options.delay:
        connection = LossyConnection(
            connection, clock, loss=options.loss, delay=options.delay, seed=options.seed
        )
    front_end = FrontEnd(simulated, connection, say)
    say(f"{found.name} listens on {options.listen}")
    end = float("inf") if options.seconds is None else options.seconds
    try:
        while clock.now() < end:
            front_end.tick(clock.now())
            clock.sleep_until(clock.now() + 1.0 / _RATE)
    finally:
        connection.close()
