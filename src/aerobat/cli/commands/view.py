"""`aerobat view`: a page that replays what lies in a folder or a file, or a video of it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.live import LiveOptions, ViewOptions, serve
from aerobat.cli.progress import Progress, showing
from aerobat.cli.runs.folder import FLIGHT, REPLAY
from aerobat.cli.runs.record import RECORD, RunRecord, read_record
from aerobat.cli.runs.saved_plans import named_vehicle
from aerobat.cli.terminal import open_in_browser, print_json
from aerobat.control import named_controller
from aerobat.errors import SpecError
from aerobat.interchange import read_plan
from aerobat.planning import Plan
from aerobat.reporting.motion.video import write_video
from aerobat.reporting.plain_data import to_json
from aerobat.simulation import Flight, load_flight
from aerobat.simulation.flight import MAX_FLIGHT
from aerobat.simulation.fly import fly as simulate
from aerobat.storage import format_of, read_arrays
from aerobat.viewer.replay import Replay, require_replaceable, save_replay
from aerobat.viewer.replay import view as replay_of
from aerobat.viewer.scene import plan_fits

SWEPT = 50  # flights of a sweep that are shown


def view(
    source: Path | None = None,
    options: Annotated[ViewOptions, Parameter(name="*")] = ViewOptions(),
    serving: Annotated[LiveOptions, Parameter(name="*")] = LiveOptions(),
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
    if serving.live:
        serve(source, options, serving)
        return
    serving.require_live()
    if source is None:
        raise SpecError(
            "what shall be shown is missing; name a run's folder, a plan or a flight, or give --live"
        )
    run = _read(source)
    vehicle = None if options.vehicle is None else named_vehicle(options.vehicle)
    replay = replay_of(run.shown, run.plan, vehicle)
    page = options.html or (None if options.video else _default_page(source))
    if page is not None:
        require_replaceable(page)
    if options.video is not None:
        with showing(Progress("pictures drawn")) as progress:
            write_video(
                run.shown, options.video, run.plan, vehicle, options.speed, progress.counting("in all")
            )
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


@dataclass(frozen=True)
class _Source:
    """What is looked at, and the plan of a flight."""

    shown: Plan | Flight
    plan: Plan | None = None


def _read(source: Path) -> _Source:
    """The flight of a folder with its plan, the plan where there is no flight, or what one file holds."""
    if source.suffix == ".npz" and _holds_flight(source):
        flight = load_flight(source)
        return _Source(flight, _plan_beside(source, flight))
    if not os.path.exists(source):  # of a name that is too long, Path raises
        raise SpecError(f"{source}: there is no such file or folder; `aerobat fly PROBLEM` writes one")
    found = read_plan(source)
    if not isinstance(found, Plan):
        raise SpecError(f"{source} holds a path alone; give it to `aerobat fly`, and view what that writes")
    if os.path.isdir(source) and (source / FLIGHT).exists():
        return _Source(load_flight(source / FLIGHT), found)
    if os.path.isdir(source) and (source / RECORD).exists():
        record = read_record(source)
        if record.command == "sweep":
            return _Source(_first_flights(found, record), found)
    return _Source(found)


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


def _holds_flight(file: Path) -> bool:
    return format_of(read_arrays(file, "flight", MAX_FLIGHT)).startswith("aerobat-flight")


def _plan_beside(file: Path, flight: Flight) -> Plan | None:
    """The one plan in a flight's folder, if it is what was flown."""
    plans = list(file.parent.glob("*.plan"))
    if len(plans) != 1:
        return None
    plan = read_plan(plans[0])
    return plan if isinstance(plan, Plan) and plan_fits(plan, flight) else None


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
