"""The commands' options, each with its help; those of the planners follow from the registered planners.

`@Parameter(name="*")` has a command take the fields of a class, and of those that extend it, as its options.
"""

# no postponed annotations here: `make_dataclass` needs annotations that are types, not their names

import dataclasses
from dataclasses import dataclass, field, make_dataclass
from functools import partial
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any, TypeVar

from cyclopts import Group, Parameter, validators

from aerobat.errors import SpecError
from aerobat.interchange.columns import ALL
from aerobat.planning import PlannerOption, planner_options, registered_planners

planning = Group("Planning", sort_key=1)
flying = Group("Flying", sort_key=2)
limiting = Group("Limits", sort_key=2)
output = Group("Output", sort_key=3)

Seed = Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))]
POSITIVE = validators.Number(gt=0)
HEADING = validators.Number(gte=-720, lte=720)  # [deg]
USUAL_CONDITIONS = "lab"  # under which flights are counted by default


def _require_workers(type_: Any, value: str | None) -> None:
    from aerobat.studies.workers import read_workers  # takes a tenth of a second

    if value is not None:
        read_workers(value)


Workers = partial(
    Parameter,
    name="--workers",
    validator=_require_workers,
    help="The number of processes, or a Dask scheduler as dask://HOST:PORT, which needs aerobat[cluster]; "
    "the results are the same for any. Default: one a core.",
)
Options = TypeVar("Options", bound=type[Any])


def how_many(least: int, most: int) -> Parameter:
    """Return the option of a number of flights, which has the same names in every command."""
    flights = validators.Number(gte=least, lte=most)
    return Parameter(name=("--runs", "--flights"), group=flying, validator=flights)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PluginOptions:
    """Options of all commands that may use plugins."""

    plugins: Annotated[tuple[Path, ...], Parameter(name="--import", group=output, show_default=False)] = ()
    """A Python file that registers maneuvers, planners or control laws of your own; may be given several
    times."""

    @property
    def plugin_names(self) -> tuple[str, ...]:
        """The files of plugins as a run's record names them."""
        return tuple(map(str, self.plugins))


@dataclass(frozen=True, kw_only=True)
class RunOptions(PluginOptions):
    """Options of all commands that print a report."""

    json: Annotated[bool, Parameter(group=output, show_default=False)] = False
    """Print the report as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class VehicleOptions(RunOptions):
    """Options of all commands that need a vehicle."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat show` lists, or a TOML file. Default: that of a plan or a flight,
    else agile-quad."""


@dataclass(frozen=True, kw_only=True)
class ProblemOptions(VehicleOptions):
    """Options of all commands that plan a problem."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class FlightsOptions:
    """Options of many flights."""

    flights: Annotated[int, how_many(1, 10**7)] = 1000
    """The number of flights, of each trial where there are several."""

    conditions: Annotated[str, Parameter(group=flying)] = USUAL_CONDITIONS
    """The variation between flights, the disturbances and the sensors: none, lab, field, or a TOML file."""

    seed: Seed = 0
    """The seed of all flights: the same seed, the same flights."""

    workers: Annotated[str | None, Workers(group=flying)] = None


