"""Warm starts of nonlinear programs: a plan of another planner, with its phases, its path and its plane."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.flatness.references import UNDETERMINED
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

PLANARITY_TOLERANCE = 1e-6  # of its extent: how far a path may leave a plane and still be in it
# of a limit's range, kept from either of its ends for the controller
Reserve = Annotated[float, Field(ge=0, lt=0.5)]
Clearance = Annotated[float, Field(ge=0)]  # [m] kept from obstacles for the controller
CLEARANCE = (
    "The distance in metres that the body keeps from obstacles for the controller, less where a passage is "
    "narrow, and that paths keep inside the radius of waypoints, a tenth of it at most."
)
MIN_INTERVALS = 4  # of a phase of a motion that is collocated


@dataclass(frozen=True, eq=False)
class WarmStart:
    """A trajectory, and when it passes a sequence's stages."""

    trajectory: Trajectory
    stages: tuple[Stage, ...]  # in the order of their times
    times: tuple[float, ...]  # [s] of the stages, rising

    @classmethod
    def of(cls, plan: Plan, sequence: StageSequence) -> WarmStart:
        """A plan's trajectory, and the order of the sequence's stages in it if it leaves that open."""
        times = [placed.time for placed in plan.stages]
        order = sorted(range(len(times)), key=times.__getitem__)
        stages = tuple(sequence.stages[i] for i in order)
        return cls(plan.trajectory, stages, tuple(times[i] for i in order))

    @property
    def phases(self) -> Array:
        """From the start to the first stage, ..., from the last to the end [s], (P,)."""
        return np.diff([0.0, *self.times, self.trajectory.duration])

    def leg_at(self, time: float) -> str:
        """In words between which of several stages a time [s] lies; nothing of one or none."""
        if len(self.stages) < 2:
            return ""
        names = ["the start", *(f"'{stage.name}'" for stage in self.stages), "the goal"]
        leg = int(np.searchsorted(self.times, time))
        return f", between {names[leg]} and {names[leg + 1]}"

    def time_scaled(self, factor: float) -> WarmStart:
        """The same path, flown longer by a factor."""
        trajectory = replace(self.trajectory, durations=factor * self.trajectory.durations)
        return replace(self, trajectory=trajectory, times=tuple(factor * t for t in self.times))

    def allocate_intervals(self, intervals: int, minimum: int) -> tuple[int, ...]:
        """About so many intervals, allocated to phases by their durations, to each at least the minimum."""
        counts = np.rint(intervals * self.phases / self.trajectory.duration).astype(int)
        return tuple(np.maximum(counts, minimum).tolist())

    def plane(self) -> Array | None:
        """The normal of the vertical plane that it stays in, (3,); None when it stays in none."""
        across = self.trajectory.coefficients[..., :2].reshape(-1, 2) - self.trajectory.coefficients[0, 0, :2]
        _, extents, directions = np.linalg.svd(across)
        if extents[1] > PLANARITY_TOLERANCE * max(extents[0], PLANARITY_TOLERANCE):
            return None
        return np.array([*directions[1], 0.0])


def flown_task(
    planner: str, problem: Problem, vehicle: Vehicle | None, reserve: float, clearance: float = 0.0
) -> Task:
    """The task for a vehicle whose attitude is determined at both ends.

    Raises SpecError where there is no vehicle, and for ends in free fall, whose attitude is open.
    """
    if vehicle is None:
        raise SpecError(f"the {planner} planner needs a vehicle: no limits, no least time; give --vehicle")
    task = Task.of(problem, vehicle, reserve, clearance)
    for name, state in problem.ends.items():
        thrust = task.balance.specific_thrust(state.velocity, state.acceleration)
        if np.linalg.norm(thrust) < UNDETERMINED * problem.environment.gravity:
            raise SpecError(
                f"{name}.acceleration asks no thrust, which leaves the attitude there open; change it"
            )
    return task
