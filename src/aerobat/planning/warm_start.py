"""Warm starts of nonlinear programs: a trajectory, often of another planner, with its stages' times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.planning.passages import require_attitudes_at_ends
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

NEAR_PLANE = 0.05  # deviation from a plane, relative to a path's extent, up to which a path counts as planar


@dataclass(frozen=True, eq=False)
class WarmStart:
    """A trajectory with the times at which it passes stages."""

    trajectory: Trajectory
    stages: tuple[Stage, ...]  # in the order of their times
    times: tuple[float, ...]  # times of the stages [s], ascending

    @classmethod
    def of(cls, plan: Plan, sequence: StageSequence) -> WarmStart:
        """Return a plan's trajectory with the stages of a sequence in the order of the plan."""
        return cls.through(plan.trajectory, sequence.stages, [placed.time for placed in plan.stages])

    @classmethod
    def through(cls, trajectory: Trajectory, stages: Sequence[Stage], times: Sequence[float]) -> WarmStart:
        """Return a trajectory with stages at times [s], given in any order."""
        order = sorted(range(len(times)), key=times.__getitem__)
        return cls(trajectory, tuple(stages[i] for i in order), tuple(times[i] for i in order))

    @property
    def phases(self) -> Array:
        """The durations of the phases: start to first stage, between stages, last stage to end [s], (P,)."""
        return np.diff([0.0, *self.times, self.trajectory.duration])

    @property
    def at_stages(self) -> Array:
        """Position, velocity, acceleration and jerk at the stages, (stages, 4, 3)."""
        found = [[self.trajectory.evaluate(time, k) for k in range(4)] for time in self.times]
        return np.reshape(found, (-1, 4, 3))

    def leg_at(self, time: float) -> str:
        """Return words on the stages between which a time [s] lies; empty with fewer than two stages."""
        if len(self.stages) < 2:
            return ""
        names = ["the start", *(f"'{stage.name}'" for stage in self.stages), "the goal"]
        leg = int(np.searchsorted(self.times, time))
        return f", between {names[leg]} and {names[leg + 1]}"

    def time_scaled(self, factor: float) -> WarmStart:
        """Return the same path with its duration multiplied by a factor."""
        trajectory = replace(self.trajectory, durations=factor * self.trajectory.durations)
        return replace(self, trajectory=trajectory, times=tuple(factor * t for t in self.times))

    @property
    def extent(self) -> float:
        """The longest side of the bounding box of the path's knots [m]."""
        return float(np.ptp(self.trajectory.on_segments([0.0, 1.0]), axis=(0, 1)).max())

    def plane(self) -> Array | None:
        """Return the unit normal of the vertical plane in which the path nearly lies, (3,), or None."""
        points = self.trajectory.on_segments([0.0, 0.5, 1.0]).reshape(-1, 3)[:, :2]
        _, extents, directions = np.linalg.svd(points - points[0])
        if extents[1] > NEAR_PLANE * max(extents[0], self.extent):
            return None
        return np.array([*directions[1], 0.0])

    def bent(self, aside: Array) -> WarmStart:
        """Return the path with a smooth lateral displacement, `aside` [m], (3,), at half the duration."""
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
        """Return the path with each phase's duration scaled by its factor; derivatives jump at stages."""
        trajectory = self.trajectory
        middles = (trajectory.knots[:-1] + trajectory.knots[1:]) / 2.0
        durations = trajectory.durations * factors[np.searchsorted(self.times, middles)]
        times = np.cumsum(self.phases * factors)[:-1]
        return replace(self, trajectory=replace(trajectory, durations=durations), times=tuple(times.tolist()))


def flown_task(
    planner: str, problem: Problem, vehicle: Vehicle | None, reserve: float, clearance: float = 0.0
) -> Task:
    """Return the task of a problem with a vehicle whose attitude is determined at both ends.

    Raises SpecError without a vehicle, and for ends in free fall, whose attitude is undetermined.
    """
    if vehicle is None:
        raise SpecError(f"the {planner} planner needs a vehicle: no limits, no least time; give --vehicle")
    require_attitudes_at_ends(problem, vehicle)
    return Task.of(problem, vehicle, reserve, clearance)
