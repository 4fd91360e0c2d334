"""`aerobat mavlink`: a plan flown on an autopilot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

from aerobat.arrays import Array
from aerobat.cli.exit_code import ExitCode
from aerobat.cli.interrupts import REPORTED
from aerobat.cli.link_options import MavlinkOptions
from aerobat.cli.terminal import print_json, say
from aerobat.errors import SpecError
from aerobat.interchange import read_plan
from aerobat.planning import Plan
from aerobat.reporting.plain_data import plain, to_json
from aerobat.simulation.autopilot import recoveries

if TYPE_CHECKING:
    from aerobat.links.report import LinkReport

CLEARANCE = 3.0  # [m] of a plan's lowest point over where the vehicle stands
RECOVERED = 1.0  # [m] of the lowest point of a recovery from any instant of it, at the least


def mavlink(
    plan: Path, options: Annotated[MavlinkOptions, Parameter(name="*")] = MavlinkOptions()
) -> ExitCode:
    """Fly a plan on an autopilot over MAVLink: PX4, or `aerobat mavlink-vehicle`.

    Arms, takes off, goes to the plan's start, streams attitude, rates and thrust along the plan, holds where
    it ends, and lands. Whatever goes wrong on the way, the vehicle is told to hover, then to land. Read
    docs/vehicles.md before anything real is armed. Exits with 0 only if the plan was flown to its end,
    through its gates, and the vehicle has landed.

    Parameters
    ----------
    plan
        A .plan file, or a run's folder.
    """
    found = read_plan(plan)
    if not isinstance(found, Plan):
        raise SpecError(f"{plan} holds a path alone; give a .plan file, which is certified for its vehicle")
    from aerobat.links.clock import WallClock
    from aerobat.links.mavlink.autopilot_link import COMPONENT, SYSTEM
    from aerobat.links.mavlink.client import Client, ClientSettings, run
    from aerobat.links.mavlink.connection import connect
    from aerobat.links.mission import MissionSettings, Phase, require_flyable

    offset = _origin(found) if options.origin is None else np.array(options.origin)
    require_flyable(found, offset, options.vehicle)
    connection = connect(options.connect, listen=False, system=SYSTEM, component=COMPONENT, baud=options.baud)
    try:
        client = Client(
            found,
            connection,
            offset=offset,
            mission=MissionSettings(
                max_error=options.max_error,
                max_silence=options.max_silence,
                max_lateness=options.max_lateness,
            ),
            settings=ClientSettings(
                options.rate, wait=options.wait, hover_thrust=options.hover_thrust, system=options.system
            ),
            say=say,
            announcement=str(recoveries(found, ground=-offset[2])),
        )
        run(client, WallClock(options.speed))
    except KeyboardInterrupt:
        if client.mission.phase is not Phase.READY:
            _print(client.report(), options.json)
            raise KeyboardInterrupt(REPORTED) from None
        raise
    finally:
        connection.close()
    report = client.report()
    _print(report, options.json)
    return ExitCode.WELL if report.is_success else ExitCode.NOT_WELL


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
