"""`aerobat causes`: what each of the paper's four causes of error costs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from aerobat.cli.options import Plugins, TaskOptions, Workers, flying, how_many, output, planning
from aerobat.cli.progress import CausesProgress, showing
from aerobat.cli.tasks import read_task
from aerobat.cli.terminal import print_json
from aerobat.environment import load_dispersion
from aerobat.planning import Miqp
from aerobat.reporting.error_causes import error_causes_report, error_causes_table
from aerobat.reporting.report_json import to_json
from aerobat.reporting.tables import print_table
from aerobat.studies.error_causes import error_causes, four_causes

ORDER = 4  # snap as the input, with which jerk is compared


@dataclass(frozen=True, kw_only=True)
class CausesOptions:
    """Options of a measurement of causes of error."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: agile-quad."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    reserve: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=0, lt=0.5))] = 0.1
    """Of every limit's range, kept at either end by plans that know the rotors."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()

    conditions: Annotated[str, Parameter(group=flying)] = "lab"
    """The variation from flight to flight without the causes: lab, field, or a TOML file."""

    flights: Annotated[int, how_many(1, 10**6)] = 1000
    """The number of flights of each trial."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of all flights: the same seed, the same flights."""

    workers: Annotated[str | None, Workers(group=flying)] = None

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the measurements as JSON on standard output, and nothing else."""


def causes(problem: str, options: Annotated[CausesOptions, Parameter(name="*")] = CausesOptions()) -> None:
    """Measure what each of four causes of error costs, alone and all together, over many flights.

    The paper's authors name the causes: the plan does not know the rotors' limits; a hand-off goes between
    camera systems that are 5 cm and 2° apart; jerk is the input in place of snap; and the loops are 1.5 times
    as slow as the vehicle's own. Each trial flies the same flights: same vehicles, starts, noise and air.
    Planned by miqp; writes nothing.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file, with a gate.
    """
    chosen = TaskOptions(vehicle=options.vehicle, angle=options.angle, plugins=options.plugins)
    task, vehicle = read_task(problem, chosen)
    conditions = load_dispersion(options.conditions)
    switched = four_causes(conditions, vehicle.controller)
    with showing(CausesProgress(len(switched) + 2)) as progress:
        measured = error_causes(
            task,
            vehicle,
            switched,
            planner=Miqp(order=ORDER, reserve=options.reserve),
            conditions=conditions,
            flights=options.flights,
            seed=options.seed,
            workers=options.workers,
            begin=progress.begin,
        )
    if options.json:
        print_json(to_json(error_causes_report(measured)))
    else:
        print_table(error_causes_table(measured))
