"""All that is bounded along a path, as functions of one polynomial at one sample, with exact derivatives.

A polynomial is made by the derivatives of position at its ends, E (10, d), and its duration T: with the
weights G of those at a sample, its k-th derivative by time there is Σ_m G_km T^(o_m − k) E_m, where o_m is
the order of E_m. By this chain the few numbers that limits depend on lead to the unknowns; a large program's
sparse second derivatives, sought without it, take four times as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, perm
from typing import Any

import numpy as np

from aerobat.arrays import AXES, Array
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.polynomial.descent.rotor_constraints import RotorConstraints
from aerobat.problem.condition import ForceBalance, LinearBound
from aerobat.problem.problem import DERIVATIVES, Problem
from aerobat.problem.stage import StageSequence
from aerobat.trajectory import Trajectory, polynomial

END_ORDER = 5  # derivatives at either end of a segment that make its polynomial: position to snap
POLYNOMIAL_DEGREE = 2 * END_ORDER - 1
TO_COEFFICIENTS = polynomial.hermite(np.eye(2 * END_ORDER)[:END_ORDER], np.eye(2 * END_ORDER)[END_ORDER:])
ORDERS = np.tile(np.arange(END_ORDER), 2)  # of the derivatives at both ends
MIN_SCALE = 1e-3  # in SI units: a bound next to zero has no size of its own

Samples = tuple[Array, ...]  # normalised times in each segment, rising


@dataclass(frozen=True, eq=False)
class PathLimits:
    """Values at a sample with their limits, each divided by its range: rotors, body rate, linear bounds."""

    rotors: RotorConstraints
    origin: Array  # [m] of the frame of motion, world, (3,)
    bounds: tuple[tuple[str, LinearBound], ...]  # each with its name

    def limits(self, reserve: Array) -> tuple[Array, Array]:
        """The least and the most of every value, less a reserve where it has a range, (size,) all."""
        ends = np.array([scaled(bound) for _, bound in self.bounds]).reshape(-1, 2).T
        lower, upper = np.concatenate([self.rotors.limits, ends], axis=1)
        has_range = np.append(self.rotors.has_range, np.ones(len(self.bounds), dtype=bool))
        kept = np.where(has_range, reserve, 0.0)
        return lower + kept, upper - kept

    def of_vehicle(self, reserve: float) -> Array:
        """A reserve of the vehicle's limits, none of the path's, (size,).

        A part of a coordinate's range is no distance to keep: it would depend on where the origin is.
        """
        return np.where(np.arange(self.size) < len(self.rotors.names), reserve, 0.0)

    def frames(self, trajectory: Trajectory, samples: Samples) -> list[Array]:
        """The rotors' frames at samples of every segment, (9, n) or (3, n) each."""
        segments = zip(trajectory.knots, trajectory.durations, samples, strict=False)
        times = np.concatenate([start + duration * s for start, duration, s in segments])
        frames = self.rotors.frames(trajectory, np.minimum(times, trajectory.duration))
        return np.split(frames, np.cumsum([len(s) for s in samples])[:-1], axis=1)

    @property
    def names(self) -> tuple[str, ...]:
        """The limits' names, one a value."""
        return (*self.rotors.names, *(name for name, _ in self.bounds))

    def excess(self, trajectory: Trajectory, samples: Samples, reserve: float = 0.0) -> Array:
        """By how much a trajectory exceeds limits at as many samples of each segment, (S, size, n).

        Of the vehicle's limits, less a reserve.
        """
        lower, upper = (limits[:, None] for limits in self.limits(self.of_vehicle(reserve)))
        frames = self.frames(trajectory, samples)
        found = []
        for i, (s, frame) in enumerate(zip(samples, frames, strict=True)):
            ends = [trajectory.on_segments([0.0, 1.0], k)[i] for k in range(END_ORDER)]
            inside = (
                np.concatenate(np.swapaxes(ends, 0, 1))
                - np.where(ORDERS == 0, 1.0, 0.0)[:, None] * self.origin
            )
            mapped = self.values.map("values", "serial", len(s), [0, 1], [])
            values = np.array(mapped(inside @ self.rotors.axes, trajectory.durations[i], self.at(s), frame))
            found.append(np.maximum(lower - values, values - upper))
        return np.array(found)

    def ends(self, local: Any) -> tuple[Any, Any]:
        """E and T of a segment's unknowns, a column of E row after row and T."""
        return import_casadi().reshape(local[:-1], self.dimensions, len(ORDERS)).T, local[-1]

    def at(self, s: Array) -> Array:
        """The weights G at samples s (n,), side by side, (derivatives, 10 n)."""
        weights = np.stack([powers(s, k) @ TO_COEFFICIENTS for k in self._derivatives])
        return weights.reshape(len(self._derivatives), -1)

    @cached_property
    def values(self) -> Any:
        """(E, T, G, frame) -> values (size,)."""
        inputs, motion = self._inputs, self._chain[0]
        return import_casadi().Function("values", list(inputs), [self._at_sample(motion, inputs[3])[0]])

    @cached_property
    def jacobian(self) -> Any:
        """(E, T, G, frame) -> values (size,), their transposed Jacobian by E and T, (10 d + 1, size)."""
        ca, inputs = import_casadi(), self._inputs
        motion, by_ends, by_duration, *_ = self._chain
        values, slopes = self._at_sample(motion, inputs[3])
        turned = ca.densify(ca.vertcat(by_ends.T @ slopes.T, by_duration.T @ slopes.T))
        return ca.Function("jacobian", list(inputs), [values, turned])

    @cached_property
    def hessian(self) -> Any:
        """(E, T, G, frame, multipliers) -> Hessian by E and T of their product with the values."""
        ca, inputs = import_casadi(), self._inputs
        motion, by_ends, by_duration, by_both, twice_by_duration = self._chain
        weighted = ca.SX.sym("multipliers", self.size)
        symbol, frame = ca.SX.sym("motion", motion.numel()), inputs[3]
        product = ca.dot(weighted, self._of(symbol, frame))
        curvature, slope = ca.hessian(product, symbol)
        derivatives = ca.Function("derivatives", [symbol, frame, weighted], [curvature, slope])
        curvature, slope = derivatives(motion, frame, weighted)
        along = curvature @ by_duration
        ends = by_ends.T @ (curvature @ by_ends)
        mixed = by_ends.T @ along + by_both.T @ slope
        last = ca.dot(by_duration, along) + ca.dot(slope, twice_by_duration)
        whole = ca.densify(ca.vertcat(ca.horzcat(ends, mixed), ca.horzcat(mixed.T, last)))
        return ca.Function("hessian", [*inputs, weighted], [ca.triu2symm(ca.triu(whole))])

    @property
    def size(self) -> int:
        """The number of values."""
        return len(self.rotors.limits[0]) + len(self.bounds)

    @property
    def dimensions(self) -> int:
        """d, of the frame of motion."""
        return int(self.rotors.axes.shape[1])

    @cached_property
    def _derivatives(self) -> tuple[int, ...]:
        """The derivatives of position that any value depends on."""
        bounded = {k for _, bound in self.bounds for k in bound.derivatives}
        return tuple(sorted({1, 2, 3, 4} | ({5} if self.rotors.lags else set()) | bounded))

    @cached_property
    def _inputs(self) -> tuple[Any, Any, Any, Any]:
        """The symbols E, T, G and frame."""
        ca = import_casadi()
        return (
            ca.SX.sym("E", 2 * END_ORDER, self.dimensions),
            ca.SX.sym("T"),
            ca.SX.sym("G", len(self._derivatives), 2 * END_ORDER),
            ca.SX.sym("frame", self.rotors.frame_size),
        )

    @cached_property
    def _chain(self) -> tuple[Any, Any, Any, Any, Any]:
        """The derivatives at a sample, row after row; theirs by E, by T, by E and T, twice by T."""
        ca = import_casadi()
        ends, duration, weights, _ = self._inputs
        exponents = ORDERS[None, :] - np.array(self._derivatives)[:, None]
        chain = []
        for times in range(3):
            factors = np.ones(exponents.shape)
            for j in range(times):
                factors *= exponents - j
            powers_of = ca.vertcat(
                *(
                    ca.horzcat(
                        *(duration ** int(n - times) if f else 0 for n, f in zip(row, fs, strict=True))
                    )
                    for row, fs in zip(exponents, factors, strict=True)
                )
            )
            chain.append(ca.sparsify(weights * ca.DM(factors) * powers_of))
        identity = ca.SX.eye(self.dimensions)
        by_ends, by_both = (ca.kron(matrix, identity) for matrix in chain[:2])
        column = ca.vec(ends.T)
        motion, by_duration = by_ends @ column, by_both @ column
        twice = ca.kron(chain[2], identity) @ column
        return motion, by_ends, by_duration, by_both, twice

    def _at_sample(self, motion: Any, frame: Any) -> tuple[Any, Any]:
        """The values and their Jacobian by the derivatives at a sample."""
        ca = import_casadi()
        symbol = ca.SX.sym("motion", motion.numel())
        values = self._of(symbol, frame)
        function = ca.Function("at", [symbol, frame], [values, ca.jacobian(values, symbol)])
        at_sample: tuple[Any, Any] = function(motion, frame)
        return at_sample

    def _of(self, motion: Any, frame: Any) -> Any:
        """The values, a column, of the derivatives at a sample, row after row."""
        ca, d = import_casadi(), self.dimensions
        rows = {k: motion[i * d : (i + 1) * d] for i, k in enumerate(self._derivatives)}
        values = [self.rotors.values([rows.get(k) for k in range(1, 6)], frame)]
        for _, bound in self.bounds:
            along = bound.weights @ self.rotors.axes
            value = sum(ca.dot(ca.DM(along[k]), rows[k]) for k in bound.derivatives)
            values.append((value + float(bound.weights[0] @ self.origin)) / bound_scale(bound))
        return ca.vertcat(*values)


