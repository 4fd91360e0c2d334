"""Constraint violations of a path on dense samples, including those between the places of a program."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason
from aerobat.limits.limit import Limit
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.spline import DERIVATIVES, chebyshev
from aerobat.trajectory import Trajectory

SAMPLES = 64  # samples of a segment
JUST_INSIDE = 1e-9  # distance of samples from knots, as a fraction of a segment, to stay in that segment
INWARD = 0.02  # fraction of a segment at either end without peaks: places are dense there, motion is slow
NEGLIGIBLE = 1e-9  # constraint violation, relative to the limit's size, that counts as none


@dataclass(frozen=True, eq=False)
class ConstraintViolation:
    """The largest constraint values of a path, as fractions of their limits' sizes; negative: satisfied."""

    worst: Array  # largest value of each constraint in each segment, (S, c)
    sides: tuple[tuple[Limit, float], ...]  # limit and end of each constraint
    place: tuple[int, float]  # the constraint that is violated most, and the time [s]
    peaks: Array  # fraction of each segment with its largest value, without samples near the ends, (S,)

    @classmethod
    def of(cls, trajectory: Trajectory, limits: LimitValues, places: int = SAMPLES) -> ConstraintViolation:
        """Return the constraint violations along a trajectory, the reserve included.

        Args:
            trajectory: The path.
            limits: The limits along the path.
            places: Samples of a segment.
        """
        fractions = np.clip(chebyshev(places), JUST_INSIDE, 1.0 - JUST_INSIDE)
        each = [trajectory.on_segments(fractions, k) for k in range(DERIVATIVES)]
        derivatives = np.stack(each, axis=2).reshape(-1, DERIVATIVES, 3)
        times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * fractions
        values = limits.values(derivatives, limits.frames(times.ravel(), derivatives))
        values += limits.reserve
        values = values.reshape(trajectory.segments, places, -1)
        at_start, at_goal = limits.at_ends
        values[0, 0, at_start] = values[-1, -1, at_goal] = -1.0
        segment, place, side = np.unravel_index(int(np.argmax(values)), values.shape)
        inside = np.flatnonzero((fractions > INWARD) & (fractions < 1.0 - INWARD))
        peaks = fractions[inside[np.argmax(values[:, inside].max(axis=2), axis=1)]]
        return cls(values.max(axis=1), limits.sides, (int(side), float(times[segment, place])), peaks)

    @property
    def largest(self) -> float:
        """The largest constraint value."""
        return float(self.worst.max())

    @property
    def holds(self) -> bool:
        """True if no constraint is violated."""
        return self.largest <= NEGLIGIBLE

    @property
    def reason(self) -> Reason:
        """A sentence, without its full stop, about the largest violation."""
        side, time = self.place
        limit, sign = self.sides[side]
        return limit.exceeded(self.largest, time, (limit.fields[sign > 0.0],))

    @property
    def nearby(self) -> Array:
        """The largest values in each segment and its neighbours, where repaired violations move, (S, c).

        Limits of one name count as one, such as those of all rotors: violations move between rotors.
        """
        names = np.array([limit.name for limit, _ in self.sides])
        alike = np.equal.outer(names, names)
        shared = np.where(alike, self.worst[:, None], -np.inf).max(axis=-1)
        beside = np.pad(shared, ((1, 1), (0, 0)), mode="edge")
        return np.asarray(np.max([beside[:-2], beside[1:-1], beside[2:]], axis=0))
