"""plan(): a problem in, a plan out, whichever the planner; and the planners by name.

A planner is a frozen dataclass with a method `plan`, registered by one line, the decorator `planner`. Help,
the command line's choices and its options follow from that.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, field, fields
from importlib import import_module
from typing import Any, Protocol, TypeVar, get_type_hints

from aerobat.declaration import unknown_name
from aerobat.errors import SpecError
from aerobat.planning.certified_solve import with_certificate
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

# in the order in which they are listed; each registers itself when it is imported
BUILTIN = {
    "miqp": "aerobat.planning.miqp.miqp",
    "min-snap": "aerobat.planning.polynomial.min_snap",
    "free-knots": "aerobat.planning.polynomial.free_knots",
    "time-optimal": "aerobat.planning.time_optimal.time_optimal",
}
PlannerClass = TypeVar("PlannerClass", bound=type[Any])
_registered: dict[str, type[Any]] = {}


class Planner(Protocol):
    """Whatever turns a problem into a plan."""

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The plan, or Infeasible."""
        ...


def plan(
    problem: Problem,
    planner: Planner | str = "miqp",
    vehicle: Vehicle | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Plan a problem; with a vehicle, for its rotors and with its certificate.

    Raises Infeasible, whose message names the bound that binds and whose `attempts` hold the evidence, and
    SpecError for input that makes no sense.

    Args:
        problem: What is planned.
        planner: How to plan, say `Miqp(order=5)`, or a registered name, whose defaults are taken.
        vehicle: What shall fly it, within its rotors' limits; without one the plan knows no limits but the
            problem's.
        progress: Called with every attempt as it ends.
    """
    if vehicle is not None:
        vehicle.require_hover(problem.environment.gravity)
    chosen = planner_class(planner)() if isinstance(planner, str) else planner
    found = chosen.plan(problem, vehicle, progress)
    return found if vehicle is None or found.certificate is not None else with_certificate(found, vehicle)


def planner(name: str) -> Callable[[PlannerClass], PlannerClass]:
    """Register a planner's class under a name, by which `plan` and the command line know it.

    Raises SpecError for a name that another class has.
    """

    def register(cls: PlannerClass) -> PlannerClass:
        known = _registered.get(name)
        if known is not None and known.__qualname__ != cls.__qualname__:
            raise SpecError(f"there is a planner named '{name}' already; register {cls.__name__} by another")
        _registered[name] = cls
        return cls

    return register


def registered_planners() -> dict[str, type[Planner]]:
    """All planners' classes by name, the package's own first."""
    for module in BUILTIN.values():
        import_module(module)
    return {name: _registered[name] for name in (*BUILTIN, *_registered)}


def planner_class(name: str) -> type[Planner]:
    """The planner's class of that name; no other of the package's is imported. Raises SpecError for none."""
    if name not in _registered and name in BUILTIN:
        import_module(BUILTIN[name])
    if name not in _registered:
        raise unknown_name("planner", name, list(registered_planners()))
    return _registered[name]


@dataclass(frozen=True)
class PlannerOption:
    """A field of a planner that the command line offers."""

    name: str  # of the field
    type: Any
    default: Any
    help: str
    flag: str  # --time-limit; of a field that is true by default what makes it false
    command_default: Any = None  # the command line's default, where it is another one


def option(default: Any, help: str, off: str | None = None, command_default: Any = None) -> Any:
    """A dataclass field with its help, which the command line offers as an option.

    Args:
        default: Its value, where nothing else is said.
        help: A sentence, its unit included.
        off: Of a field that is true by default, the name of the flag that makes it false.
        command_default: Its value on the command line, whose plans are to be flown, where it is another one.
    """
    metadata = {"help": help, "off": off, "command_default": command_default}
    return field(default=default, metadata=metadata)


def planner_options(cls: type[Any]) -> tuple[PlannerOption, ...]:
    """What the command line offers of a planner: its fields that have a help."""
    hints = get_type_hints(cls)
    return tuple(_option(f, hints[f.name]) for f in fields(cls) if "help" in f.metadata)


def _option(f: Field[Any], hint: Any) -> PlannerOption:
    default = f.default if f.default_factory is MISSING else f.default_factory()
    flag = f.metadata.get("off") or f.name
    flag = "--" + flag.replace("_", "-")
    return PlannerOption(f.name, hint, default, f.metadata["help"], flag, f.metadata.get("command_default"))
