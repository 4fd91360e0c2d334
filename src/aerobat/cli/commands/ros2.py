"""`aerobat ros2`: maneuvers flown on demand, as a node of ROS 2."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.link_options import Ros2Options


def ros2(*problems: str, options: Annotated[Ros2Options, Parameter(name="*")] = Ros2Options()) -> None:
    """Fly maneuvers on demand as a node of ROS 2.

    Offers services of std_srvs/Trigger: /aerobat/takeoff, the paper's line, flip, flip_pitch, flip_trans and
    window (a half-flip), hold, and land. A maneuver is planned from where the odometry sees the vehicle
    hover, answered once it begins, and streamed as goals; what came of it is told on /aerobat/report. Runs
    until it is interrupted; a vehicle that gets no more goals is to hover by itself. Read docs/ros.md before
    anything real is flown.

    Parameters
    ----------
    problems
        Names that `aerobat problems` lists, or problems' TOML files, to be services too, of their names.
    """
    from aerobat.cli.ros import fly_on_demand
    from aerobat.links.ros.rclpy_middleware import RclpyMiddleware

    fly_on_demand(lambda: RclpyMiddleware("aerobat", sim_time=options.sim_time), problems, options)
