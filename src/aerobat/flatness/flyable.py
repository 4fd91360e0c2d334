"""The part of a plan that flying needs besides the trajectory: its vehicle and its environment."""

from __future__ import annotations

from typing import Annotated, Any, Protocol, runtime_checkable

from pydantic import Field

from aerobat.declaration import AS_IT_IS
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.trajectory.piecewise import HasTrajectory, Trajectory
from aerobat.vehicle.files import as_vehicle
from aerobat.vehicle.vehicle import Vehicle


@runtime_checkable
class Flyable(HasTrajectory, Protocol):
    """A plan, as far as flying needs it."""

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle that the plan was made for."""

    @property
    def problem(self) -> Any:
        """The problem that the plan solves, with its environment."""


Planned = Annotated[Flyable, AS_IT_IS, Field(description="plan")]


def environment_of(flown: Flyable | Trajectory, environment: Environment | None) -> Environment:
    """Return the given environment, else a plan's, else a calm day on Earth."""
    if environment is not None:
        return environment
    if isinstance(flown, Trajectory):
        return Environment()
    found: Environment = flown.problem.surroundings
    return found


def vehicle_of(flown: Flyable | Trajectory, vehicle: Vehicle | str | None) -> Vehicle:
    """Return the given vehicle, else a plan's. Raise SpecError where there is none."""
    if vehicle is not None:
        return as_vehicle(vehicle)
    own = None if isinstance(flown, Trajectory) else flown.vehicle
    if own is None:
        raise SpecError(
            "vehicle is missing: a path, or a plan without one, says not what flies it; give vehicle="
        )
    return own
