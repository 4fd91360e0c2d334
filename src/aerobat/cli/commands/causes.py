"""`aerobat causes`: what each of the paper's four causes of error costs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count
from typing import Annotated

from cyclopts import Parameter, validators

from aerobat.cli.options import FlightsOptions, ProblemOptions, planning
from aerobat.cli.progress import Progress, showing
from aerobat.cli.tasks import read_task
from aerobat.cli.terminal import print_json
from aerobat.environment import load_dispersion
from aerobat.planning import Miqp
from aerobat.reporting.plain_data import to_json
from aerobat.reporting.tables import print_table, table
from aerobat.studies.error_causes import error_causes, four_causes

ORDER = 4  # snap as the input, with which jerk is compared


@dataclass(frozen=True, kw_only=True)
class CausesOptions(ProblemOptions, FlightsOptions):
    """Options of a measurement of causes of error."""

    reserve: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=0, lt=0.5))] = 0.1
    """The fraction of every limit's range that plans which know the rotors keep at either of its ends."""


def causes(problem: str, options: CausesOptions = CausesOptions()) -> None:
    """Measure what each of four causes of error costs, alone and all together, over many flights.

    The paper's authors name the causes: the plan does not know the rotors' limits; a hand-off goes between
    camera systems that are 5 cm and 2° apart; jerk is the input in place of snap; and the loops are 1.5 times
    as slow as the vehicle's own. Each trial flies the same flights: same vehicles, starts, noise and air.
    Planned by miqp; writes nothing.

    Parameters
    ----------
    problem
        A name that `aerobat show` lists, or a problem's TOML file, with a gate.
    """
    task, vehicle = read_task(problem, options)
    conditions = load_dispersion(options.conditions)
    switched = four_causes(conditions, vehicle.controller)
    with showing(Progress("trials", len(switched) + 2)) as progress:
        finished = count()  # as one begins, those before it are finished
        measured = error_causes(
            task,
            vehicle,
            switched,
            planner=Miqp(order=ORDER, reserve=options.reserve),
            conditions=conditions,
            flights=options.flights,
            seed=options.seed,
            workers=options.workers,
            begin=lambda name: progress.tell(next(finished), name),
        )
    if options.json:
        print_json(to_json(measured))
    else:
        print_table(table(measured))
