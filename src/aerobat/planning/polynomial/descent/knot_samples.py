"""Where polynomials exceed limits between samples, and the polynomials that a plan is refitted by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Reason
from aerobat.limits import Limit
from aerobat.planning.polynomial.descent.path_limits import END_ORDER, PathLimits, Samples
from aerobat.trajectory import Trajectory, polynomial

SAMPLES = 80  # of all segments together at first
MIN_SAMPLES = 16  # of each: more than a polynomial of degree 9 needs
GATE_SAMPLES = 24  # the same of paths through gates, about which the body turns sharply
END_SAMPLES = 32  # of the first and the last of many: between rest and full thrust the body turns at once
NEARBY = 2  # segments on either side: few of many, all of four
DENSE = 81  # places in a segment that are looked at
JUST_INSIDE = 1e-9  # of a duration from its knots, where a segment is still itself and not its neighbour
APART = 1e-4  # of a duration, the least distance of samples


@dataclass(frozen=True, eq=False)
class ConstraintViolation:
    """By how much a trajectory exceeds limits, where, and which most."""

    excess: Array  # in each segment, as a fraction of each limit's range; negative: it holds, (S, size)
    limit: Limit  # that is exceeded most
    time: float  # [s] when
    peaks: Samples  # normalised times in each segment at which a limit is exceeded more than beside them

    @classmethod
    def of(cls, trajectory: Trajectory, limits: PathLimits, reserve: float = 0.0) -> ConstraintViolation:
        """Of limits along a trajectory, the vehicle's less a reserve, at a dense look."""
        s = _chebyshev(DENSE)
        inside = np.clip(s, JUST_INSIDE, 1.0 - JUST_INSIDE)
        values = limits.excess(trajectory, (inside,) * trajectory.segments, reserve)
        neighbours = np.pad(values, ((0, 0), (0, 0), (1, 1)), constant_values=-np.inf)
        peaks = (values > 0.0) & (values >= neighbours[..., :-2]) & (values >= neighbours[..., 2:])
        segment, row, place = np.unravel_index(np.argmax(values), values.shape)
        kinds = np.array([_kind(limit) for limit in limits.all])
        alike = np.equal.outer(kinds, kinds)
        excess = np.where(alike, values.max(axis=2)[:, None], -np.inf).max(axis=-1)
        return cls(
            excess=excess,
            limit=limits.all[row],
            time=float(trajectory.knots[segment] + s[place] * trajectory.durations[segment]),
            peaks=tuple(s[p.any(axis=0)] for p in peaks),
        )

    @property
    def worst(self) -> float:
        """The largest excess."""
        return float(self.excess.max())

    @property
    def excess_nearby(self) -> Array:
        """The largest in each segment and those near it, where it moves when it is mended, (S, size)."""
        beside = np.pad(self.excess, ((NEARBY, NEARBY), (0, 0)), constant_values=-np.inf)
        windows = np.lib.stride_tricks.sliding_window_view(beside, 2 * NEARBY + 1, axis=0)
        return np.asarray(windows.max(axis=-1))

    @property
    def reason(self) -> Reason:
        """One sentence without its full stop."""
        return self.limit.exceeded(self.worst, self.time)

    def add_counterexample(self, trajectory: Trajectory, time: float) -> ConstraintViolation:
        """The same, and a time [s] at which a limit is exceeded where all seemed well."""
        peaks = list(self.peaks)
        i = int(np.searchsorted(trajectory.knots[1:-1], time, side="right"))
        place = np.clip((time - trajectory.knots[i]) / trajectory.durations[i], 0.0, 1.0)
        peaks[i] = np.append(peaks[i], place)
        return replace(self, peaks=tuple(peaks))

    def joined(self, samples: Samples) -> Samples:
        """Samples, and the peaks that are not among them."""
        return tuple(_with(old, new) for old, new in zip(samples, self.peaks, strict=True))


def chebyshev_samples(segments: int, least: int = MIN_SAMPLES) -> Samples:
    """The first samples, so many of a segment at least: denser toward its knots, where it varies most."""
    inner = max(ceil(SAMPLES / segments), least)
    ends = END_SAMPLES if inner == least else inner
    counts = [inner if 0 < i < segments - 1 else ends for i in range(segments)]
    return tuple(map(_chebyshev, counts))


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


def _kind(limit: Limit) -> str:
    """A name that rotors share, which trade what they exceed."""
    return limit.name if limit.rotor is None else "rotors"


def _chebyshev(count: int) -> Array:
    """So many places in a segment, denser toward its ends, which are among them."""
    return np.asarray((1.0 - np.cos(np.linspace(0.0, np.pi, count))) / 2.0)


def _with(old: Array, new: Array) -> Array:
    """Both, without those of the new that are next to an old one, and what is half-way on either side.

    A peak that is held down at one place comes up beside it.
    """
    after = np.clip(np.searchsorted(old, new), 1, len(old) - 1)
    beside = [(new + old[neighbour]) / 2.0 for neighbour in (after - 1, after)]
    new = np.concatenate([new, *beside])
    far = np.abs(new[:, None] - old).min(axis=1) > APART
    return np.union1d(old, new[far])
