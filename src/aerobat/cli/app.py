"""The commands themselves, and how they end."""

from __future__ import annotations

import atexit
import gc
import sys
from collections.abc import Sequence
from dataclasses import replace
from math import inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter

from aerobat.cli.options import CheckOptions, FlyingOptions, PlanningOptions, TaskOptions
from aerobat.cli.tasks import make_plan, planning_progress, read_task
from aerobat.errors import AerobatError, Infeasible

if TYPE_CHECKING:
    from aerobat.flight import Flight
    from aerobat.metrics import Score
    from aerobat.planning import Plan
    from aerobat.vehicle import Vehicle

NOT_CERTIFIED = 1
BAD_INPUT = 2
INFEASIBLE = 3

app = App(
    name="aerobat",
    help="""Plan, fly and prove aggressive maneuvers for multirotors.

    Try `aerobat fly flip-roll`: it plans a flip through a gate, flies it in simulation, says whether it
    went well and why not, and writes the plan, the flight, a picture and a report to out/flip-roll/.
    """,
    help_epilogue="""Exit codes: 0 done; 1 `check` did not certify the trajectory; 2 the input is wrong (one
    sentence says where); 3 no plan exists (one sentence says which bound binds and what would free it).
    """,
)

Planned = Annotated[PlanningOptions, Parameter(name="*")]
Tasked = Annotated[TaskOptions, Parameter(name="*")]
Aloft = Annotated[FlyingOptions, Parameter(name="*")]
Checked = Annotated[CheckOptions, Parameter(name="*")]


@app.command
def fly(problem: str, options: Planned = PlanningOptions(), aloft: Aloft = FlyingOptions()) -> None:
    """Plan a maneuver, fly it in simulation, and report.

    Prints a short table and writes to the output folder: plan.npz (the polynomials), plan.csv (position,
    velocity, acceleration and jerk at 100 Hz), flight.npz (everything that was simulated), report.png and
    report.json.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    from aerobat.flying import fly as fly_trajectory
    from aerobat.metrics import score
    from aerobat.simulation import StateNoise

    noise = StateNoise.fused().scaled(aloft.noise) if aloft.noise else None
    task, vehicle = read_task(problem, options, options.paper)
    plan = make_plan(task, vehicle, options)
    flight = fly_trajectory(
        plan.trajectory, vehicle, environment=task.environment, noise=noise, seed=aloft.seed
    )
    _finish(plan, vehicle, options, flight, score(flight, task, vehicle))


@app.command
def plan(problem: str, options: Planned = PlanningOptions()) -> None:
    """Plan a maneuver and stop there.

    As `aerobat fly`, without the flight: writes plan.npz, plan.csv, report.png and report.json.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    task, vehicle = read_task(problem, options, options.paper)
    _finish(make_plan(task, vehicle, options), vehicle, options)


@app.command
def check(plan: Path, options: Checked = CheckOptions()) -> None:
    """Prove over continuous time that a vehicle can fly a trajectory, or say when and why it cannot.

    The proof covers every rotor's thrust and, where limits are given, speed, tilt, body rates and moments. It
    does not sample: between any two instants it bounds what happens. Exits with 0 only if all is proven.

    Parameters
    ----------
    plan
        A plan.npz, a CSV file (rows of position, velocity, acceleration, jerk), or a folder that
        `aerobat plan` or `aerobat fly` wrote.
    """
    from aerobat.certification import Envelope, certify
    from aerobat.interchange import read_trajectory
    from aerobat.reporting.report_json import to_json
    from aerobat.reporting.tables import certificate_table, show
    from aerobat.vehicle import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    envelope = Envelope(
        speed=options.max_speed or inf,
        tilt=inf if options.max_tilt is None else radians(options.max_tilt),
        body_rate=inf if options.max_rate is None else radians(options.max_rate),
        moment=options.max_moment or inf,
    )
    trajectory = read_trajectory(plan, options.rate)
    if options.heading is not None:
        trajectory = replace(trajectory, heading=radians(options.heading))
    certificate = certify(trajectory, vehicle, envelope=envelope)
    if options.json:
        print(to_json(certificate.record()))
    else:
        show(certificate_table(certificate, f"{plan} · {vehicle.name}"))
    if not certificate.certified:
        sys.exit(NOT_CERTIFIED)


