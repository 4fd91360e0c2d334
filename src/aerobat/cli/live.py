"""`aerobat view --live`: the page that plans and flies anew, until Ctrl-C."""

# no postponed annotations here: options are made from them

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter, validators

from aerobat.cli.options import POSITIVE, PlanningOptions, VehicleOptions, output
from aerobat.cli.runs.record import USUAL_CONDITIONS
from aerobat.cli.tasks import planned
from aerobat.cli.terminal import open_in_browser, print_json
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.reporting.plain_data import to_json
from aerobat.viewer.live.view_live import view_live

PROBLEM = "flip-roll"  # where nobody names one
serving = Group("Live", sort_key=4)


@dataclass(frozen=True, kw_only=True)
class ViewOptions(VehicleOptions):
    """Options of a replay: what it shows, and where it goes."""

    html: Annotated[Path | None, Parameter(group=output)] = None
    """The file to write; an earlier replay is replaced. Default: replay.html in the folder of a run, or
    beside another file, named after it."""

    video: Annotated[Path | None, Parameter(group=output)] = None
    """A video instead, to FILE.mp4 or FILE.gif, 30 frames a second; beside the page if --html is given too.
    Needs aerobat[viewer]."""

    speed: Annotated[float, Parameter(group=output, validator=POSITIVE)] = 0.5
    """The pace of time in the video, 1 as it was flown."""

    open: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Open the page in the browser."""


@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """Options of the live page."""

    live: Annotated[bool, Parameter(group=serving, negative="", show_default=False)] = False
    """Serve a page with sliders, at which the maneuver is planned and flown anew, until Ctrl-C."""

    planner: Annotated[str | None, Parameter(group=serving)] = None
    """The planner. Default: that of a plan, else miqp."""

    conditions: Annotated[str | None, Parameter(group=serving)] = None
    """The variation from flight to flight where the dispersion is 1: none, lab, field, or a TOML file.
    Default: lab."""

    port: Annotated[int | None, Parameter(group=serving, validator=validators.Number(gte=1, lte=65535))] = (
        None
    )
    """The port of 127.0.0.1, which no other machine reaches. Default: one that is free."""

    no_browser: Annotated[bool, Parameter(group=serving, negative="", show_default=False)] = False
    """Open no browser, and only say where the page is."""

    def require_live(self) -> None:
        """Raise SpecError for options that mean nothing without a live page."""
        for name in ("planner", "conditions", "port", "no_browser"):
            if getattr(self, name):
                flag = "--" + name.replace("_", "-")
                raise SpecError(f"{flag} is for --live; add it, or leave {flag} out")


def serve(source: Path | None, options: ViewOptions, serving: LiveOptions) -> None:
    """Plan, serve the page, and say where it is; return at Ctrl-C."""
    for name in ("html", "video", "open"):
        if getattr(options, name):
            raise SpecError(
                f"--{name} is for a page that is written, --live serves one; leave one of them out"
            )
    conditions = load_dispersion(serving.conditions or USUAL_CONDITIONS)
    choice = PlanningOptions(vehicle=options.vehicle, planner=serving.planner, plugins=options.plugins)
    plan, record = planned(PROBLEM if source is None else str(source), choice, "plan")
    with view_live(
        plan, record.planner, conditions=conditions, port=serving.port or 0, browser=False
    ) as page:
        if options.json:
            print_json(to_json({"address": page.address}))
        else:
            print(
                f"{page.address} shows {plan.problem.name}, planned anew as its sliders say; Ctrl-C ends it"
            )
        if not serving.no_browser:
            open_in_browser(page.address)
        try:
            page.wait()
        except KeyboardInterrupt:  # the one way in which it ends, and no failure
            return
