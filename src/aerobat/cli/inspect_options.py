"""The options of `aerobat inspect`, each with its help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import Plugins, output


@dataclass(frozen=True, kw_only=True)
class InspectOptions:
    """Options of an inspection: what a log is held against, and where its picture goes."""

    plan: Annotated[Path | None, Parameter(group=output)] = None
    """The flight's plan, a .plan file or its folder. Default: the one beside the log."""

    vehicle: Annotated[str | None, Parameter(group=output)] = None
    """The vehicle: a name that `aerobat show` lists, or a TOML file. Default: the plan's."""

    figure: Annotated[Path | None, Parameter(group=output)] = None
    """The picture's file. Default: inspect.png in the log's folder."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=output)] = ()

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the inspection as JSON on standard output, and nothing else."""
