"""`aerobat plan`: as `aerobat fly`, without the flight."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.entry import ExitCode
from aerobat.cli.options import PlanningOptions
from aerobat.cli.runs.folder import finish
from aerobat.cli.tasks import planned


def plan(
    problem: str, options: Annotated[PlanningOptions, Parameter(name="*")] = PlanningOptions()
) -> ExitCode:
    """Plan a maneuver and stop there.

    As `aerobat fly`, without the flight: writes PROBLEM.plan, plan.csv, report.png, report.json and run.toml.
    Exits with 0 only if the plan is certified and flies.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    found, record = planned(problem, options, "plan")
    return finish(found, record, options)
