"""Warm starts of nonlinear programs: a plan of another planner, with its phases and its path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.flatness.references import UNDETERMINED
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

NEAR_PLANE = 0.05  # of its extent, by which a path may leave a plane and still be bent out of it


@dataclass(frozen=True, eq=False)
class WarmStart:
    """A trajectory, and when it passes a sequence's stages."""

    trajectory: Trajectory
    stages: tuple[Stage, ...]  # in the order of their times
    times: tuple[float, ...]  # [s] of the stages, rising

    @classmethod
    def of(cls, plan: Plan, sequence: StageSequence) -> WarmStart:
        """A plan's trajectory, and the order of the sequence's stages in it if it leaves that open."""
        return cls.through(plan.trajectory, sequence.stages, [placed.time for placed in plan.stages])

    @classmethod
    def through(cls, trajectory: Trajectory, stages: Sequence[Stage], times: Sequence[float]) -> WarmStart:
        """A trajectory through stages at times [s] in any order."""
        order = sorted(range(len(times)), key=times.__getitem__)
        return cls(trajectory, tuple(stages[i] for i in order), tuple(times[i] for i in order))

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

    @property
    def extent(self) -> float:
        """The longest side of the box around the ends of the path's segments [m]."""
        return float(np.ptp(self.trajectory.on_segments([0.0, 1.0]), axis=(0, 1)).max())

    def plane(self) -> Array | None:
        """The unit normal of the vertical plane that the path nearly stays in, (3,); None of others."""
        points = self.trajectory.on_segments([0.0, 0.5, 1.0]).reshape(-1, 3)[:, :2]
        _, extents, directions = np.linalg.svd(points - points[0])
        if extents[1] > NEAR_PLANE * max(extents[0], self.extent):
            return None
        return np.array([*directions[1], 0.0])

    def bent(self, aside: Array) -> WarmStart:
        """The same path moved aside halfway, less before and after, by a vector [m], (3,)."""
        trajectory = self.trajectory
        bump = Polynomial([0.0, 0.0, 16.0, -32.0, 16.0])  # 16 s² (1 − s)², one halfway
        begins = trajectory.knots[:-1] / trajectory.duration
        lengths = trajectory.durations / trajectory.duration
        pieces = [bump(Polynomial([s, h])).coef for s, h in zip(begins, lengths, strict=True)]
        moved = np.asarray(pieces, dtype=float)[..., None] * aside
        powers = max(trajectory.coefficients.shape[1], moved.shape[1])
        coefficients = np.zeros((trajectory.segments, powers, 3))
        for part in (trajectory.coefficients, moved):
            coefficients[:, : part.shape[1]] += part
        return replace(self, trajectory=replace(trajectory, coefficients=coefficients))

    def at_other_pace(self, factors: Array) -> WarmStart:
        """The same path with each phase longer by a factor; its derivatives jump where phases meet."""
        trajectory = self.trajectory
        middles = (trajectory.knots[:-1] + trajectory.knots[1:]) / 2.0
        durations = trajectory.durations * factors[np.searchsorted(self.times, middles)]
        times = np.cumsum(self.phases * factors)[:-1]
        return replace(self, trajectory=replace(trajectory, durations=durations), times=tuple(times.tolist()))


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
