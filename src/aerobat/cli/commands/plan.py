"""`aerobat plan`: as `aerobat fly`, without the flight."""

from __future__ import annotations

from aerobat.cli.failures import ExitCode
from aerobat.cli.options import ConditionsOptions, ExplainingOptions, TableOptions
from aerobat.cli.runs.folder import finish, require_place
from aerobat.cli.runs.record import FlightSettings
from aerobat.cli.tasks import flight_settings, plan_of, read_run
from aerobat.errors import SpecError


def plan(
    problem: str,
    options: TableOptions = TableOptions(),
    passing: ConditionsOptions = ConditionsOptions(),
    explaining: ExplainingOptions = ExplainingOptions(),
) -> ExitCode:
    """Plan a maneuver and stop there.

    As `aerobat fly`, without the flight: writes PROBLEM.plan, plan.csv, report.png, report.json and run.toml.
    Exits with 0 only if the plan is certified and flies.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, a problem's TOML file, or a .plan file, a CSV file or a run's
        folder, whose plan is judged as it is.
    """
    settings = FlightSettings()
    if passing.probability is not None:
        settings = flight_settings(passing)
    elif passing != ConditionsOptions():
        raise SpecError(
            "--conditions, --seed, --controller, --autopilot and --workers are for --pass, or for "
            "`aerobat fly`; leave them out"
        )
    record, saved = read_run(problem, options, "plan", settings)
    require_place(record, options)
    found = plan_of(record, saved, explaining.explain, passing.workers)
    return finish(found, record, options, explain=explaining.explain)
