"""Whatever has a trajectory, such as a plan, and may stand for it."""

from __future__ import annotations

from typing import Annotated, Protocol, runtime_checkable

from pydantic import Field

from aerobat.declaration import AS_IT_IS
from aerobat.trajectory.piecewise import Trajectory


@runtime_checkable
class HasTrajectory(Protocol):
    """A plan as far as its path goes."""

    @property
    def trajectory(self) -> Trajectory:
        """The trajectory."""


Carrier = Annotated[HasTrajectory, AS_IT_IS, Field(description="plan")]


def as_trajectory(flown: Trajectory | HasTrajectory) -> Trajectory:
    """The trajectory, of itself or of a plan."""
    return flown if isinstance(flown, Trajectory) else flown.trajectory
