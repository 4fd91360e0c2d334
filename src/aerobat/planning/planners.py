"""The function `plan`, from a problem to a plan by any planner, and the registry of planners.

A planner is a class with a method `plan`. The decorator `planner` declares and registers the class. Choices,
options and help of the command line follow from the fields of the registered classes.
"""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import partial, wraps
from types import MappingProxyType, ModuleType
from typing import (
    Annotated,
    Any,
    Protocol,
    TypeVar,
    cast,
    dataclass_transform,
    get_type_hints,
    runtime_checkable,
)

from pydantic import Field

from aerobat.declaration import Label, shown, suggest_for, validated
from aerobat.errors import Infeasible, Reason, SpecError
from aerobat.planning.assessment.contradiction import contradiction
from aerobat.planning.courses import is_course
from aerobat.planning.heading.follow import with_heading
from aerobat.planning.holds import between_holds
from aerobat.planning.moving_gates import through_moving_gates
from aerobat.planning.passages import require_attitudes_at_ends, require_clear_ends, require_openings
from aerobat.planning.recorder import Progress
from aerobat.planning.result import FLYING_CLEARANCE, FLYING_RESERVE, Plan, PlanMethod
from aerobat.problem import Problem, as_problem
from aerobat.problem.heading import HeadingMode
from aerobat.registry import Registry, placed
from aerobat.vehicle import Vehicle, as_vehicle, vehicle_names


@runtime_checkable
class Planner(Protocol):
    """A method that turns a problem into a plan.

    A custom planner inherits from this class and is registered by `@planner("its-name")`. It gets closed
    courses, which have neither start nor goal, only if its class sets `PLANS_CLOSED_COURSES = True`.
    """

    @abstractmethod
    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """Plan a problem. Raises Infeasible, with the attempts as evidence."""


P = TypeVar("P", bound=Planner)

DEFAULT_VEHICLE = "agile-quad"  # the vehicle if none is named, in Python and on the command line

PLANNERS: Registry[Planner] = Registry(
    Planner,  # type: ignore[type-abstract]
    "planner",
    "aerobat.planners",
    {
        "miqp": "aerobat.planning.miqp.miqp",
        "min-snap": "aerobat.planning.polynomial.min_snap",
        "free-knots": "aerobat.planning.polynomial.free_knots",
        "time-optimal": "aerobat.planning.time_optimal",
    },
)


@validated
def plan(
    problem: Problem | str,
    planner: Planner | str | None = None,
    vehicle: Vehicle | str | None = DEFAULT_VEHICLE,
    progress: Progress | None = None,
) -> Plan:
    """Plan a problem; with a vehicle, within its rotors' limits, with certificate, own flight, assessment.

    Dead rotors of the vehicle are removed, so that the plan numbers only the others. Raises Infeasible, whose
    message names the bound that binds and whose `attempts` hold the evidence. Raises SpecError for invalid
    input, such as a gate whose opening is too small for the vehicle.

    Args:
        problem: The problem, or its name.
        planner: The planner, for example `Miqp(order=5)`, or a registered name, which stands for the
            planner's defaults. If left out, the planner that `suited_planner` names is taken, with the
            settings of the command line: it keeps a reserve for the controller, 15 % for most vehicles.
        vehicle: The vehicle, or its name; agile-quad by default, as on the command line. With None the plan
            knows no limits but the problem's.
        progress: A function that is called with every attempt as it ends.
    """
    problem = as_problem(problem)
    vehicle = None if vehicle is None else as_vehicle(vehicle)
    if vehicle is not None:
        vehicle = vehicle.without_dead_rotors()
        vehicle.require_hover(problem.environment.gravity)
        require_attitudes_at_ends(problem, vehicle)
        require_openings(problem, vehicle)
        _require_consistency(problem, vehicle)
    elif problem.heading.mode is not HeadingMode.FREE:
        raise SpecError('heading: how fast it may turn, a vehicle says; give one, or mode = "free"')
    require_clear_ends(problem, vehicle)
    method = planner_for(problem, vehicle) if planner is None else as_planner(planner)
    found: Any = method.plan(problem, vehicle, progress)
    if not isinstance(found, Plan):
        name = getattr(method, "kind", type(method).__name__)
        wrong = SpecError(f"planner '{name}' returned {shown(found)} from plan(), not a Plan")
        raise placed(wrong, method.plan)
    found = found if vehicle is None or found.vehicle is not None else found.for_vehicle(vehicle)
    return with_heading(found, getattr(method, "reserve", 0.0))


def _option_of(name: str) -> str:
    """Return a hint for an argument that `plan` does not have, if it is an option of planners."""
    classes: Mapping[str, Any] = registered_planners()
    takers = [kind for kind, cls in classes.items() if name in {f.name for f in fields(cls)}]
    if not takers:
        return ""
    made = f"ab.{classes[takers[0]].__name__}({name}=...)"
    return f"{name} is an option of planners ({', '.join(takers)}), say planner={made}"


suggest_for(plan, _option_of)


def _require_consistency(problem: Problem, vehicle: Vehicle) -> None:
    """Raise Infeasible for a problem that is proven in milliseconds to have no plan by any planner."""
    found = contradiction(problem, vehicle)
    if found is not None:
        sentence = f"'{problem.name}' is proven to have no plan: {found.sentence}"
        raise Infeasible(Reason(sentence, found.limits or (f"stage '{found.stage}'",)))


def suited_planner(problem: Problem, vehicle: Vehicle | None) -> str:
    """Return the name of the planner that is used if none is named.

    This is miqp, whose search is exact. Exceptions go to free-knots: closed courses, and with a vehicle long
    courses, which miqp cannot search in reasonable time, and obstacles if all stages have positions.
    """
    if not problem.ends:
        return "free-knots"
    if vehicle is None:
        return "miqp"
    stages = problem.stages(vehicle.max_specific_thrust)
    is_around = problem.surroundings.obstacles and all(stage.is_placed for stage in stages.stages)
    return "free-knots" if is_around or is_course(stages) else "miqp"


