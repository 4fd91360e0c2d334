"""A plan as far as flying goes: what a trajectory alone does not say, its vehicle and its environment."""

from __future__ import annotations

from typing import Annotated, Any, Protocol, runtime_checkable

from pydantic import Field

from aerobat.declaration import AS_IT_IS
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.trajectory import HasTrajectory, Trajectory
from aerobat.vehicle.files import as_vehicle
from aerobat.vehicle.vehicle import Vehicle


@runtime_checkable
class Flyable(HasTrajectory, Protocol):
    """A plan as far as flying goes."""

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle it was planned for."""

    @property
    def problem(self) -> Any:
        """The problem it solves, with its environment."""


Planned = Annotated[Flyable, AS_IT_IS, Field(description="plan")]


def environment_of(flown: Flyable | Trajectory, environment: Environment | None) -> Environment:
    """The environment given, else a plan's, else a calm day on Earth."""
    if environment is not None:
        return environment
    if isinstance(flown, Trajectory):
        return Environment()
    found: Environment = flown.problem.surroundings
    return found


def vehicle_of(flown: Flyable | Trajectory, vehicle: Vehicle | str | None) -> Vehicle:
    """The vehicle given, else a plan's. Raises SpecError where there is none."""
    if vehicle is not None:
        return as_vehicle(vehicle)
    own = None if isinstance(flown, Trajectory) else flown.vehicle
    if own is None:
        raise SpecError(
            "vehicle is missing: a path, or a plan without one, says not what flies it; give vehicle="
        )
    return own
