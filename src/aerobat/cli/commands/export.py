"""`aerobat export`: a plan as another system reads it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from aerobat.cli.failures import ExitCode
from aerobat.cli.options import POSITIVE, RunOptions, output
from aerobat.cli.runs.saved_plans import whole_plan
from aerobat.cli.terminal import print_json, say
from aerobat.interchange.exports import FORMATS
from aerobat.interchange.exports import export as export_plan
from aerobat.reporting.plain_data import to_json


@dataclass(frozen=True, kw_only=True)
class ExportOptions(RunOptions):
    """Options of an export: what a plan is exported to, and where."""

    to: Annotated[
        Literal["csv", "crazyflie", "ros1-bag", "ros2-bag", "mcap", "px4", "blender", "mujoco"],
        Parameter(group=output),
    ]
    """The format."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The file, or of crazyflie, px4 and ros2-bag the folder; an earlier export is replaced. Default:
    in out/, named after the plan's file or folder."""

    rate: Annotated[float | None, Parameter(group=output, validator=POSITIVE)] = None
    """Rows, messages or keys a second. Default: 100, of px4 250; crazyflie has none."""


def export(plan: Path, options: ExportOptions) -> ExitCode:
    """Write a plan as another system reads it, and say what that lost.

    The loss is the largest difference of position, velocity and attitude from the plan over continuous time.
    A plan that is not certified for its vehicle is written all the same, with a warning and exit code 1.

    --to csv         a table of path, attitude, rates and thrusts
    --to crazyflie   pieces for the Crazyflie's memory, and the CSV that Crazyswarm reads (a folder)
    --to ros1-bag    messages for ROS 1, with markers for RViz; ros2-bag (a folder) and mcap for ROS 2
    --to px4         set-points of attitude, rates, thrust and path in PX4's axes (a folder)
    --to blender     an animated scene, glTF; for Blender and other 3D programs
    --to mujoco      a model for MuJoCo, with a keyframe a row

    Parameters
    ----------
    plan
        A .plan file, or a folder that `aerobat plan` or `aerobat fly` wrote.
    """
    found = whole_plan(plan, "give it to `aerobat fly`, and export what that writes")
    form = FORMATS[options.to]
    source = plan.resolve()
    name = source.name if os.path.isdir(source) else source.stem  # names of folders may hold numbers
    default = Path("out") / f"{name}{form.suffix or '.' + options.to}"
    made = export_plan(found, options.out or default, options.to, options.rate)
    if options.json:
        facts = {"format": made.format, "files": list(map(str, made.files)), "loss": made.loss.record()}
        print_json(to_json(facts))
    else:
        for file in made.files:
            print(f"written to {file}")
        print(made.loss)
    if found.vehicle is None or found.certified:
        return ExitCode.WELL
    say(f"warning: the plan is not certified for {found.vehicle.name}: {found.certificate}")
    return ExitCode.NOT_WELL
