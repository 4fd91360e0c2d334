"""The options of `aerobat feasibility`, each with its help."""

# no postponed annotations here: the class that these inherit from is made from its annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from aerobat.cli.options import PlannerOptions, Workers, output, planning
from aerobat.cli.runs.record import DEFAULT_TOLERANCE
from aerobat.errors import SpecError


@dataclass(frozen=True, kw_only=True)
class FeasibilityOptions(PlannerOptions):
    """Options of a map of what is feasible, and of a search for the least."""

    over: Annotated[tuple[str, ...], Parameter(group=planning, negative="", show_default=False)] = ()
    """A field and its values, FIRST:LAST:STEP or values between commas, as angle=0:90:10; once or twice.
    Fields have the names of files, as limits.velocity, gate.width, vehicle.mass, or speed where no other
    field ends so; angle is the tilt of a half-flip's gate."""

    least: Annotated[
        tuple[Literal["thrust-to-weight", "ceiling", "gate", "gate-height"], ...],
        Parameter(group=planning, negative="", show_default=False),
    ] = ()
    """The quantity whose least value is sought, once or more often. Default: all that the problem has, but
    gate-height, which makes slits of openings."""

    tolerance: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=1e-4, lte=0.5))] = (
        DEFAULT_TOLERANCE
    )
    """Between the least and the refusal beside it, as a part of the least."""

    workers: Annotated[str | None, Workers(group=planning)] = None

    table: Annotated[Literal["csv", "parquet"], Parameter(group=output)] = "csv"
    """The form of a map's table, map.csv or map.parquet; the latter needs aerobat[parquet]."""

    def require_one(self) -> None:
        """Raise SpecError for options of a map and of a search for the least together."""
        of_least = {"--least": bool(self.least), "--tolerance": self.tolerance != DEFAULT_TOLERANCE}
        for flag, is_given in of_least.items():
            if self.over and is_given:
                raise SpecError(f"{flag} finds the least, --over maps; leave one of them out")
        if self.table != "csv" and not self.over:
            raise SpecError("--table is for a map; add --over, or leave it out")
