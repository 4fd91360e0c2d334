"""The command line: plan | fly | vehicles | problems."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import isfinite, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Group, Parameter, validators

from aerobat.errors import AerobatError, Infeasible, SpecError
from aerobat.reporting.illustrator import Illustrator, unhurried_collector

if TYPE_CHECKING:
    from aerobat.flight import Flight
    from aerobat.metrics import Score
    from aerobat.planning import Attempt, Plan
    from aerobat.specs import Problem
    from aerobat.vehicle import Vehicle

BAD_INPUT = 2
INFEASIBLE = 3

planning = Group("Planning", sort_key=1)
flying = Group("Flying", sort_key=2)
output = Group("Output", sort_key=3)

app = App(
    name="aerobat",
    help="""Plan, fly and prove aggressive maneuvers for multirotors.

    Try `aerobat fly flip-roll`: it plans a flip through a gate, flies it in simulation, says whether it
    went well and why not, and writes the plan, the flight, a picture and a report to out/flip-roll/.
    """,
    help_epilogue="""Exit codes: 0 done; 2 the input is wrong (one sentence says where); 3 no plan exists (one
    sentence says which bound binds and what would free it).
    """,
)


@dataclass(frozen=True, kw_only=True)
class PlanningOptions:
    """Options that both commands share."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: agile-quad, or hexarotor
    with --paper."""

    order: Annotated[int | None, Parameter(group=planning)] = None
    """The derivative that is piecewise constant: 3 jerk (the paper's), 4 snap, 5 crackle. Default: 4, or 3
    with --paper."""

    intervals: Annotated[int, Parameter(group=planning)] = 20
    """N, the number of intervals."""

    backend: Annotated[str, Parameter(group=planning)] = "builtin"
    """The solver: builtin, gurobi or scip (the last two are optional extras)."""

    time_limit: Annotated[float | None, Parameter(group=planning)] = None
    """Seconds for each program; the best plan found by then is taken and its gap reported."""

    paper: Annotated[bool, Parameter(group=planning, negative="", show_default=False)] = False
    """Exactly the paper's formulation with its reference parameters: order 3, bounds per axis, unsigned and
    unordered stages, dt the first feasible of 50 steps from 0.1 to 4 s, no vehicle in planning."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to. Default: out/PROBLEM."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the report as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class FlyingOptions:
    """Options of the flight."""

    noise: Annotated[float, Parameter(group=flying, validator=validators.Number(gte=0))] = 0.0
    """The error of the state that the controller sees: 0 none, 1 that of motion capture and IMU fused."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of that noise: the same seed, the same flight."""


Common = Annotated[PlanningOptions, Parameter(name="*")]
Aloft = Annotated[FlyingOptions, Parameter(name="*")]


@app.command
def fly(problem: str, options: Common = PlanningOptions(), aloft: Aloft = FlyingOptions()) -> None:
    """Plan a maneuver, fly it in simulation, and report.

    Prints a short table and writes to the output folder: plan.csv (position, velocity, acceleration and
    jerk at 100 Hz), flight.npz (everything that was simulated), report.png and report.json.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    with Illustrator() as illustrator:
        from aerobat.flying import fly as fly_trajectory
        from aerobat.metrics import score
        from aerobat.simulation import StateNoise

        noise = StateNoise.fused().scaled(aloft.noise) if aloft.noise else None
        task, vehicle = _read(problem, options)
        plan = _plan(task, vehicle, options)
        flight = fly_trajectory(plan.trajectory, vehicle, yaw=task.yaw, noise=noise, seed=aloft.seed)
        _finish(illustrator, plan, vehicle, options, flight, score(flight, task, vehicle))


@app.command
def plan(problem: str, options: Common = PlanningOptions()) -> None:
    """Plan a maneuver and stop there.

    As `aerobat fly`, without the flight: writes plan.csv, report.png and report.json.

    Parameters
    ----------
    problem
        A name that `aerobat problems` lists, or a problem's TOML file.
    """
    with Illustrator() as illustrator:
        task, vehicle = _read(problem, options)
        _finish(illustrator, _plan(task, vehicle, options), vehicle, options)


@app.command
def vehicles() -> None:
    """List the built-in vehicles."""
    from aerobat.reporting.tables import show, vehicles_table
    from aerobat.vehicle import load_vehicle, vehicle_names

    show(vehicles_table(load_vehicle(name) for name in vehicle_names()))


@app.command
def problems() -> None:
    """List the built-in problems."""
    from aerobat.reporting.tables import problems_table, show
    from aerobat.specs import load_problem, problem_names

    show(problems_table(load_problem(name) for name in problem_names()))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line on `arguments`, by default those of the process.

    Whatever is foreseen ends in one sentence on standard error, and an exit code.
    """
    unhurried_collector()
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


def _read(name: str, options: PlanningOptions) -> tuple[Problem, Vehicle]:
    from aerobat.specs import HalfFlip, load_problem
    from aerobat.vehicle import load_vehicle

    problem = load_problem(name)
    vehicle = load_vehicle(options.vehicle or ("hexarotor" if options.paper else "agile-quad"))
    if options.angle is not None:
        if problem.gate is None or not isinstance(problem.maneuver, HalfFlip):
            raise SpecError(f"--angle tilts the gate of a half-flip; '{problem.name}' is none, leave it out")
        if not (isfinite(options.angle) and abs(options.angle) <= 90.0):
            raise SpecError(f"--angle must be from -90 to 90 degrees, got {options.angle}")
        problem = replace(problem, gate=problem.gate.tilted(radians(options.angle)))
    if options.paper:
        problem = problem.as_in_paper()
    if problem.gravity is not None:
        vehicle = replace(vehicle, gravity=problem.gravity)
    return problem, vehicle


def _plan(problem: Problem, vehicle: Vehicle, options: PlanningOptions) -> Plan:
    from aerobat.planning import Miqp, rotor_margin
    from aerobat.planning import plan as plan_problem

    if options.paper and options.order not in (None, 3):
        raise SpecError(f"--paper plans with order 3 (jerk), got --order {options.order}; leave one out")
    order = options.order or (3 if options.paper else 4)
    planner = Miqp(order, options.intervals, backend=options.backend, time_limit=options.time_limit)
    with _progress() as progress:
        if not options.paper:
            return plan_problem(problem, planner, vehicle, progress)
        plan = plan_problem(problem, planner, progress=progress)
    return replace(plan, margin=rotor_margin(plan.trajectory, vehicle, problem.yaw))


@contextmanager
def _progress() -> Iterator[Callable[[Attempt], None] | None]:
    """The attempts as they come, on a terminal; nothing in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status("planning") as status:
        yield lambda a: status.update(f"planning: {a.duration:.3f} s, {a.outcome}")


def _finish(
    illustrator: Illustrator,
    plan: Plan,
    vehicle: Vehicle,
    options: PlanningOptions,
    flight: Flight | None = None,
    score: Score | None = None,
) -> None:
    """Write what was made, then say what it is."""
    from aerobat.exporting.csv import write_csv
    from aerobat.reporting.report import report, to_json
    from aerobat.storage import write_whole

    illustrator.begin(plan, vehicle, flight, score)
    folder = options.out or Path("out") / plan.problem.name
    facts = report(plan, score, vehicle.name)
    picture = illustrator.picture()  # before anything is written: all files or none
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


if __name__ == "__main__":
    main()
