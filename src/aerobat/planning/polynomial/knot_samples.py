"""Where polynomials exceed limits between samples, and the polynomials that a plan is refitted by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.flatness import reference
from aerobat.planning.polynomial.knot_bounds import Bound
from aerobat.planning.polynomial.knot_variables import END_ORDER
from aerobat.trajectory import Trajectory, polynomial
from aerobat.vehicle import Vehicle

DENSE = 81  # places in a segment that are looked at
JUST_INSIDE = 1e-9  # of a duration from its knots, where a segment is still itself and not its neighbour
APART = 1e-4  # of a duration, the least distance of samples

Samples = tuple[Array, ...]  # normalised times in each segment, rising


@dataclass(frozen=True, eq=False)
class ConstraintViolation:
    """By how much a trajectory exceeds limits, and where."""

    worst: float  # as a fraction of the limit's range; negative: all hold
    peaks: Samples  # where more is exceeded than beside it

    @classmethod
    def of(
        cls, trajectory: Trajectory, vehicle: Vehicle, environment: Environment, bounds: tuple[Bound, ...]
    ) -> ConstraintViolation:
        """Of rotor thrusts and of bounds along a trajectory."""
        s = np.linspace(0.0, 1.0, DENSE)
        over = [_rotors(trajectory, vehicle, environment, s)]
        over += [bound.excess(trajectory.on_segments(s, bound.derivative)) / bound.scale for bound in bounds]
        values = np.max(over, axis=0)
        neighbours = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
        peaks = (values > 0.0) & (values >= neighbours[:, :-2]) & (values >= neighbours[:, 2:])
        return cls(float(values.max()), tuple(s[p] for p in peaks))

    def add_counterexample(self, trajectory: Trajectory, time: float, excess: float) -> ConstraintViolation:
        """The same, and an excess, a fraction of its limit's range, at a time [s] where all seemed well."""
        peaks = list(self.peaks)
        i = int(np.searchsorted(trajectory.knots[1:-1], time, side="right"))
        place = np.clip((time - trajectory.knots[i]) / trajectory.durations[i], 0.0, 1.0)
        peaks[i] = np.append(peaks[i], place)
        return replace(self, worst=max(self.worst, excess), peaks=tuple(peaks))

    def joined(self, samples: Samples) -> Samples:
        """Samples, and the peaks that are not among them."""
        return tuple(_with(old, new) for old, new in zip(samples, self.peaks, strict=True))


def refit(trajectory: Trajectory, segments: int) -> Trajectory:
    """So many polynomials of degree 9, which meet a trajectory at their knots up to snap.

    Its own knots are kept, and its longest segments cut; if it has more segments than that, all are equal.
    """
    if trajectory.segments == segments and trajectory.degree == 2 * END_ORDER - 1:
        return trajectory
    durations = np.full(segments, trajectory.duration / segments)
    if trajectory.segments <= segments:
        parts = np.ones(trajectory.segments, dtype=int)
        while parts.sum() < segments:
            parts[np.argmax(trajectory.durations / parts)] += 1
        durations = np.repeat(trajectory.durations / parts, parts)
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    inside = np.stack([knots[:-1], knots[1:] - JUST_INSIDE * durations])
    ends = np.stack([trajectory.evaluate(inside, k) for k in range(END_ORDER)], axis=2)
    ends *= (durations[:, None] ** np.arange(END_ORDER))[..., None]
    return Trajectory(durations, polynomial.hermite(ends[0], ends[1]), trajectory.heading)


def _rotors(trajectory: Trajectory, vehicle: Vehicle, environment: Environment, s: Array) -> Array:
    """The excess of the worst rotor's thrust at normalised times s (n,) of every segment, (S, n)."""
    inside = np.clip(s, JUST_INSIDE, 1.0 - JUST_INSIDE)
    times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * inside
    thrusts = reference(trajectory, vehicle, times.ravel(), environment=environment).rotor_thrusts
    low, high = vehicle.min_thrusts, vehicle.max_thrusts
    over = np.maximum(low - thrusts, thrusts - high) / (high - low)
    return np.asarray(over.max(axis=1).reshape(times.shape))


def _with(old: Array, new: Array) -> Array:
    """Both, without those of the new that are next to an old one."""
    far = np.abs(new[:, None] - old).min(axis=1) > APART
    return np.union1d(old, new[far])
