"""The commands' options, each with its help; those of the planners follow from the registered planners."""

# no postponed annotations here: the class of options is made from them, where nobody could look names up

from dataclasses import dataclass, field, make_dataclass
from functools import partial
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Group, Parameter, validators

from aerobat.interchange.columns import ALL
from aerobat.planning import PlannerOption, planner_options, registered_planners

planning = Group("Planning", sort_key=1)
flying = Group("Flying", sort_key=2)
limiting = Group("Limits", sort_key=2)
output = Group("Output", sort_key=3)

POSITIVE = validators.Number(gt=0)
Plugins = partial(
    Parameter,
    show_default=False,
    name="--import",
    negative="",
    help="A Python file that registers maneuvers or planners of your own; may be given several times.",
)
Options = TypeVar("Options", bound=type[Any])


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """Where results go."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to, replaced as a whole. Default: out/PROBLEM, with all that is not default in its
    name, as in out/half-flip-crazyflie-45deg-free-knots."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the report as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class ExplainingOptions:
    """Options of a report on a plan."""

    explain: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Find out and report what takes seconds to know, too: the recoveries to a hover from all along the plan,
    of a plan that takes suspiciously long another planner's second opinion, and where there is no plan the
    changes with which there is one."""


@dataclass(frozen=True, kw_only=True)
class RepeatOptions(OutputOptions, ExplainingOptions):
    """Options of a run that is repeated."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()


@dataclass(frozen=True, kw_only=True)
class TaskOptions(OutputOptions):
    """The problem's and the vehicle's options, and where results go."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: that of a .plan file, else
    agile-quad, or hexarotor with --paper."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()


@dataclass(frozen=True, kw_only=True)
class CompareOptions(TaskOptions):
    """Options of a comparison."""

    time_limit: Annotated[float | None, Parameter(group=planning, validator=validators.Number(gte=0))] = None
    """Seconds for each planner; the best plan that it finds by then is taken, and said to be that."""


def offered_options() -> dict[str, dict[str, PlannerOption]]:
    """The options of all registered planners: by flag, then by planner."""
    offered: dict[str, dict[str, PlannerOption]] = {}
    for name, cls in registered_planners().items():
        for option in planner_options(cls):
            offered.setdefault(option.flag, {})[name] = option
    return offered


def option_name(flag: str) -> str:
    """The field of PlanningOptions behind a flag."""
    return flag.removeprefix("--").replace("-", "_")


def is_given(value: Any) -> bool:
    """True for an option that was given, a zero among them."""
    return value is not None and value is not False


def _with_planner_options(cls: Options) -> Options:
    """The class with a field for each option that some planner offers, None where it was not given."""
    fields = [_field(flag, offers) for flag, offers in offered_options().items()]
    made: Any = make_dataclass(cls.__name__, fields, bases=(cls,), frozen=True, kw_only=True)
    made.__module__ = cls.__module__  # else it seems to be one of Python's own types
    return made  # type: ignore[no-any-return]


def _field(flag: str, offers: dict[str, PlannerOption]) -> tuple[str, Any, Any]:
    first = next(iter(offers.values()))
    is_switch = first.type is bool
    help = " ".join(_help(planner, option) for planner, option in offers.items())
    parameter = Parameter(name=flag, group=planning, help=help, negative="", show_default=False)
    kind = bool if is_switch else first.type | None
    return option_name(flag), Annotated[kind, parameter], field(default=False if is_switch else None)


def _help(planner: str, option: PlannerOption) -> str:
    value = option.default if option.command_default is None else option.command_default
    default = "" if option.type is bool or value is None else f" Default: {value}."
    return f"{planner}: {option.help}{default}"


def _planners_help() -> str:
    summaries = ((name, getdoc(cls) or cls.__name__) for name, cls in registered_planners().items())
    first = (f"{name}, {doc.splitlines()[0].rstrip('.')}" for name, doc in summaries)
    return "How to plan: " + "; ".join(first) + ". Default: miqp, of long courses time-optimal."


@_with_planner_options
@dataclass(frozen=True, kw_only=True)
class PlannerOptions(TaskOptions):
    """Options of all commands that plan by one planner."""

    planner: Annotated[str | None, Parameter(group=planning, help=_planners_help(), show_default=False)] = (
        None
    )


@dataclass(frozen=True, kw_only=True)
class PlanningOptions(PlannerOptions):
    """Options of all commands that plan once."""

    rate: Annotated[float | None, Parameter(group=planning, validator=POSITIVE)] = None
    """Rows a second of a CSV file without times. Default: 100."""

    heading: Annotated[float | None, Parameter(group=planning)] = None
    """The heading at the start of a CSV file's path in degrees. Default: that of its first attitude, or 0."""

    columns: Annotated[str, Parameter(group=output)] = ",".join(ALL)
    """What plan.csv holds, with a header: any of time, position, velocity, acceleration, jerk, attitude,
    rates, thrusts; or paper, the bare layout of the paper's reference code."""

    paper: Annotated[bool, Parameter(group=planning, negative="", show_default=False)] = False
    """Exactly the paper's formulation with its reference parameters: miqp of order 3, bounds per axis,
    unsigned and unordered stages, dt the first feasible of 50 steps from 0.1 to 4 s; no vehicle in
    planning. Flown by --controller all the same."""


@dataclass(frozen=True, kw_only=True)
class ConditionsOptions:
    """Options of the conditions, and of planning for them."""

    probability: Annotated[
        float | None,
        Parameter(name="--pass", group=planning, validator=validators.Number(gt=0, lt=1)),
    ] = None
    """Plan until flights under --conditions pass with this probability, with a reserve of thrust and narrower
    gates as their spread asks for, and prove it on fresh flights."""

    conditions: Annotated[str | None, Parameter(group=flying)] = None
    """What varies, disturbs and is measured how: none, lab, field, or a TOML file. Default: flown as planned,
    from a state that is known."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of the conditions: the same seed, the same flight."""


