"""Custom control laws: their interface, and the register of laws by name.

A law computes the force and moment that the rotors shall produce. The surrounding loop does the rest for
every law: it mixes rotor commands within their limits (tilt before yaw), compensates the rotors' lag, and
corrects the reference by the disturbances that the IMU measures.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, TypeVar, cast, dataclass_transform

from pydantic import Field

from aerobat.declaration import FieldError, Label, shown, unknown_name, validated
from aerobat.errors import SpecError
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.ops import Ops, PerRotor, Scalar
from aerobat.kernels.rigid_body import Body, RotorWrench
from aerobat.registry import Registry, placed
from aerobat.vehicle.controller import Controller

# names of the tracking controller: with the vehicle's settings, and with the paper's
CONTROLLERS = ("full", "paper")
L = TypeVar("L", bound="ControlLaw")


class Seen(NamedTuple):
    """State, rotor thrusts and reference that a law knows at a tick."""

    body: Body  # estimated, at the time when the commands take effect; world, rates in body axes
    thrusts: PerRotor  # [N] rotor thrusts predicted by the nominal model
    reference: ReferencePoint  # world; its specific thrust is a + g e3, without drag


class ControlLaw(ABC):
    """A law from the known state to the force and the moment on the body.

    A custom law inherits from this class and is registered by `@controller("its-name")`. Its fields are its
    gains. `init` and `step` are written in kernel arithmetic: + - * / and comparisons of scalars, and the
    functions of `ops`, without `if` on values. Every engine can run such a law; the engine `floats` runs any
    code.
    """

    kind: ClassVar[str] = ""  # its name, set by the registration
    # whether the reference is corrected for disturbances; False for laws that reject them on their own
    TAKES_DISTURBANCES: ClassVar[bool] = True
    # whether the state has a `setpoint`, a RateSetpoint for an inner loop
    GIVES_RATES: ClassVar[bool] = False

    def init(self, ops: Ops, model: ControllerModel, seen: Seen) -> Any:
        """Return the state before the first tick, a tree of tuples; by default empty.

        Args:
            ops: The arithmetic of the engine.
            model: The nominal vehicle: its mass properties and rotors, and the environment.
            seen: State, rotor thrusts and reference at the first tick.
        """
        return ()

    @abstractmethod
    def step(
        self, ops: Ops, model: ControllerModel, state: Any, seen: Seen, elapsed: Scalar
    ) -> tuple[Any, RotorWrench]:
        """Return the state at a tick, and the required thrust [N] and moment [N·m, body].

        Args:
            ops: The arithmetic of the engine.
            model: The nominal vehicle: its mass properties and rotors, and the environment.
            state: The law's state after the last tick.
            seen: State, rotor thrusts and reference at this tick.
            elapsed: Time since the last tick [s].
        """


CONTROL_LAWS: Registry[ControlLaw] = Registry(
    ControlLaw,  # type: ignore[type-abstract]
    "controller",
    "aerobat.controllers",
    {name: f"aerobat.control.laws.{name}" for name in ("lee", "lqr", "indi", "rates")},
)


@validated
@dataclass_transform(frozen_default=True, field_specifiers=(Field,))
def controller(name: Label) -> Callable[[type[L]], type[L]]:
    """Declare the class that follows and register it by `name` for flights and the command line.

    SpecError is raised for a name that another controller has.
    """

    def register(cls: type[L]) -> type[L]:
        if name in CONTROLLERS:
            raise SpecError(f"controller '{name}' comes with Aerobat; give the class another name")
        return cast("type[L]", CONTROL_LAWS.add(name, cls))

    return register


def named_controller(
    name: str,
    own: Controller = Controller(),  # noqa: B008 - frozen
) -> Controller | ControlLaw:
    """Return the controller of a name: full or paper, with the gains of `own`, or a law with its own gains.

    SpecError, with the closest name, is raised for an unknown name.
    """
    if name == "full":
        return own
    if name == "paper":
        return replace(own, disturbance_filter=0.0, **Controller.paper().feature_flags._asdict())
    if name not in tuple(CONTROL_LAWS):
        raise unknown_name("controller", name, (*CONTROLLERS, *CONTROL_LAWS))
    law = CONTROL_LAWS[name]
    try:
        return law()
    except SpecError as error:
        wanting = SpecError(f"controller '{name}' is flown at the defaults of its gains: {error}")
        raise placed(wanting, law.step) from None


def as_controller(value: Any) -> Controller | ControlLaw | str | None:
    """Return a valid controller argument of a flight. Raise FieldError for anything else."""
    if isinstance(value, str):
        named_controller(value)
    elif value is not None and not isinstance(value, Controller | ControlLaw):
        raise FieldError("", f"must be a Controller, a ControlLaw or the name of one, got {shown(value)}")
    return cast("Controller | ControlLaw | str | None", value)
