"""`aerobat link mavlink` and `mavlink-vehicle`: plans flown on an autopilot, and a vehicle for clients."""

from __future__ import annotations

from contextlib import closing
from math import inf
from pathlib import Path

import numpy as np

from aerobat.arrays import Array
from aerobat.cli.failures import ExitCode
from aerobat.cli.interrupts import REPORTED
from aerobat.cli.link_options import MavlinkOptions, MavlinkVehicleOptions
from aerobat.cli.runs.saved_plans import named_environment, named_vehicle, whole_plan
from aerobat.cli.terminal import print_json, say
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.clock import WallClock, ticks
from aerobat.links.mavlink.autopilot_link import COMPONENT, SYSTEM
from aerobat.links.mavlink.client import Client, ClientSettings, run
from aerobat.links.mavlink.connection import LossyConnection, connect
from aerobat.links.mavlink.dialects import DIALECTS
from aerobat.links.mavlink.front_end import SYSTEM as VEHICLE_SYSTEM
from aerobat.links.mavlink.front_end import FrontEnd
from aerobat.links.mission import Phase, require_flyable
from aerobat.links.report import LinkReport
from aerobat.planning import Plan
from aerobat.reporting.plain_data import plain, to_json
from aerobat.simulation.autopilot import recoveries

_RATE = 250.0  # [1/s] at which a simulated vehicle takes and sends messages
CLEARANCE = 3.0  # [m] of a plan's lowest point over where the vehicle stands
RECOVERED = 1.0  # [m] of the lowest point of a recovery from any instant of it, at the least


def mavlink(plan: Path, options: MavlinkOptions = MavlinkOptions()) -> ExitCode:
    """Fly a plan on an autopilot over MAVLink: PX4, ArduPilot, or `aerobat link mavlink-vehicle`.

    Arms, takes off, goes to the plan's start, streams attitude, rates and thrust along the plan, holds where
    it ends, and lands. Whatever goes wrong on the way, the vehicle is told to hover, then to land. Read
    docs/vehicles.md before anything real is armed. Exits with 0 only if the plan was flown to its end,
    through its gates, and the vehicle has landed.

    Parameters
    ----------
    plan
        A .plan file, or a run's folder.
    """
    found = whole_plan(plan, "give a .plan file, which is certified for its vehicle")
    offset = _origin(found) if options.origin is None else np.array(options.origin)
    require_flyable(found, offset, options.vehicle)
    connection = connect(options.connect, listen=False, system=SYSTEM, component=COMPONENT, baud=options.baud)
    with closing(connection):
        client = Client(
            found,
            connection,
            offset=offset,
            mission=options.mission,
            settings=ClientSettings(
                options.rate, wait=options.wait, hover_thrust=options.hover_thrust, system=options.system
            ),
            say=say,
            announcement=str(recoveries(found, ground=-offset[2])),
        )
        try:
            run(client, WallClock(options.speed))
        except KeyboardInterrupt:
            if client.mission.phase is not Phase.READY:
                _print(client.report(), options.json)
                raise KeyboardInterrupt(REPORTED) from None
            raise
    report = client.report()
    _print(report, options.json)
    return ExitCode.WELL if report.is_success else ExitCode.NOT_WELL


def mavlink_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: MavlinkVehicleOptions = MavlinkVehicleOptions(),
) -> None:
    """Simulate a vehicle that MAVLink clients take for PX4 or ArduPilot: `aerobat link mavlink` and others.

    It stands on the ground until it is armed, and runs until it is interrupted. A client that falls silent
    while it is obeyed leaves it hovering.

    Parameters
    ----------
    vehicle
        A name that `aerobat show` lists, or a vehicle's TOML file.
    """
    found, environment = named_vehicle(vehicle), named_environment(options.environment)
    connection = connect(options.listen, listen=True, system=VEHICLE_SYSTEM)
    simulated = SimulatedVehicle(found, environment)
    clock = WallClock(options.speed)
    if options.loss or options.delay:
        connection = LossyConnection(
            connection, clock, loss=options.loss, delay=options.delay, seed=options.seed
        )
    front_end = FrontEnd(simulated, connection, say, DIALECTS[options.dialect])
    say(f"{found.name} listens on {options.listen}")
    with closing(connection):
        for now in ticks(clock, _RATE, options.seconds or inf):
            front_end.tick(now)


def _print(report: LinkReport, in_json: bool) -> None:
    if in_json:
        judged = {"success": report.is_success, "failures": report.failures}
        print_json(to_json({**plain(report), **judged}))
    else:
        print(report)


def _origin(plan: Plan) -> Array:
    """High enough for the plan, and for the recoveries from all of it."""
    if plan.vehicle is None:
        return np.zeros(3)  # it is refused for that
    lowest = float(plan.trajectory.component_range(0)[0][2])
    recovered = float(recoveries(plan, ground=lowest - CLEARANCE).lowest.min())
    return np.array([0.0, 0.0, max(CLEARANCE - lowest, RECOVERED - recovered)])
