"""The options of maps of what is feasible, and of searches for the least that a problem needs."""

# no postponed annotations here: the class that these inherit from is made from its annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from aerobat.cli.options import PlannerOptions, Workers, output, planning
from aerobat.cli.runs.record import DEFAULT_TOLERANCE


@dataclass(frozen=True, kw_only=True)
class MapOptions(PlannerOptions):
    """Options of a map."""

    over: Annotated[tuple[str, ...], Parameter(group=planning, negative="", show_default=False)] = ()
    """A field and its values, FIRST:LAST:STEP or values between commas, as angle=0:90:10; once or twice.
    Fields have the names of files, as limits.velocity, gate.width, vehicle.mass, or speed where no other
    field ends so; angle is the tilt of a half-flip's gate."""

    workers: Annotated[str | None, Workers(group=planning)] = None

    table: Annotated[Literal["csv", "parquet"], Parameter(group=output)] = "csv"
    """The form of the table, map.csv or map.parquet; the latter needs aerobat[parquet]."""


@dataclass(frozen=True, kw_only=True)
class NeedOptions(PlannerOptions):
    """Options of a search for the least."""

    of: Annotated[
        tuple[Literal["thrust-to-weight", "ceiling", "gate"], ...],
        Parameter(group=planning, negative="", show_default=False),
    ] = ()
    """The quantity whose least value is sought, once or more often. Default: all that the problem has."""

    tolerance: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=1e-4, lte=0.5))] = (
        DEFAULT_TOLERANCE
    )
    """Between an answer and the refusal beside it, as a part of the answer."""

    workers: Annotated[str | None, Workers(group=planning)] = None
