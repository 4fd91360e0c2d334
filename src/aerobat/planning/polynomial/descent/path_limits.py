"""All that is bounded along a path, as functions of one polynomial at one sample, with exact derivatives.

A polynomial is made by the derivatives of position at its ends, E (10, d), and its duration T: with the
weights G of those at a sample, its k-th derivative by time there is Σ_m G_km T^(o_m − k) E_m, where o_m is
the order of E_m. By this chain the few numbers that limits depend on lead to the unknowns; a large program's
sparse second derivatives, sought without it, take four times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, perm
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.limits import Limit
from aerobat.limits.quantity import WRENCH_RATE
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.polynomial.descent.symbolic_measures import SymbolicMeasures
from aerobat.trajectory import Trajectory, polynomial

END_ORDER = 5  # derivatives at either end of a segment that make its polynomial: position to snap
POLYNOMIAL_DEGREE = 2 * END_ORDER - 1
TO_COEFFICIENTS = polynomial.hermite(np.eye(2 * END_ORDER)[:END_ORDER], np.eye(2 * END_ORDER)[END_ORDER:])
ORDERS = np.tile(np.arange(END_ORDER), 2)  # of the derivatives at both ends

Samples = tuple[Array, ...]  # normalised times in each segment, rising


@dataclass(frozen=True, eq=False)
class PathLimits:
    """Values at a sample with their limits, each divided by its size: on measures, then on the path."""

    measures: SymbolicMeasures
    origin: Array  # [m] of the frame of motion, world, (3,)
    of_measures: tuple[Limit, ...]
    of_path: tuple[Limit, ...]

    @classmethod
    def of(cls, measures: SymbolicMeasures, origin: Array, limits: Sequence[Limit]) -> PathLimits:
        """Return the limits that are not implied by others and differ here."""
        held = [limit for limit in limits if not limit.is_implied]
        measured = measures.distinct([limit for limit in held if not limit.quantity.is_of_path])
        return cls(measures, origin, measured, tuple(limit for limit in held if limit.quantity.is_of_path))

    @property
    def all(self) -> tuple[Limit, ...]:
        """The limits, one a value."""
        return (*self.of_measures, *self.of_path)

    def limits(self, reserve: Array) -> tuple[Array, Array]:
        """The least and the most of every value, less a reserve where it has a range, (size,) all."""
        lower, upper = np.array([_ends(limit) for limit in self.all]).reshape(-1, 2).T
        has_range = [limit.has_reserve or limit.quantity.is_of_path for limit in self.all]
        kept = np.where(has_range, reserve, 0.0)
        return lower + kept, upper - kept

    def of_vehicle(self, reserve: float) -> Array:
        """A reserve of the vehicle's limits, none of the path's, (size,).

        A part of a coordinate's range is no distance to keep: it would depend on where the origin is.
        """
        return np.where([limit.has_reserve for limit in self.all], reserve, 0.0)

    def frames(self, trajectory: Trajectory, samples: Samples) -> list[Array]:
        """The rotors' frames at samples of every segment, (9, n) or (3, n) each."""
        segments = zip(trajectory.knots, trajectory.durations, samples, strict=False)
        times = np.concatenate([start + duration * s for start, duration, s in segments])
        frames = self.measures.frames(trajectory, np.minimum(times, trajectory.duration))
        return np.split(frames, np.cumsum([len(s) for s in samples])[:-1], axis=1)

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
            values = np.array(mapped(inside @ self.measures.axes, trajectory.durations[i], self.at(s), frame))
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
        return len(self.all)

    @property
    def dimensions(self) -> int:
        """d, of the frame of motion."""
        return int(self.measures.axes.shape[1])

    @cached_property
    def _derivatives(self) -> tuple[int, ...]:
        """The derivatives of position that any value depends on."""
        bounded = {k for limit in self.of_path for k in limit.quantity.derivatives}
        late = any(limit.quantity.measured[WRENCH_RATE].any() for limit in self.of_measures)
        return tuple(sorted({1, 2, 3, 4} | ({5} if late else set()) | bounded))

    @cached_property
    def _inputs(self) -> tuple[Any, Any, Any, Any]:
        """The symbols E, T, G and frame."""
        ca = import_casadi()
        return (
            ca.SX.sym("E", 2 * END_ORDER, self.dimensions),
            ca.SX.sym("T"),
            ca.SX.sym("G", len(self._derivatives), 2 * END_ORDER),
            ca.SX.sym("frame", self.measures.frame_size),
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
        values = [self.measures.values(self.of_measures, [rows.get(k) for k in range(1, 6)], frame)]
        for limit in self.of_path:
            quantity = limit.quantity
            along = quantity.path @ self.measures.axes
            value = sum(ca.dot(ca.DM(along[k]), rows[k]) for k in quantity.derivatives)
            values.append((value + float(quantity.path[0] @ self.origin)) / limit.size)
        return ca.vertcat(*values)


def powers(s: Array, derivative: int) -> Array:
    """The k-th derivatives of 1, s, ..., s⁹ at normalised times s (n,), (n, 10)."""
    columns = [perm(p, derivative) * s ** max(p - derivative, 0) for p in range(POLYNOMIAL_DEGREE + 1)]
    return np.stack(columns, axis=-1)


def _ends(limit: Limit) -> tuple[float, float]:
    """The ends of a limit over its size; of a magnitude, whose square is held, their squares."""
    lower, upper = limit.ends
    if limit.quantity.magnitude is None:
        return lower, upper
    return lower**2 if lower > 0.0 else -inf, upper**2
