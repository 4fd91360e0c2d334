"""The unknowns of polynomials whose knots are free: derivatives at the knots, durations, places of stages."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import perm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.flatness import end_thrust
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import EndState, Problem
from aerobat.so3 import UP
from aerobat.trajectory import Trajectory, polynomial
from aerobat.vehicle import Vehicle

END_ORDER = 5  # derivatives at either end of a segment that make its polynomial: position to snap
SNAP = END_ORDER - 1
JERK = SNAP - 1  # the highest derivative that both neighbours of a knot share
POLYNOMIAL_DEGREE = 2 * END_ORDER - 1
SHORTEST = 0.3  # of the mean, the least duration of a segment: shorter ones spoil the numbers
TO_COEFFICIENTS = polynomial.hermite(np.eye(2 * END_ORDER)[:END_ORDER], np.eye(2 * END_ORDER)[END_ORDER:])


@dataclass(frozen=True, eq=False)
class Frame:
    """World position = origin + axes q: q has three components, or two in a vertical plane."""

    origin: Array  # [m], (3,)
    axes: Array  # orthonormal columns, (3, d); in a plane the second is up

    @classmethod
    def around(cls, guess: WarmStart, wind: Array) -> Frame:
        """The vertical plane that guess and wind [m/s] stay in, where they stay in one; else all of space."""
        normal = guess.plane()
        if normal is None or normal @ wind != 0.0:
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

    Offsets are of position to jerk at the inner knots, of snap at both ends of every segment, and, unless
    ends are still, of jerk along the thrust at the start and at the goal: there the body is at rest but its
    thrust may be changing. One is a large offset: what the greatest specific thrust does in a mean duration.
    """

    problem: Problem
    vehicle: Vehicle
    guess: WarmStart
    segments: tuple[int, ...]  # of the stages
    frame: Frame
    radius: float  # of the box
    still_ends: bool  # without jerk

    @cached_property
    def x(self) -> Any:
        """The symbols, a column."""
        return import_casadi().MX.sym("x", len(self.start))

    @cached_property
    def start(self) -> Array:
        """Their values for the guess."""
        return np.concatenate([self._parts, self._places, np.zeros(self._effect.shape[1])])

    @property
    def box(self) -> tuple[Array, Array]:
        """The least and the most that they may be."""
        parts, places, offsets = self._split(self.start)
        stretch, free = 1.0 + self.radius, np.zeros_like(places)
        shortest = np.maximum(parts / stretch, np.minimum(parts, SHORTEST))
        return (
            np.concatenate([shortest, free, offsets - self.radius]),
            np.concatenate([parts * stretch, free + 1.0, offsets + self.radius]),
        )

    def duration(self, segment: int) -> Any:
        """A segment's duration [s]."""
        return self._mean * self.x[segment]

    def place(self, stage: int) -> Any:
        """Where in its segment a stage holds."""
        return self.x[len(self._parts) + stage]

    @cached_property
    def coefficients(self) -> list[Any]:
        """Of every segment, in the frame, (10, d) each."""
        ca, d = import_casadi(), self.frame.dimensions
        offsets = self.x[len(self._parts) + len(self._places) :]
        values = ca.DM(self._base.ravel()) + ca.sparsify(ca.DM(self._effect)) @ offsets
        ends = ca.vertsplit(ca.reshape(values, d, len(self._base)).T, 2 * END_ORDER)
        powers = [
            ca.vertcat(*2 * [self.duration(i) ** k for k in range(END_ORDER)])
            for i in range(len(self._parts))
        ]
        return [
            ca.DM(TO_COEFFICIENTS) @ (ca.repmat(power, 1, d) * end)
            for power, end in zip(powers, ends, strict=True)
        ]

    def read(self, x: Array) -> WarmStart:
        """The trajectory and the stages' times that values of x (n,) stand for."""
        parts, places, offsets = self._split(x)
        durations = self._mean * parts
        values = self._base.ravel() + self._effect @ offsets
        powers = np.tile(durations[:, None] ** np.arange(END_ORDER), 2)[..., None]
        coefficients = TO_COEFFICIENTS @ (powers * values.reshape(len(parts), 2 * END_ORDER, -1))
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

    @cached_property
    def _base(self) -> Array:
        """The guess's derivatives at both ends of all segments, in the frame, (segments · 10, d)."""
        trajectory, problem = self.guess.trajectory, self.problem
        ends = np.stack([trajectory.on_segments([0.0, 1.0], k) for k in range(END_ORDER)], axis=2)
        shared = (ends[1:, 0, :SNAP] + ends[:-1, 1, :SNAP]) / 2.0
        ends[1:, 0, :SNAP] = ends[:-1, 1, :SNAP] = shared
        for end, state in ((ends[0, 0], problem.start), (ends[-1, 1], problem.goal)):
            along, jerk = self._thrust_direction(state), end[JERK].copy()
            end[:SNAP] = state.derivatives(SNAP)
            end[JERK] += 0.0 if self.still_ends else along * (along @ jerk)
        return self.frame.inside(ends).reshape(-1, self.frame.dimensions)

    @cached_property
    def _effect(self) -> Array:
        """Effect of offsets on those, row after row, (segments · 10 · d, offsets)."""
        length = self.vehicle.max_specific_thrust * self._mean**2 / perm(POLYNOMIAL_DEGREE, 2)
        sizes = np.array([length * perm(POLYNOMIAL_DEGREE, k) / self._mean**k for k in range(END_ORDER)])
        rows = self._rows()
        free = np.flatnonzero(rows.ravel() >= 0)
        selection = np.zeros((rows.size, int(rows.max()) + 1))
        selection[free, rows.ravel()[free]] = np.broadcast_to(sizes, rows.shape).ravel()[free]
        effect: Array = np.kron(selection, np.eye(self.frame.dimensions)).astype(float)
        if self.still_ends:
            return effect
        jerks = np.zeros((rows.size, self.frame.dimensions, 2))
        for column, (row, end) in enumerate(
            ((JERK, self.problem.start), (JERK - END_ORDER, self.problem.goal))
        ):
            jerks[row, :, column] = sizes[JERK] * self._thrust_direction(end) @ self.frame.axes
        return np.hstack([effect, jerks.reshape(len(effect), 2)])

    def _rows(self) -> NDArray[np.intp]:
        """The number of the offset of each derivative at each end of each segment; -1: fixed, (S, 2, 5)."""
        count = self.guess.trajectory.segments
        rows = np.full((count, 2, END_ORDER), -1)
        knots = np.arange(SNAP * (count - 1)).reshape(count - 1, SNAP)
        rows[1:, 0, :SNAP] = rows[:-1, 1, :SNAP] = knots
        rows[:, :, SNAP] = knots.size + np.arange(2 * count).reshape(count, 2)
        return rows

    def _thrust_direction(self, state: EndState) -> Array:
        """Where the thrust points at an end, (3,)."""
        thrust = end_thrust(state.velocity, state.acceleration, self.vehicle, self.problem.environment)
        return np.asarray(thrust / np.linalg.norm(thrust))