@dataclass(frozen=True, kw_only=True)
class FlyingOptions(ConditionsOptions):
    """Options of the flight."""

    controller: Annotated[str, Parameter(group=flying)] = "full"
    """The control law, at the gains of the vehicle's file: full, or paper, the paper's own without moment
    feed-forward, motor-lag compensation and tilt before yaw."""

    plant: Annotated[str | None, Parameter(group=flying)] = None
    """Another simulator's physics in place of the built-in: mujoco, in which a gate that is touched is felt,
    or rotorpy."""


@dataclass(frozen=True, kw_only=True)
class SweepingOptions:
    """Options of many flights."""

    runs: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=1, lte=10**7))] = 1000
    """How many flights."""

    conditions: Annotated[str, Parameter(group=flying)] = "lab"
    """What varies from flight to flight, disturbs and is measured how: none, lab, field, or a TOML file."""

    controller: Annotated[str, Parameter(group=flying)] = "full"
    """The control law, at the gains of the vehicle's file: full, or paper."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of all flights: the same seed, the same flights."""

    workers: Annotated[int | None, Parameter(group=flying, validator=validators.Number(gte=1, lte=4096))] = (
        None
    )
    """How many processes fly; the flights are the same for any number. Default: one a core."""

    table: Annotated[Literal["csv", "parquet"], Parameter(group=output)] = "csv"
    """The form of the table, flights.csv or flights.parquet; the latter needs aerobat[parquet]."""


@dataclass(frozen=True, kw_only=True)
class TuningOptions:
    """Options of a search for gains."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle whose gains are sought: a name that `aerobat vehicles` lists, or a TOML file. Default: that
    of a .plan file, else agile-quad."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()

    conditions: Annotated[str, Parameter(group=flying)] = "lab"
    """What varies from flight to flight, disturbs and is measured how: none, lab, field, or a TOML file."""

    flights: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=2, lte=100_000))] = 200
    """How many flights of each maneuver each set of gains is tried on, and how many others judge the best."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of all flights: the same seed, the same gains, unless --time-limit ends the search."""

    evaluations: Annotated[
        int, Parameter(group=limiting, validator=validators.Number(gte=1, lte=100_000))
    ] = 150
    """How many sets of gains may be tried."""

    time_limit: Annotated[float | None, Parameter(group=limiting, validator=validators.Number(gte=0))] = None
    """Seconds of the search; the best gains by then are judged."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The vehicle's file to write; an earlier one is replaced. Default: out/VEHICLE-tuned.toml."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print before and after as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class CausesOptions:
    """Options of a measurement of causes of error."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: agile-quad."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    reserve: Annotated[float, Parameter(group=planning, validator=validators.Number(gte=0, lt=0.5))] = 0.1
    """Of every limit's range, kept at either end by plans that know the rotors."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=planning)] = ()

    conditions: Annotated[str, Parameter(group=flying)] = "lab"
    """What varies from flight to flight without the causes: lab, field, or a TOML file."""

    flights: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=1, lte=10**6))] = 1000
    """How many flights of each trial."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of all flights: the same seed, the same flights."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the measurements as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """Limits that a trajectory is checked for, beyond those of its vehicle's rotors and its problem."""

    vehicle: Annotated[str | None, Parameter(group=limiting)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: the plan's, else
    agile-quad."""

    heading: Annotated[float | None, Parameter(group=limiting)] = None
    """The heading at the start in degrees, carried along the path without spin. Default: the file's own, of a
    CSV file 0."""

    rate: Annotated[float, Parameter(group=limiting, validator=POSITIVE)] = 100.0
    """Rows a second of a CSV file without times."""

    max_speed: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest speed allowed, m/s."""

    max_tilt: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest tilt allowed, degrees from upright."""

    max_rate: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest body rate allowed, degrees a second."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=limiting)] = ()

    max_moment: Annotated[float | None, Parameter(group=limiting, validator=POSITIVE)] = None
    """The greatest moment allowed, N m."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the certificate as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """What a replay shows, and where it goes."""

    html: Annotated[Path | None, Parameter(group=output)] = None
    """The file to write; an earlier replay is replaced. Default: replay.html in the folder of a run, or
    beside another file, named after it."""

    video: Annotated[Path | None, Parameter(group=output)] = None
    """A video instead, to FILE.mp4 or FILE.gif, 30 frames a second; beside the page if --html is given too.
    Needs aerobat[viewer]."""

    speed: Annotated[float, Parameter(group=output, validator=POSITIVE)] = 0.5
    """How fast time goes in the video, 1 as it was flown."""

    vehicle: Annotated[str | None, Parameter(group=output)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: the plan's, else the preset
    of the flight's name."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=output)] = ()

    open: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Open the page in the browser."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print what was written as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """What a plan is exported to, and where."""

    to: Annotated[
        Literal["csv", "crazyflie", "ros1-bag", "ros2-bag", "mcap", "px4", "blender"], Parameter(group=output)
    ]
    """The format."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The file, or of crazyflie, px4 and ros2-bag the folder; an earlier export is replaced. Default:
    in out/, named after the plan's file or folder."""

    rate: Annotated[float | None, Parameter(group=output, validator=POSITIVE)] = None
    """Rows, messages or keys a second. Default: 100, of px4 250; crazyflie has none."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=output)] = ()

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print what was written and lost as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """Where the paper's figures go."""

    out: Annotated[Path, Parameter(group=output)] = Path("docs") / "figures"
    """The folder to write to; figures of these numbers in it are replaced."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print captions and files as JSON on standard output, and nothing else."""
