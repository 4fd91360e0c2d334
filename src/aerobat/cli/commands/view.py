"""`aerobat view`: a page that replays what lies in a folder or a file, or a video of it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter, validators

from aerobat.cli.options import POSITIVE, USUAL_CONDITIONS, PlanningOptions, VehicleOptions, output
from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.folder import FLIGHT, REPLAY
from aerobat.cli.runs.record import RECORD, RunRecord, read_record
from aerobat.cli.runs.saved_plans import named_vehicle, whole_plan
from aerobat.cli.tasks import plan_of, read_run
from aerobat.cli.terminal import open_in_browser, print_json
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan, load_plan
from aerobat.reporting.motion.video import write_video
from aerobat.reporting.plain_data import to_json
from aerobat.simulation import Flight, load_flight
from aerobat.simulation.flight import MAX_FLIGHT
from aerobat.simulation.fly import fly as simulate
from aerobat.storage import format_of, read_arrays
from aerobat.viewer.live.view_live import view_live
from aerobat.viewer.replay import Replay, require_replaceable, save_replay
from aerobat.viewer.replay import view as replay_of
from aerobat.viewer.scene import plan_fits

PROBLEM = "flip-roll"  # where nobody names one
serving = Group("Live", sort_key=4)
SWEPT = 50  # flights of a sweep that are shown
USUAL_SPEED = 0.5  # of time in a video


@dataclass(frozen=True, kw_only=True)
class ViewOptions(VehicleOptions):
    """Options of a replay: what it shows, and where it goes."""

    html: Annotated[Path | None, Parameter(group=output)] = None
    """The file to write; an earlier replay is replaced. Default: replay.html in the folder of a run, or
    beside another file, named after it."""

    video: Annotated[Path | None, Parameter(group=output)] = None
    """A video instead, to FILE.mp4 or FILE.gif, 30 frames a second; beside the page if --html is given too.
    Needs aerobat[viewer]."""

    speed: Annotated[float | None, Parameter(group=output, validator=POSITIVE)] = None
    """The pace of time in the video, 1 as it was flown. Default: 0.5."""

    open: Annotated[bool, Parameter(group=output, show_default=False)] = False
    """Open the page in the browser."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LiveOptions:
    """Options of the live page."""

    live: Annotated[bool, Parameter(group=serving, show_default=False)] = False
    """Serve a page with sliders, at which the maneuver is planned and flown anew, until Ctrl-C."""

    planner: Annotated[str | None, Parameter(group=serving)] = None
    """The planner. Default: that of a plan, else what suits the problem."""

    conditions: Annotated[str | None, Parameter(group=serving)] = None
    """The variation from flight to flight where the dispersion is 1: none, lab, field, or a TOML file.
    Default: lab."""

    port: Annotated[int | None, Parameter(group=serving, validator=validators.Number(gte=1, lte=65535))] = (
        None
    )
    """The port of 127.0.0.1, which no other machine reaches. Default: one that is free."""

    no_browser: Annotated[bool, Parameter(group=serving, show_default=False)] = False
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
    record, saved = read_run(PROBLEM if source is None else str(source), choice, "plan")
    plan = plan_of(record, saved)
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