def planner_for(problem: Problem, vehicle: Vehicle | None) -> Planner:
    """Return the planner that suits a problem, with the command line's defaults, whose plans can be flown."""
    cls = planner_class(suited_planner(problem, vehicle))
    return cls(**command_settings(cls))


def command_settings(cls: type[Planner]) -> dict[str, Any]:
    """Return the fields of a planner whose default on the command line differs: plans there can be flown."""
    return {o.name: o.command_default for o in planner_options(cls) if o.command_default is not None}


def planner_with_reserve(name: str, reserve: float, **others: Any) -> Planner:
    """Return a planner, with a reserve if it has such a field.

    Args:
        name: The planner's registered name.
        reserve: The reserve, as a fraction of each limit's range; 0 stands for FLYING_RESERVE.
        **others: Values of other fields.
    """
    cls: Any = planner_class(name)
    if "reserve" in (f.name for f in fields(cls)):
        others["reserve"] = reserve or FLYING_RESERVE
    return cast(Planner, cls(**others))


def as_planner(planner: Planner | str) -> Planner:
    """Return a planner: the argument itself, or the one registered by that name with its defaults.

    Raises SpecError for an unknown name, and for classes and modules in place of a planner.
    """
    if isinstance(planner, str):
        if planner in vehicle_names():
            raise SpecError(f"{planner!r} is a vehicle, not a planner; give vehicle={planner!r}")
        return planner_class(planner)()
    if isinstance(planner, type | ModuleType):
        raise SpecError(f"planner must be a Planner or a name, got {shown(planner)}; make one, as Miqp()")
    return planner


@validated
def option(default: Any, help: str, off: str | None = None, command_default: Any = None) -> Any:
    """Return a dataclass field with a help text, which the command line offers as an option.

    Args:
        default: The field's default.
        help: A sentence that includes the unit.
        off: For a field that is true by default, the name of the flag that makes it false.
        command_default: The default on the command line, whose plans can be flown, if it differs.
    """
    metadata = {"help": help, "off": off, "command_default": command_default}
    return field(default=default, metadata=metadata)


# fraction of a limit's range that is kept from either of its ends for the controller
Reserve = Annotated[float, Field(ge=0, lt=0.5)]
KeptClearance = Annotated[float, Field(ge=0)]  # [m] kept from obstacles for the controller


def clearance_option() -> Any:
    """Return the field `clearance` [m] of planners that keep a clearance from obstacles."""
    return option(
        0.0,
        "The distance in metres that the body keeps from obstacles for the controller, less where a passage "
        "is narrow, and that paths keep inside the radius of waypoints, a tenth of it at most.",
        command_default=FLYING_CLEARANCE,
    )


@validated
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def planner(name: Label) -> Callable[[type[P]], type[P]]:
    """Return a decorator that declares a planner's class and registers it under `name`."""

    def register(cls: type[P]) -> type[P]:
        if "plan" in vars(cls):
            planning: Any = cls
            planning.plan = validated(_for_all_problems(name, cls))
        return cast(type[P], PLANNERS.add(name, cls))

    return register


def _for_all_problems(name: str, cls: type[P]) -> PlanMethod[P]:
    """Return the method `plan` of a planner's class, extended to problems with rests and moving gates.

    The method refuses closed courses if the planner does not know them. Linear algebra runs on one thread, as
    the matrices are small.
    """
    planned = partial(between_holds, cls.plan)
    knows_closed_courses = getattr(cls, "PLANS_CLOSED_COURSES", False)

    @wraps(cls.plan)
    def plan(
        self: P, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        if not (problem.ends or knows_closed_courses):
            raise SpecError(
                f"maneuver.closed: the {name} planner goes from a start to a goal, a closed course has "
                "neither; take free-knots"
            )
        from aerobat.optimization.threads import one_thread  # SciPy is imported when something is planned

        with one_thread():
            found = through_moving_gates(planned, self, problem, vehicle, progress)
        asked = getattr(self, "reserve", 0.0)
        return dataclasses.replace(found, reserve=asked) if asked and isinstance(found, Plan) else found

    return plan


def registered_planners() -> Mapping[str, type[Planner]]:
    """Return the planners by name: first those of this package, then those of plugins and other packages."""
    return MappingProxyType({name: PLANNERS[name] for name in PLANNERS})


def planner_class(name: str) -> type[Planner]:
    """Return the class of a planner by its name; other planners of the package are not imported.

    Raises SpecError for an unknown name.
    """
    return PLANNERS[name]


@dataclass(frozen=True)
class PlannerOption:
    """A field of a planner that the command line offers."""

    name: str  # of the field
    type: Any
    default: Any
    help: str
    flag: str  # such as --time-limit; for a field that is true by default, the flag that makes it false
    command_default: Any = None  # the command line's default if it differs


def planner_options(cls: type[Any]) -> tuple[PlannerOption, ...]:
    """Return the options of a planner on the command line: its fields that have a help text."""
    hints = get_type_hints(cls)
    return tuple(_option(f, hints[f.name]) for f in fields(cls) if "help" in f.metadata)


def _option(f: dataclasses.Field[Any], hint: Any) -> PlannerOption:
    default = f.default if f.default_factory is MISSING else f.default_factory()
    flag = f.metadata.get("off") or f.name
    flag = "--" + flag.replace("_", "-")
    return PlannerOption(f.name, hint, default, f.metadata["help"], flag, f.metadata.get("command_default"))
