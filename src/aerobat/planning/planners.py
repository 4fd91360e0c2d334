"""plan(): a problem in, a plan out, whichever the planner; and the planners by name.

A planner is a class with a method `plan`, declared and registered by one line, the decorator `planner`. Help,
the command line's choices and its options follow from its fields.
"""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from types import MappingProxyType
from typing import Any, Protocol, TypeVar, cast, dataclass_transform, get_type_hints, runtime_checkable

from pydantic import Field

from aerobat.declaration import Registry
from aerobat.planning.certified_solve import with_certificate
from aerobat.planning.flyability import with_flyability
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle


@runtime_checkable
class Planner(Protocol):
    """Whatever turns a problem into a plan.

    A planner of one's own inherits from this class and is registered by `@planner("its-name")`.
    """

    @abstractmethod
    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """Plan a problem. Raises Infeasible, with the attempts as evidence."""


P = TypeVar("P", bound=Planner)

PLANNERS: Registry[Planner] = Registry(
    Planner,  # type: ignore[type-abstract]
    "planner",
    "aerobat.planners",
    {
        "miqp": "aerobat.planning.miqp.miqp",
        "min-snap": "aerobat.planning.polynomial.min_snap",
        "free-knots": "aerobat.planning.polynomial.free_knots",
        "time-optimal": "aerobat.planning.time_optimal.time_optimal",
    },
)


def plan(
    problem: Problem,
    planner: Planner | str = "miqp",
    vehicle: Vehicle | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Plan a problem; with a vehicle, for its rotors, with its certificate and its own simulated flight.

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
    if vehicle is None:
        return found
    return with_flyability(found if found.certificate is not None else with_certificate(found, vehicle))


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


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def planner(name: str) -> Callable[[type[P]], type[P]]:
    """Declare the class that follows and register it: by `name`, `plan` and the command line know it."""

    def register(cls: type[P]) -> type[P]:
        return cast(type[P], PLANNERS.add(name, cls))

    return register


def registered_planners() -> Mapping[str, type[Planner]]:
    """The planners by their names: those of this package first, then of plugins and installed packages."""
    return MappingProxyType({name: PLANNERS[name] for name in PLANNERS})


def planner_class(name: str) -> type[Planner]:
    """The planner's class of that name; no other of the package's is imported. Raises SpecError for none."""
    return PLANNERS[name]


@dataclass(frozen=True)
class PlannerOption:
    """A field of a planner that the command line offers."""

    name: str  # of the field
    type: Any
    default: Any
    help: str
    flag: str  # --time-limit; of a field that is true by default what makes it false
    command_default: Any = None  # the command line's default, where it is another one


def planner_options(cls: type[Any]) -> tuple[PlannerOption, ...]:
    """The options that the command line offers of a planner: its fields that have a help."""
    hints = get_type_hints(cls)
    return tuple(_option(f, hints[f.name]) for f in fields(cls) if "help" in f.metadata)


def _option(f: dataclasses.Field[Any], hint: Any) -> PlannerOption:
    default = f.default if f.default_factory is MISSING else f.default_factory()
    flag = f.metadata.get("off") or f.name
    flag = "--" + flag.replace("_", "-")
    return PlannerOption(f.name, hint, default, f.metadata["help"], flag, f.metadata.get("command_default"))