def view(
    source: Path | None = None,
    options: ViewOptions = ViewOptions(),
    serving: LiveOptions = LiveOptions(),
) -> None:
    """Write a page that replays a run, a plan or a flight: one HTML file that a browser opens from the disk.

    The page shows the vehicle on its path, gates, stages and thrusts, and beside them errors and rotor
    thrusts. Space plays, the arrow keys step, 1, 2 and 3 are its cameras. Of a batch all flights are shown,
    of a sweep the first 50, flown again, and which of them failed. The page is written to replay.html in a
    run's folder, which the next run there replaces with all else, or beside another file, unless --html says
    otherwise. --video FILE.mp4 or FILE.gif writes a video.

    --live serves a page with sliders instead, until Ctrl-C. The sliders move and tilt gates, and set the
    thrust that the maneuver asks at least, the order, the thrust-to-weight and how much flights are
    dispersed. Whatever the sliders say is planned and flown at once, with the verdict in words.

    Parameters
    ----------
    source
        A folder that `aerobat plan`, `fly` or `sweep` wrote, a .plan file, or a flight's .npz file; with
        --live a problem's name or file too, by default flip-roll.
    """
    if options.speed is not None and options.video is None:
        raise SpecError("--speed is for --video; add it, or leave --speed out")
    if serving.live:
        serve(source, options, serving)
        return
    serving.require_live()
    if source is None:
        raise SpecError(
            "what shall be shown is missing; name a run's folder, a plan or a flight, or give --live"
        )
    shown, plan = _read(source)
    vehicle = None if options.vehicle is None else named_vehicle(options.vehicle)
    replay = replay_of(shown, plan, vehicle)
    page = options.html or (None if options.video else _default_page(source))
    if page is not None:
        require_replaceable(page)
    if options.video is not None:
        with showing(Progress("pictures drawn")) as progress:
            pace = options.speed or USUAL_SPEED
            write_video(shown, options.video, plan, vehicle, pace, progress.counting("in all"))
    if page is not None:
        save_replay(replay, page)
    if options.json:
        print_json(to_json(_facts(replay, page, options.video)))
    else:
        print(f"{replay.scene.title}: {'; '.join(replay.scene.facts)}")
        for written in filter(None, (options.video, page)):
            print(f"written to {written}")
    opened = page or options.video
    if options.open and opened is not None:
        open_in_browser(opened)


def _read(source: Path) -> tuple[Plan | Flight, Plan | None]:
    """Return the flight or the plan in a folder or file, and the plan of a flight where it is known."""
    if source.suffix == ".npz":
        format_name = format_of(read_arrays(source, "flight", MAX_FLIGHT))
        if format_name.startswith("aerobat-flight"):
            flight = load_flight(source)
            return flight, _plan_beside(source, flight)
    found = whole_plan(source, "give it to `aerobat fly`, and view what that writes")
    if os.path.isdir(source) and (source / FLIGHT).exists():
        return load_flight(source / FLIGHT), found
    if os.path.isdir(source) and (source / RECORD).exists():
        record = read_record(source)
        if record.command == "sweep":
            return _first_flights(found, record), found
    return found, None


def _first_flights(plan: Plan, record: RunRecord) -> Flight:
    """A sweep's first flights, flown again as they were: its table keeps what they came to alone."""
    settings = record.flight
    return simulate(
        plan,
        record.vehicle,
        controller=named_controller(settings.controller, record.vehicle.controller),
        conditions=settings.conditions,
        seed=settings.seed,
        flights=min(settings.runs, SWEPT),
    )


def _plan_beside(file: Path, flight: Flight) -> Plan | None:
    """The one plan in a flight's folder, if it is what was flown."""
    plans = list(file.parent.glob("*.plan"))
    if len(plans) != 1:
        return None
    plan = load_plan(plans[0])
    return plan if plan_fits(plan, flight) else None


def _default_page(source: Path) -> Path:
    """In a run's folder, its replay; of another file, a page beside it."""
    if os.path.isdir(source):
        return source / REPLAY
    return source.parent / REPLAY if (source.parent / RECORD).exists() else source.with_suffix(".html")


def _facts(replay: Replay, page: Path | None, video: Path | None) -> dict[str, object]:
    scene = replay.scene
    return {
        "page": None if page is None else str(page),
        "video": None if video is None else str(video),
        "bytes": sum(os.path.getsize(file) for file in (page, video) if file is not None),
        "title": scene.title,
        "facts": list(scene.facts),
        "flights": [{"sentence": track.sentence, "failed": track.failed} for track in scene.tracks],
        "duration_s": float(scene.times[-1]),
        "rows": len(scene.times),
    }
