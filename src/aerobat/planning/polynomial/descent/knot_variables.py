"""The unknowns of polynomials whose knots are free: derivatives at the knots, durations, places of stages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import perm

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.flatness import force_balance, has_unequal_drag, lateral_drag
from aerobat.planning.polynomial.descent.path_limits import (
    END_ORDER,
    ORDERS,
    POLYNOMIAL_DEGREE,
    TO_COEFFICIENTS,
)
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.end_state import VELOCITY, EndState
from aerobat.problem.problem import Problem
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

SNAP = END_ORDER - 1
JERK = SNAP - 1
AT_EDGE = 1e-3  # of the box's width
SHORTEST = 0.3  # of the mean, the least duration of a segment: shorter ones spoil the numbers


@dataclass(frozen=True, eq=False)
class Frame:
    """World position = origin + axes q: q has three components, or two in a vertical plane."""

    origin: Array  # [m], (3,)
    axes: Array  # orthonormal columns, (3, d); in a plane the second is up

    @classmethod
    def around(cls, guess: WarmStart, wind: Array, vehicle: Vehicle) -> Frame:
        """The vertical plane that guess, wind [m/s] and body stay in, where they stay in one; else space."""
        normal = guess.plane()
        if normal is None or normal @ wind != 0.0 or has_unequal_drag(vehicle):
            return cls(np.zeros(3), np.eye(3))
        start = guess.trajectory.coefficients[0, 0]
        return cls(normal * (normal @ start), np.stack([np.cross(normal, UP), UP], axis=1))

    @property
    def dimensions(self) -> int:
        """d."""
        return int(self.axes.shape[1])

    def inside(self, derivatives: Array) -> Array:
        """Position and its derivatives (..., k, 3) in this frame, (..., k, d)."""
        inside = np.array(derivatives, dtype=float)
        inside[..., 0, :] -= self.origin
        return np.asarray(inside @ self.axes)

    def outside(self, coefficients: Array) -> Array:
        """Coefficients in the world frame, (..., K, d) -> (..., K, 3)."""
        outside = coefficients @ self.axes.T
        outside[..., 0, :] += self.origin
        return np.asarray(outside)


@dataclass(frozen=True, eq=False)
class KnotVariables:
    """x: durations, as parts of their mean; the stages' places, 0 to 1; offsets from a guess's derivatives.

    Offsets are of position to jerk at the inner knots; of snap there too, one for both neighbours if rotors
    lag, whose thrusts cannot jump, else one for each. At the ends the body does not turn but its thrust may
    be changing: of jerk along the thrust, unless ends are still, and of snap along it if rotors lag, else of
    all snap. One is a large offset: what the greatest specific thrust does in a mean duration.
    """

    problem: Problem
    vehicle: Vehicle
    guess: WarmStart
    segments: tuple[int, ...]  # of the stages
    frame: Frame
    radius: float  # of the box
    still_ends: bool  # without jerk

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return len(self.start)

    @cached_property
    def start(self) -> Array:
        """Their values for the guess."""
        return np.concatenate([self._parts, self._places, np.zeros(self._effect.shape[1])])

    @property
    def box(self) -> tuple[Array, Array]:
        """The least and the most that they may be; places within their stages' windows at most."""
        parts, places, offsets = self._split(self.start)
        stretch, free = 1.0 + self.radius, np.zeros_like(places)
        shortest = np.maximum(parts / stretch, np.minimum(parts, SHORTEST))
        return (
            np.concatenate([shortest, free, offsets - self.radius]),
            np.concatenate([parts * stretch, free + 1.0, offsets + self.radius]),
        )

    def is_at_edge(self, x: Array) -> bool:
        """True if a duration or an offset stands at an edge of the box."""
        lower, upper = self.box
        to_edge = np.minimum(x - lower, upper - x) / (upper - lower)
        to_edge[self.place_columns] = 1.0
        return bool(to_edge.min() < AT_EDGE)

    def local(self, segment: int) -> tuple[Array, Array]:
        """A segment's E, row after row, and its T as a linear function of x: matrix and constant."""
        rows = 2 * END_ORDER * self.frame.dimensions
        matrix = np.zeros((rows + 1, self.size))
        matrix[:rows, -self._effect.shape[1] :] = self._effect[rows * segment : rows * (segment + 1)]
        matrix[rows, segment] = self._mean
        return matrix, np.append(self._base.ravel()[rows * segment : rows * (segment + 1)], 0.0)

    @property
    def place_columns(self) -> range:
        """Which unknowns are the stages' places."""
        return range(len(self._parts), len(self._parts) + len(self._places))

    def read(self, x: Array) -> WarmStart:
        """The trajectory and the stages' times that values of x (n,) stand for."""
        parts, places, offsets = self._split(x)
        durations = self._mean * parts
        values = self._base.ravel() + self._effect @ offsets
        factors = (durations[:, None] ** ORDERS)[..., None]
        coefficients = TO_COEFFICIENTS @ (factors * values.reshape(len(parts), 2 * END_ORDER, -1))
        trajectory = Trajectory(durations, self.frame.outside(coefficients), self.problem.heading)
        segments = list(self.segments)
        times = trajectory.knots[segments] + durations[segments] * places
        return WarmStart(trajectory, self.guess.stages, tuple(times.tolist()))

    def _split(self, x: Array) -> list[Array]:
        """Durations, places and offsets among values of x."""
        return np.split(x, np.cumsum([len(self._parts), len(self._places)]))

    @property
    def _mean(self) -> float:
        return self.guess.trajectory.duration / self.guess.trajectory.segments

    @property
    def _parts(self) -> Array:
        return self.guess.trajectory.durations / self._mean

    @cached_property
    def _places(self) -> Array:
        trajectory, segments = self.guess.trajectory, list(self.segments)
        since = np.array(self.guess.times) - trajectory.knots[segments]
        return np.clip(since / trajectory.durations[segments], 0.0, 1.0)

    @property
    def _shared(self) -> int:
        """The number of derivatives that both neighbours of a knot share."""
        return END_ORDER if self.vehicle.lags.any() else SNAP

    @cached_property
    def _base(self) -> Array:
        """The guess's derivatives at both ends of all segments, in the frame, (segments · 10, d)."""
        trajectory, shared = self.guess.trajectory, self._shared
        ends = np.stack([trajectory.on_segments([0.0, 1.0], k) for k in range(END_ORDER)], axis=2)
        mean = (ends[1:, 0, :shared] + ends[:-1, 1, :shared]) / 2.0
        ends[1:, 0, :shared] = ends[:-1, 1, :shared] = mean
        for end, state in ((ends[0, 0], self.problem.start), (ends[-1, 1], self.problem.goal)):
            self._settle(end, state)
        return self.frame.inside(ends).reshape(-1, self.frame.dimensions)

    def _settle(self, end: Array, state: EndState) -> None:
        """Give an end (5, 3) its state's derivatives and the rest of the body, which turns with f' or f''."""
        along, drag = self._thrust_direction(state), lateral_drag(self.vehicle)
        jerk = 0.0 if self.still_ends else float(along @ end[JERK])
        met = state.fixed(JERK)
        end[met] = state.derivatives(JERK)[met]
        end[JERK] = jerk * along + (0.0 if self.still_ends else -drag) * end[JERK - 1]
        if self._shared == END_ORDER:
            end[SNAP] = float(along @ end[SNAP]) * along - drag * (
                end[JERK] - float(along @ end[JERK]) * along
            )

    @cached_property
    def _effect(self) -> Array:
        """Effect of offsets on those, row after row, (segments · 10 · d, offsets)."""
        rows = self._rows()
        free = np.flatnonzero(rows.ravel() >= 0)
        selection = np.zeros((rows.size, int(rows.max(initial=-1)) + 1))
        selection[free, rows.ravel()[free]] = np.broadcast_to(self._sizes, rows.shape).ravel()[free]
        effect: Array = np.kron(selection, np.eye(self.frame.dimensions)).astype(float)
        along = ([] if self.still_ends else [JERK]) + ([SNAP] if self._shared == END_ORDER else [])
        columns = np.zeros((rows.size, self.frame.dimensions, 2 * len(along)))
        for i, order in enumerate(along):
            for j, (row, state) in enumerate(
                ((order, self.problem.start), (order - END_ORDER, self.problem.goal))
            ):
                direction = self._thrust_direction(state) @ self.frame.axes
                columns[row, :, 2 * i + j] = self._sizes[order] * direction
        return np.hstack([effect, columns.reshape(len(effect), -1)])

    @property
    def _sizes(self) -> Array:
        """A large offset of each derivative, (5,)."""
        length = self.vehicle.max_specific_thrust * self._mean**2 / perm(POLYNOMIAL_DEGREE, 2)
        return np.array([length * perm(POLYNOMIAL_DEGREE, k) / self._mean**k for k in range(END_ORDER)])

    def _rows(self) -> NDArray[np.intp]:
        """The number of the offset of each derivative at each end of each segment; -1: none, (S, 2, 5)."""
        count, shared = self.guess.trajectory.segments, self._shared
        rows = np.full((count, 2, END_ORDER), -1)
        knots = np.arange(shared * (count - 1)).reshape(count - 1, shared)
        rows[1:, 0, :shared] = rows[:-1, 1, :shared] = knots
        if shared == SNAP:
            rows[:, :, SNAP] = knots.size + np.arange(2 * count).reshape(count, 2)
        if self.problem.goal.free_velocity:
            rows[-1, 1, VELOCITY] = rows.max() + 1
        return rows

    def _thrust_direction(self, state: EndState) -> Array:
        """Where the thrust points at an end, (3,)."""
        thrust = force_balance(self.problem.environment, self.vehicle).specific_thrust(
            state.velocity, state.acceleration
        )
        return np.asarray(thrust / np.linalg.norm(thrust))
