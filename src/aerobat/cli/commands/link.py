"""`aerobat link`: plans flown on an autopilot, maneuvers on demand, and simulated vehicles for both."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.failures import ExitCode
from aerobat.cli.link_options import (
    MavlinkOptions,
    MavlinkVehicleOptions,
    RosOptions,
    RosVehicleOptions,
)


def mavlink(
    plan: Path, options: Annotated[MavlinkOptions, Parameter(name="*")] = MavlinkOptions()
) -> ExitCode:
    """Fly a plan on an autopilot over MAVLink: PX4, or `aerobat link mavlink-vehicle`.

    Arms, takes off, goes to the plan's start, streams attitude, rates and thrust along the plan, holds where
    it ends, and lands. Whatever goes wrong on the way, the vehicle is told to hover, then to land. Read
    docs/vehicles.md before anything real is armed. Exits with 0 only if the plan was flown to its end,
    through its gates, and the vehicle has landed.

    Parameters
    ----------
    plan
        A .plan file, or a run's folder.
    """
    from aerobat.cli.mavlink import fly

    return fly(plan, options)


def mavlink_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: Annotated[MavlinkVehicleOptions, Parameter(name="*")] = MavlinkVehicleOptions(),
) -> None:
    """Simulate a vehicle that MAVLink clients take for a PX4: `aerobat link mavlink`, ground stations.

    It stands on the ground until it is armed, and runs until it is interrupted. A client that falls silent
    while it is obeyed leaves it hovering.

    Parameters
    ----------
    vehicle
        A name that `aerobat show` lists, or a vehicle's TOML file.
    """
    from aerobat.cli.mavlink import simulate

    simulate(vehicle, options)


def ros(*problems: str, options: Annotated[RosOptions, Parameter(name="*")] = RosOptions()) -> None:
    """Fly maneuvers on demand as a node of ROS 1 or ROS 2.

    Offers services of std_srvs/Trigger: /aerobat/takeoff, the paper's line, flip, flip_pitch, flip_trans and
    window (a half-flip), hold, and land. A maneuver is planned from where the odometry sees the vehicle
    hover, answered once it begins, and streamed as goals; what came of it is told on /aerobat/report. Runs
    until it is interrupted; a vehicle that gets no more goals is to hover by itself. Read docs/ros.md before
    anything real is flown.

    Parameters
    ----------
    problems
        Names that `aerobat show` lists, or problems' TOML files, to be services too, of their names.
    """
    from aerobat.cli.ros import fly_on_demand

    fly_on_demand(problems, options)


def ros_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: Annotated[RosVehicleOptions, Parameter(name="*")] = RosVehicleOptions(),
) -> None:
    """Simulate a vehicle that is a node of ROS: goals in, odometry out, for `aerobat link ros`.

    It stands on the ground, is armed by the first goal above it, and hovers where goals stop. Runs until it
    is interrupted.

    Parameters
    ----------
    vehicle
        A name that `aerobat show` lists, or a vehicle's TOML file.
    """
    from aerobat.cli.ros import simulate

    simulate(vehicle, options)
