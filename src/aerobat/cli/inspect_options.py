"""The options of `aerobat inspect`, each with its help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import VehicleOptions, output


@dataclass(frozen=True, kw_only=True)
class InspectOptions(VehicleOptions):
    """Options of an inspection: what a log is held against, and where its picture goes."""

    plan: Annotated[Path | None, Parameter(group=output)] = None
    """The flight's plan, a .plan file or its folder. Default: the one beside the log."""

    figure: Annotated[Path | None, Parameter(group=output)] = None
    """The picture's file. Default: inspect.png in the log's folder."""