@app.command
def compare(problem: str, options: Tasked = TaskOptions()) -> None:
    """Plan a maneuver with every planner and put the plans side by side.

    Prints a table of durations, ratios to the time-optimal plan, margins, proofs and tracking errors, and
    writes compare.png and compare.json to the output folder.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    from aerobat.reporting.comparison import comparison_figure, comparison_rows, comparison_table
    from aerobat.reporting.page import png
    from aerobat.reporting.report_json import to_json
    from aerobat.reporting.tables import show
    from aerobat.storage import write_whole
    from aerobat.studies.compare import compare as compare_planners

    task, vehicle = read_task(problem, options)
    with planning_progress() as progress:
        comparison = compare_planners(task, vehicle, progress=progress)
    folder = options.out or Path("out") / task.name
    rows = to_json(comparison_rows(comparison))
    picture = png(comparison_figure(comparison))  # before anything is written: all files or none
    write_whole(folder / "compare.json", rows + "\n")
    write_whole(folder / "compare.png", picture)
    if options.json:
        print(rows)
        return
    show(comparison_table(comparison))
    print(f"\nwritten to {folder}/")


@app.command
def vehicles() -> None:
    """List the built-in vehicles."""
    from aerobat.reporting.tables import show, vehicles_table
    from aerobat.vehicle import load_vehicle, vehicle_names

    show(vehicles_table(load_vehicle(name) for name in vehicle_names()))


@app.command
def problems() -> None:
    """List the built-in problems."""
    from aerobat.problem import load_problem, problem_names
    from aerobat.reporting.tables import problems_table, show

    show(problems_table(load_problem(name) for name in problem_names()))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on `arguments`, by default those of the process.

    Whatever is foreseen ends in one sentence on standard error, and an exit code.
    """
    gc.set_threshold(100_000, 50, 50)  # a short process need not look for cyclic garbage often,
    atexit.register(gc.freeze)  # and least of all when it ends: a tenth of the main job
    tokens = sys.argv[1:] if arguments is None else arguments
    try:
        app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        _exit(" ".join(str(error).split()), BAD_INPUT)
    except Infeasible as error:
        _exit(str(error), INFEASIBLE)
    except AerobatError as error:
        _exit(str(error), BAD_INPUT)
    except KeyboardInterrupt:
        _exit("interrupted", 130)


def _exit(sentence: str, code: int) -> None:
    print(f"aerobat: {sentence}", file=sys.stderr)
    sys.exit(code)


def _finish(
    plan: Plan,
    vehicle: Vehicle,
    options: PlanningOptions,
    flight: Flight | None = None,
    score: Score | None = None,
) -> None:
    """Write what was made, then say what it is."""
    from aerobat.interchange.csv import write_csv
    from aerobat.reporting.figures import report_figure
    from aerobat.reporting.page import png
    from aerobat.reporting.report_json import report, to_json
    from aerobat.storage import write_whole
    from aerobat.trajectory import save_trajectory

    folder = options.out or Path("out") / plan.problem.name
    facts = report(plan, score, vehicle.name)
    figure = report_figure(plan, vehicle, flight, score)
    picture = png(figure)  # before anything is written: all files or none
    save_trajectory(plan.trajectory, folder / "plan.npz")
    write_csv(plan.trajectory, folder / "plan.csv")
    if flight is not None:
        flight.save(folder / "flight.npz")
    write_whole(folder / "report.json", to_json(facts) + "\n")
    write_whole(folder / "report.png", picture)
    if options.json:
        print(to_json(facts))
        return
    from aerobat.reporting.tables import show, summary_table

    show(summary_table(plan, score, vehicle.name))
    print(f"\nwritten to {folder}/")
