"""`aerobat ros1-vehicle`: the simulator as a node of ROS 1."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.link_options import RosVehicleOptions


def ros1_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: Annotated[RosVehicleOptions, Parameter(name="*")] = RosVehicleOptions(),
) -> None:
    """Simulate a vehicle that is a node of ROS 1: goals in, odometry out, for `aerobat ros1`.

    It stands on the ground, is armed by the first goal above it, and hovers where goals stop. Runs until it
    is interrupted.

    Parameters
    ----------
    vehicle
        A name that `aerobat vehicles` lists, or a vehicle's TOML file.
    """
    from aerobat.cli.ros import simulate
    from aerobat.links.ros.rospy_middleware import RospyMiddleware

    simulate(lambda clock: RospyMiddleware("aerobat_vehicle", clock), vehicle, options)
