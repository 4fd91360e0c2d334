"""`aerobat ros2-vehicle`: the simulator as a node of ROS 2."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.link_options import RosVehicleOptions


def ros2_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: Annotated[RosVehicleOptions, Parameter(name="*")] = RosVehicleOptions(),
) -> None:
    """Simulate a vehicle that is a node of ROS 2: goals in, odometry out, for `aerobat ros2`.

    It stands on the ground, is armed by the first goal above it, and hovers where goals stop. Runs until it
    is interrupted.

    Parameters
    ----------
    vehicle
        A name that `aerobat vehicles` lists, or a vehicle's TOML file.
    """
    from aerobat.cli.ros import simulate
    from aerobat.links.ros.rclpy_middleware import RclpyMiddleware

    simulate(lambda clock: RclpyMiddleware("aerobat_vehicle", clock), vehicle, options)