def path_bounds(
    problem: Problem, sequence: StageSequence, balance: ForceBalance
) -> tuple[tuple[str, LinearBound], ...]:
    """Bounds along the whole path with their names: the problem's limits, what its sequence asks always.

    Limits' weights (6, 3) have a row for each derivative, position to crackle.
    """
    bounds = []
    for k, quantity in enumerate(DERIVATIVES):
        for axis, direction, low, high in zip(AXES, np.eye(3), *problem.path_limits.of(k), strict=True):
            if low > -inf or high < inf:
                weights = np.outer(np.eye(len(DERIVATIVES))[k], direction)
                bounds.append((f"{quantity} {axis}", LinearBound(weights, 0.0, float(low), float(high))))
    asked = ((condition.name, condition.bound(balance)) for condition in sequence.path_constraints)
    return (*bounds, *asked)


def powers(s: Array, derivative: int) -> Array:
    """The k-th derivatives of 1, s, ..., s⁹ at normalised times s (n,), (n, 10)."""
    columns = [perm(p, derivative) * s ** max(p - derivative, 0) for p in range(POLYNOMIAL_DEGREE + 1)]
    return np.stack(columns, axis=-1)


def bound_scale(bound: LinearBound) -> float:
    """The size by which a bound's value is divided."""
    return bound.scale if bound.scale > MIN_SCALE else 1.0


def scaled(bound: LinearBound) -> tuple[float, float]:
    """A bound's limits, of the weighted derivatives alone, divided by its scale."""
    lower, upper = bound.limits
    return lower / bound_scale(bound), upper / bound_scale(bound)
