"""Two-point Hermite collocation: a motion of the rigid body as unknowns, equations, and a trajectory.

Time is cut into phases of equal intervals, the input linear on each. From both ends of an interval the
equations of motion give x', x'', x''' exactly; the quintic through them, integrated, must lead from one state
to the next,

    x₁ = x₀ + h/2 (x₀' + x₁') + h²/10 (x₀'' − x₁'') + h³/120 (x₀''' + x₁''')        of order six,

and so, twice, for the position, whose acceleration is such a quintic. A solution therefore *is* a piecewise
polynomial of degree seven, with the rigid body's thrust direction, body rates, moments and collective thrust
at both ends of every interval: nothing is interpolated between the program and what is flown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.time_optimal.zero_yaw_rate_body import (
    INPUTS,
    POSITION,
    STATES,
    VELOCITY,
    ZeroYawRateBody,
)
from aerobat.trajectory import Trajectory, polynomial

STATE_SCALE = np.repeat([1.0, 5.0, 1.0, 5.0], [3, 3, 4, 2])  # what is large in SI units
QUINTIC = polynomial.hermite(np.eye(6)[:3], np.eye(6)[3:])  # powers of y (rows) from y, y', y'' at both ends
INTEGRAL = 1.0 / np.arange(1, 7)  # of each power over [0, 1]
BETWEEN = np.array([0.25, 0.5, 0.75])  # of an interval: where limits on what may swing there are held too
DOUBLE_INTEGRAL = INTEGRAL / np.arange(2, 8)


@dataclass(frozen=True, eq=False)
class CollocatedMotion:
    """States and inputs over all phases in SI units: arrays, or symbols of the same shapes."""

    phases: Any  # durations [s], (P,)
    states: Any  # at the nodes, (12, K + 1)
    starts: Any  # inputs at the starts of the intervals, (3, K)
    ends: Any  # and at their ends, (3, K)


@dataclass(frozen=True, eq=False)
class Rates:
    """x', x'', x''' at the starts and at the ends of all intervals, (12, K) each."""

    starts: tuple[Any, Any, Any]
    ends: tuple[Any, Any, Any]

    def normalised(self, durations: Any) -> list[Any]:
        """The six of them with respect to normalised time, where x' has the unit of x per second."""
        rows = import_casadi().repmat(durations, STATES, 1)
        return [rate * rows**k for side in (self.starts, self.ends) for k, rate in enumerate(side)]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Phases cut into intervals, and how a motion on them is written as one column of scaled unknowns.

    The input of a `continuous` motion is the same on both sides of every inner node.
    """

    intervals: tuple[int, ...]  # of each phase, (P,)
    continuous: bool
    input_scale: Array  # what is large for an input, (3,)

    @property
    def total(self) -> int:
        """K, the intervals of all phases."""
        return sum(self.intervals)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return len(self.scale)

    @cached_property
    def fractions(self) -> Array:
        """Part of each phase that each interval takes, (P, K)."""
        counts = np.array(self.intervals)
        return np.repeat(np.diag(1.0 / counts), counts, axis=1)

    @cached_property
    def scale(self) -> Array:
        """Scale of each unknown, in SI units, (size,)."""
        phases, _, inputs = self._sizes
        states, inputs = self.total + 1, inputs // INPUTS
        return np.concatenate(
            [np.ones(phases), np.tile(STATE_SCALE, states), np.tile(self.input_scale, inputs)]
        )

    def pack(self, motion: CollocatedMotion) -> Array:
        """The column of unknowns of a motion in numbers, (size,)."""
        first = motion.starts[:, :1] if self.continuous else motion.starts
        columns = (motion.states, first, motion.ends)
        return np.concatenate([motion.phases, *(column.T.ravel() for column in columns)]) / self.scale

    def unpack(self, column: Any) -> CollocatedMotion:
        """The motion of a column of unknowns, in symbols."""
        ca, K = import_casadi(), self.total
        cuts = np.cumsum([0, *self._sizes]).tolist()
        phases, states, inputs = ca.vertsplit(column * self.scale, cuts)
        inputs = ca.reshape(inputs, INPUTS, -1)
        starts = inputs[:, :K]
        ends = inputs[:, 1:] if self.continuous else inputs[:, K:]
        return CollocatedMotion(phases, ca.reshape(states, STATES, K + 1), starts, ends)

    def read(self, column: Array) -> CollocatedMotion:
        """The motion of a column of unknowns, in numbers."""
        motion = self.unpack(import_casadi().DM(column))
        states, starts, ends = (part.full() for part in (motion.states, motion.starts, motion.ends))
        return CollocatedMotion(motion.phases.full()[:, 0], states, starts, ends)

    @property
    def _sizes(self) -> tuple[int, int, int]:
        inputs = self.total + 1 if self.continuous else 2 * self.total
        return len(self.intervals), STATES * (self.total + 1), INPUTS * inputs


@dataclass(frozen=True, eq=False)
class Collocation:
    """A motion on a mesh with what the equations of motion make of it, in numbers or symbols."""

    body: ZeroYawRateBody
    mesh: Mesh
    motion: CollocatedMotion

    @cached_property
    def durations(self) -> Any:
        """Of the intervals [s], (1, K)."""
        return import_casadi().reshape(self.motion.phases, 1, -1) @ import_casadi().DM(self.mesh.fractions)

    @cached_property
    def rates(self) -> Rates:
        """The state's derivatives."""
        return Rates(*self._on_both_sides(self.body.derivatives))

    @cached_property
    def rotors(self) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """The rotors' thrusts and commands [N], at the starts and at the ends, (n, K) each."""
        starts, ends = self._on_both_sides(self.body.rotors)
        return starts, ends

    def defects(self) -> Any:
        """By how much the quintics miss the next states, (12, K)."""
        ca, x0, x1 = import_casadi(), self.motion.states[:, :-1], self.motion.states[:, 1:]
        h = ca.repmat(self.durations, 3, 1)
        ends = self.rates.normalised(self.durations)
        missed = x1 - x0 - _combined(INTEGRAL @ QUINTIC, ends) * ca.repmat(self.durations, STATES, 1)
        fallen = _combined(DOUBLE_INTEGRAL @ QUINTIC, [rate[VELOCITY, :] for rate in ends])
        position = x1[POSITION, :] - x0[POSITION, :] - h * x0[VELOCITY, :] - h**2 * fallen
        return ca.vertcat(position, missed[VELOCITY.start :, :])

    def between(self, derivative: int) -> Iterator[Any]:
        """Acceleration, jerk or snap of the trajectory within all intervals, (3, K) at each place."""
        ends = [rate[VELOCITY, :] for rate in self.rates.normalised(self.durations)]
        basis = polynomial.differentiate(QUINTIC[None], derivative - 2)[0]
        scale = import_casadi().repmat(self.durations, 3, 1) ** (derivative - 2)
        for powers in np.vander(BETWEEN, len(basis), increasing=True):
            yield _combined(powers @ basis, ends) / scale

    def trajectory(self, heading: float) -> Trajectory:
        """The trajectory of a motion in numbers, from its start on, continuous to the last digit."""
        ends = [import_casadi().DM(rate).full()[VELOCITY] for rate in self.rates.normalised(self.durations)]
        durations = import_casadi().DM(self.durations).full()[0]
        quintics = np.einsum("ij,jdk->kid", QUINTIC, ends) * durations[:, None, None] ** 2
        twice = (np.arange(1, 7) * np.arange(2, 8))[:, None]
        coefficients = np.concatenate([np.zeros((self.mesh.total, 2, 3)), quintics / twice], axis=1)
        position, velocity = self.motion.states[POSITION, 0], self.motion.states[VELOCITY, 0]
        for piece, h in zip(coefficients, durations.tolist(), strict=True):
            piece[:2] = position, h * velocity
            position, velocity = piece.sum(axis=0), np.arange(8) @ piece / h
        return Trajectory(durations, coefficients, heading)

    def _on_both_sides(self, function: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        motion, columns = self.motion, function.map(self.mesh.total)
        slope = (motion.ends - motion.starts) / import_casadi().repmat(self.durations, INPUTS, 1)
        return (
            columns(motion.states[:, :-1], motion.starts, slope),
            columns(motion.states[:, 1:], motion.ends, slope),
        )


def _combined(weights: Array, terms: list[Any]) -> Any:
    return sum(weight * term for weight, term in zip(weights.tolist(), terms, strict=True))
