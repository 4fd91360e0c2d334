"""By how much a path exceeds its limits, looked at densely: what places in a program leave between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason
from aerobat.limits.limit import Limit
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.spline import DERIVATIVES
from aerobat.trajectory import Trajectory

LOOKED_AT = 64  # places of a segment
JUST_INSIDE = 1e-9  # of a duration from its knots, where a segment is still itself and not its neighbour
INWARD = 0.02  # of a segment, the ends that have no peaks: places are dense there, and motion stands still
NEGLIGIBLE = 1e-9  # of a limit's size


@dataclass(frozen=True, eq=False)
class Excess:
    """The constraints of a path at their worst, as fractions of their limits' sizes; negative: they hold."""

    worst: Array  # in each segment, (S, c)
    sides: tuple[tuple[Limit, float], ...]  # of each constraint
    place: tuple[int, float]  # the constraint that is exceeded most, and when [s]
    peaks: Array  # the fraction of each segment at which its worst is, its ends left out, (S,)

    @classmethod
    def of(cls, trajectory: Trajectory, limits: LimitValues, places: int = LOOKED_AT) -> Excess:
        """Along a trajectory.

        Args:
            trajectory: The path.
            limits: What holds along it, the reserve included.
            places: Of a segment.
        """
        fractions = np.clip(chebyshev(places), JUST_INSIDE, 1.0 - JUST_INSIDE)
        each = [trajectory.on_segments(fractions, k) for k in range(DERIVATIVES)]
        derivatives = np.stack(each, axis=2).reshape(-1, DERIVATIVES, 3)
        times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * fractions
        values = limits.values(derivatives, limits.frames(times.ravel(), derivatives))
        values += limits.reserve
        values = values.reshape(trajectory.segments, places, -1)
        if not limits.task.stages.closed:
            values[0, 0, limits.at_ends] = values[-1, -1, limits.at_ends] = -1.0
        segment, place, side = np.unravel_index(int(np.argmax(values)), values.shape)
        inside = np.flatnonzero((fractions > INWARD) & (fractions < 1.0 - INWARD))
        peaks = fractions[inside[np.argmax(values[:, inside].max(axis=2), axis=1)]]
        return cls(values.max(axis=1), limits.sides, (int(side), float(times[segment, place])), peaks)

    @property
    def largest(self) -> float:
        """The largest of all."""
        return float(self.worst.max())

    @property
    def holds(self) -> bool:
        """True if nothing is exceeded."""
        return self.largest <= NEGLIGIBLE

    @property
    def reason(self) -> Reason:
        """One sentence without its full stop about what is exceeded most."""
        side, time = self.place
        limit, sign = self.sides[side]
        return limit.exceeded(self.largest, time, (limit.fields[sign > 0.0],))

    @property
    def nearby(self) -> Array:
        """The worst in each segment and those beside it, where it moves when it is mended, (S, c).

        Rotors count as one: they trade what they exceed.
        """
        names = np.array([limit.name for limit, _ in self.sides])
        alike = np.equal.outer(names, names)
        shared = np.where(alike, self.worst[:, None], -np.inf).max(axis=-1)
        beside = np.pad(shared, ((1, 1), (0, 0)), mode="edge")
        return np.asarray(np.max([beside[:-2], beside[1:-1], beside[2:]], axis=0))


def chebyshev(count: int) -> Array:
    """So many places in a segment, denser toward its ends, which are among them."""
    return np.asarray((1.0 - np.cos(np.linspace(0.0, np.pi, count))) / 2.0)
