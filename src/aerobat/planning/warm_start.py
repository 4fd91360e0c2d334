"""A plan of another planner as the first guess of an optimal control: its phases, its motion, its plane."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.planning.result import Plan
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory

FLAT = 1e-6  # of its extent: how far a path may leave a plane and still be in it


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
        return cls(plan.trajectory, tuple(sequence.stages[i] for i in order), tuple(times[i] for i in order))

    @property
    def phases(self) -> Array:
        """From the start to the first stage, ..., from the last to the end [s], (P,)."""
        return np.diff([0.0, *self.times, self.trajectory.duration])

    def time_scaled(self, factor: float) -> WarmStart:
        """The same path, flown longer by a factor."""
        trajectory = replace(self.trajectory, durations=factor * self.trajectory.durations)
        return replace(self, trajectory=trajectory, times=tuple(factor * t for t in self.times))

    def allocate_intervals(self, intervals: int, least: int) -> tuple[int, ...]:
        """About so many intervals, shared among phases by their durations, each given the least or more."""
        share = np.rint(intervals * self.phases / self.trajectory.duration).astype(int)
        return tuple(np.maximum(share, least).tolist())

    def plane(self) -> Array | None:
        """The normal of the vertical plane that it stays in, (3,); None when it stays in none."""
        across = self.trajectory.coefficients[..., :2].reshape(-1, 2) - self.trajectory.coefficients[0, 0, :2]
        _, extents, directions = np.linalg.svd(across)
        if extents[1] > FLAT * max(extents[0], FLAT):
            return None
        return np.array([*directions[1], 0.0])