@dataclass(frozen=True, kw_only=True)
class OutputOptions(RunOptions):
    """Options of the place of results."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to, replaced as a whole. Default: out/PROBLEM, with all that is not default in its
    name, as in out/half-flip-crazyflie-45deg-free-knots."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ExplainingOptions:
    """Options of a report on a plan."""

    explain: Annotated[bool, Parameter(group=output, show_default=False)] = False
    """Report all facts, and those that take seconds to know: the recoveries to a hover from all along the
    plan, and how many of a hundred flights succeed of a plan that is not flown. A plan that takes
    suspiciously long gets another planner's second opinion. Where there is no plan, the changes with which
    there is one are told."""


def offered_options() -> dict[str, dict[str, PlannerOption]]:
    """Return the options of all registered planners: by flag, then by planner."""
    offered: dict[str, dict[str, PlannerOption]] = {}
    for name, cls in registered_planners().items():
        for option in planner_options(cls):
            offered.setdefault(option.flag, {})[name] = option
    return offered


def option_name(flag: str) -> str:
    """Return the field of PlanningOptions of a flag."""
    return flag.removeprefix("--").replace("-", "_")


def is_given(value: Any) -> bool:
    """Return True for an option that was given; it may be zero."""
    return value is not None and value is not False


def _with_planner_options(cls: Options) -> Options:
    """Return the class with a field for each option of a planner, None by default."""
    offered = offered_options()
    for flag in sorted({f"--{each.name}" for each in dataclasses.fields(cls)} & offered.keys()):
        takers = " and ".join(offered[flag])
        raise SpecError(f"{flag} is an option of the command, and of the planner {takers}; rename that field")
    fields = [_field(flag, offers) for flag, offers in offered.items()]
    own = {"__doc__": cls.__doc__}  # else its signature is written out, in milliseconds
    made: Any = make_dataclass(cls.__name__, fields, bases=(cls,), namespace=own, frozen=True, kw_only=True)
    made.__module__ = cls.__module__  # else it seems to be one of Python's own types
    return made  # type: ignore[no-any-return]


def _field(flag: str, offers: dict[str, PlannerOption]) -> tuple[str, Any, Any]:
    first = next(iter(offers.values()))
    is_switch = first.type is bool
    parameter = Parameter(name=flag, group=planning, help=_help(offers), show_default=False)
    kind = bool if is_switch else first.type | None
    return option_name(flag), Annotated[kind, parameter], field(default=False if is_switch else None)


def _help(offers: dict[str, PlannerOption]) -> str:
    """Return the help of an option, once for all planners with the same meaning."""
    takers: dict[str, list[str]] = {}
    for planner, option in offers.items():
        value = option.default if option.command_default is None else option.command_default
        default = "" if option.type is bool or value is None else f" Default: {value}."
        takers.setdefault(f"{option.help}{default}", []).append(planner)
    return " ".join(f"{', '.join(planners)}: {text}" for text, planners in takers.items())


def _planners_help() -> str:
    summaries = ((name, getdoc(cls) or cls.__name__) for name, cls in registered_planners().items())
    first = " ".join(f"{name}: {doc.splitlines()[0]}" for name, doc in summaries)
    return f"The planner. {first} Default: miqp, of long courses and closed laps free-knots."


@_with_planner_options
@dataclass(frozen=True, kw_only=True)
class PlannerOptions(ProblemOptions, OutputOptions):
    """Options of all commands that plan by one planner."""

    planner: Annotated[str | None, Parameter(group=planning, help=_planners_help(), show_default=False)] = (
        None
    )


@dataclass(frozen=True, kw_only=True)
class PlanningOptions(PlannerOptions):
    """Options of all commands that plan once."""

    rate: Annotated[float | None, Parameter(group=planning, validator=POSITIVE)] = None
    """Rows a second of a CSV file without times. Default: 100."""

    heading: Annotated[float | None, Parameter(group=planning, validator=HEADING)] = None
    """The heading at the start of a CSV file's path in degrees. Default: that of its first attitude, or 0."""

    paper: Annotated[bool, Parameter(group=planning, show_default=False)] = False
    """Exactly the paper's formulation with its reference parameters: miqp of order 3, bounds per axis,
    unsigned and unordered stages, dt the first feasible of 50 steps from 0.1 to 4 s; no vehicle in
    planning. Flown by --controller all the same, the default vehicle being hexarotor."""


@dataclass(frozen=True, kw_only=True)
class TableOptions(PlanningOptions):
    """Options of all commands that write a plan's table."""

    columns: Annotated[str, Parameter(group=output)] = ",".join(ALL)
    """The columns of plan.csv, with a header: any of time, position, velocity, acceleration, jerk, attitude,
    rates, thrusts; or paper, the bare layout of the paper's reference code."""


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ConditionsOptions:
    """Options of the conditions, of the controller under them, and of planning for both."""

    probability: Annotated[
        float | None,
        Parameter(name="--pass", group=planning, validator=validators.Number(gt=0, lt=1)),
    ] = None
    """Plan until flights under --conditions, by default lab, pass with this probability, with a reserve of
    thrust and narrower gates as their spread asks for, and prove it on fresh flights."""

    conditions: Annotated[str | None, Parameter(group=flying)] = None
    """The variation, the disturbances and the sensors: none, lab, field, or a TOML file. Default: one flight
    as planned, from a state that is known, and a hundred or more under lab, which are counted."""

    seed: Seed = 0
    """The seed of the conditions: the same seed, the same flight."""

    controller: Annotated[str | None, Parameter(group=flying)] = None
    """The control law: full, or paper, the paper's own without moment feed-forward, motor-lag compensation
    and tilt before yaw, both at the gains of the vehicle's file; lee, lqr, indi; rates, collective thrust and
    body rates for an inner loop (CTBR); or one of your own that --import brings in. Default: full, with
    --autopilot rates."""

    autopilot: Annotated[str | None, Parameter(group=flying)] = None
    """A flight controller's firmware, to which the controller rates gives rates and thrust: betaflight, or
    your own that --import brings in. The folder of a flight then holds settings to paste to a board. The
    flights of --pass have the model of its inner loop in its place."""

    workers: Annotated[
        str | None,
        Workers(
            group=planning,
            help="The number of processes that fly for --pass, or a Dask scheduler as dask://HOST:PORT; the "
            "plan is the same for any. Default: one a core.",
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class FlyingOptions(ConditionsOptions):
    """Options of the flight."""

    plant: Annotated[str | None, Parameter(group=flying)] = None
    """Another simulator's physics in place of the built-in: mujoco, in which a gate that is touched is felt,
    rotorpy, or one of your own that --import brings in."""
