"""Rows of a path: derivatives of its position at instants, and the trajectory through them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.interchange.number_table import NAMES, named_columns
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.trajectory.piecewise import MAX_DURATION
from aerobat.trajectory.polynomial import hermite

PATH = ("position", "velocity", "acceleration", "jerk")
CONTINUOUS = len(PATH) + 1  # the highest derivative that is continuous at rows, the fifth
SHORT_STEP = 0.2  # of the usual step; derivatives over a last step that is shorter are rounding errors
DENSE_STEP = 6e-3  # [s] between rows, a little more than at 200 Hz
REDUNDANT = 1e-7  # [m] error of a path without every second row, below which these rows are left out


@dataclass(frozen=True, eq=False)
class PathRows:
    """The derivatives of a position at instants."""

    knots: Array  # [m/s^d] position to jerk, world, (rows, 4, 3); NaN for a missing derivative
    steps: Array  # [s] from row to row, (rows - 1,)
    attitude: Array | None = None  # body to world at the first row, (4,)
    unused: tuple[str, ...] = ()  # other content of the file, in words
    timed: bool = True  # whether the rows have times of their own

    @cached_property
    def trajectory(self) -> Trajectory:
        """The path with all derivatives of every row, continuous up to its fifth derivative.

        Where derivatives are missing, this is the path of minimum snap. Its heading is that of the attitude.
        Raises SpecError for numbers that are too large.
        """
        rows = self._without_repeats
        path = self._through(rows.knots, rows.steps)
        return Trajectory(path.durations, path.coefficients, self._heading(path))

    @property
    def fit_error(self) -> float | None:
        """The largest distance [m] of the path through every second row from the other rows.

        Its steps are twice as long, so it errs by more than the path through all rows does between them.
        None for fewer than five rows, or where every second row does not determine a path.
        """
        rows = len(self.knots) - (len(self.knots) + 1) % 2
        kept = self.knots[:rows:2]
        if rows < 5 or _known_numbers(kept) < len(PATH):
            return None
        times = np.concatenate([[0.0], np.cumsum(self.steps)])[:rows]
        missed = self._through(kept, np.diff(times[::2])).evaluate(times[1::2]) - self.knots[1:rows:2, 0]
        return float(np.linalg.norm(missed, axis=1).max())

    @property
    def _without_repeats(self) -> PathRows:
        """Every second row, and every second of these, as long as the path through them meets the others.

        Between dense rows, the high derivatives of a path would be those of rounding errors.
        """
        error = None if np.median(self.steps) > DENSE_STEP or np.isnan(self.knots).any() else self.fit_error
        if error is None or not error < REDUNDANT:
            return self
        kept = np.unique(np.append(np.arange(0, len(self.knots), 2), len(self.knots) - 1))
        times = np.concatenate([[0.0], np.cumsum(self.steps)])
        return PathRows(self.knots[kept], np.diff(times[kept]))._without_repeats

    @staticmethod
    def _through(knots: Array, steps: Array) -> Trajectory:
        if np.isnan(knots).any():
            known = _known_numbers(knots)
            if known < len(PATH):
                raise SpecError(
                    f"{len(knots)} rows give {known} numbers along an axis, a path takes {len(PATH)}; "
                    "give more rows, or velocities too"
                )
            return minimum_effort(knots, steps)
        if len(steps) > 1 and steps[-1] < SHORT_STEP * np.median(steps):
            knots, steps = np.delete(knots, -2, axis=0), np.append(steps[:-2], steps[-2:].sum())
        with np.errstate(over="ignore", invalid="ignore"):
            if len(steps) > 1:
                knots = np.concatenate([knots, _snaps(knots, steps)[:, None]], axis=1)
            if not np.isfinite(knots).all():
                raise SpecError("the rows hold numbers that are too large; give SI units")
            scaled = steps[:, None, None] ** np.arange(knots.shape[1])[:, None]
            return Trajectory(steps, hermite(scaled * knots[:-1], scaled * knots[1:]))

    def _heading(self, path: Trajectory) -> float:
        """Return the turn about the thrust [rad] in the first attitude, without drag."""
        thrust = path.evaluate(0.0, 2) + Environment().weight
        if self.attitude is None or not np.linalg.norm(thrust) > 0.0:
            return 0.0
        upright = so3.smallest_rotation(so3.UP, thrust / np.linalg.norm(thrust))
        return float(so3.twist(upright, self.attitude))


def _known_numbers(knots: Array) -> int:
    """Return the number of known derivatives of rows (rows, 4, 3) along the axis with the fewest."""
    return int(np.sum(~np.isnan(knots), axis=(0, 1)).min())


def _snaps(knots: Array, steps: Array) -> Array:
    """Return the snaps at rows (rows, 4, 3) with which the fifth derivative is continuous, (rows, 3).

    The snaps at both ends are those of the polynomials through the three rows there.
    """
    from scipy.linalg import solve_banded

    unit = np.eye(2 * CONTINUOUS)
    coefficients = hermite(unit[:CONTINUOUS], unit[CONTINUOUS:])  # by the derivatives at both ends
    powers = coefficients[CONTINUOUS:]
    at_left = math.factorial(CONTINUOUS) * powers[0]
    at_right = np.array([math.perm(CONTINUOUS + k, CONTINUOUS) for k in range(CONTINUOUS)]) @ powers
    scaled = steps[:, None, None] ** np.arange(len(PATH))[:, None]
    ends = np.concatenate([scaled * knots[:-1], scaled * knots[1:]], axis=1)
    known = [*range(len(PATH)), *range(CONTINUOUS, CONTINUOUS + len(PATH))]
    left, right = (
        np.tensordot(ends, weights[known], (1, 0)) / steps[:, None] ** CONTINUOUS
        for weights in (at_left, at_right)
    )
    system, target = np.zeros((3, len(knots))), np.zeros((len(knots), 3))
    system[1, [0, -1]] = 1.0
    target[0] = _snap(knots[:3], np.array([0.0, *np.cumsum(steps[:2])]))
    target[-1] = _snap(knots[:-4:-1], -np.array([0.0, *np.cumsum(steps[:-3:-1])]))
    before, after = 1.0 / steps[:-1], 1.0 / steps[1:]
    system[2, :-2] = at_right[CONTINUOUS - 1] * before
    system[1, 1:-1] = at_right[-1] * before - at_left[CONTINUOUS - 1] * after
    system[0, 2:] = -at_left[-1] * after
    target[1:-1] = left[1:] - right[:-1]
    return np.asarray(solve_banded((1, 1), system, target, check_finite=False))


def _snap(knots: Array, times: Array) -> Array:
    """Return the snap at the first of three rows (3, 4, 3) of the polynomial through them, (3,)."""
    size, orders = np.abs(times).max(), np.arange(len(PATH))
    table = np.array(
        [
            [math.perm(p, k) * (t / size) ** max(p - k, 0) for p in range(knots[..., 0].size)]
            for t in times.tolist()
            for k in range(len(PATH))
        ]
    )
    values = (knots * size ** orders[:, None]).reshape(-1, 3)
    return np.asarray(np.linalg.solve(table, values)[4] * math.factorial(4) / size**4)


def rows_of_columns(text: str, rate: float) -> PathRows:
    """Return the rows of a table with a header; unknown columns are ignored.

    Raises SpecError, naming the line or the column, for a text without such a table.

    Args:
        text: The text of the file.
        rate: Rows a second [1/s], where there is no column of time.
    """
    columns = named_columns(text, NAMES["position"], "a path needs x, y and z [m], and t [s]")
    rows = len(columns["x"])
    times = columns["t"] if "t" in columns else times_at_rate(rows, rate)
    steps = np.diff(times)
    if not (steps > 0).all():
        raise SpecError(f"line {3 + int(np.argmin(steps > 0))}: times, the column t, must rise")
    knots = np.full((rows, len(PATH), 3), np.nan)
    for derivative, group in enumerate(PATH):
        if all(name in columns for name in NAMES[group]):
            knots[:, derivative] = np.stack([columns[name] for name in NAMES[group]], axis=1)
    return PathRows(knots, steps, _first_attitude(columns), tuple(_unused(columns)), "t" in columns)


def times_at_rate(rows: int, rate: float) -> Array:
    """Return the times [s] of rows at a rate [1/s]. Raises SpecError where they last too long for a path."""
    if not rows / rate <= MAX_DURATION:
        raise SpecError(
            f"rate is too low: {rows} rows at {rate:g} a second last more than {MAX_DURATION:g} s; raise it"
        )
    return np.arange(rows) / rate


def _unused(columns: Mapping[str, Array]) -> Iterator[str]:
    """Yield what a table holds beside a path, in words."""
    used = set(NAMES["time"])
    for group in (*PATH, "attitude"):
        if all(name in columns for name in NAMES[group]):
            used.update(NAMES[group])
    if used.issuperset(NAMES["attitude"]):
        yield "attitudes after the first row"
    others = [name for name in columns if name not in used]
    if others:
        more = f" and {len(others) - 8} more" if len(others) > 8 else ""
        yield f"column{'s' * (len(others) > 1)} {', '.join(others[:8])}{more}"


def _first_attitude(columns: Mapping[str, Array]) -> Array | None:
    if not all(name in columns for name in NAMES["attitude"]):
        return None
    attitude = np.array([columns[name][0] for name in NAMES["attitude"]])
    norm = float(np.linalg.norm(attitude))
    if not 0.5 < norm < 2.0:
        raise SpecError(f"line 2: qw, qx, qy, qz must be a unit quaternion, got one of norm {norm:.3g}")
    return np.asarray(attitude / norm)
