"""A chain of integrators whose intervals are equal within each phase, from one stage to the next.

Time is normalised by h, the mean interval: the k-th derivative is Y_k = h^k d^k p/dt^k, the input w = h^r u,
and an interval of phase j lasts ρ_j, Σ n_j ρ_j = N. The variables are x = (w_x, w_y, w_z, ρ, ln h): with w
and ρ held, h changes how fast a path is flown, and not the path.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import exp, factorial, log

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.trajectory import Trajectory

DERIVATIVES = 6  # position to crackle


@dataclass(frozen=True, eq=False)
class Places:
    """Where a chain is looked at: a fraction σ of the way along intervals, both sides of a knot apart."""

    interval: Indices  # (m,)
    fraction: Array  # (m,) 0 to 1

    @classmethod
    def even(cls, intervals: int, parts: int) -> Places:
        """Both ends of each interval, and what cuts it into so many parts."""
        fractions = np.linspace(0.0, 1.0, parts + 1)
        return cls(np.repeat(np.arange(intervals), parts + 1), np.tile(fractions, intervals))

    def __getitem__(self, rows: Indices) -> Places:
        return Places(self.interval[rows], self.fraction[rows])

    def joined(self, others: Places) -> Places:
        """Both, in the order of time."""
        interval = np.concatenate([self.interval, others.interval])
        fraction = np.concatenate([self.fraction, others.fraction])
        order = np.lexsort((fraction, interval))
        return Places(interval[order], fraction[order])


@dataclass(frozen=True, eq=False)
class Samples:
    """A path's derivatives at places, in SI units, and how they follow from the variables."""

    chain: PhasedChain
    x: Array
    places: Places

    @cached_property
    def times(self) -> Array:
        """When the places are passed [s], (m,)."""
        return self._mean * self._at

    @cached_property
    def derivatives(self) -> Array:
        """Position to crackle, (m, 6, 3)."""
        return self._values * self._unscaled[:, None]

    @cached_property
    def by_input(self) -> Array:
        """Their slopes by the normalised inputs, the same for each axis, (m, 6, N)."""
        return self._response * self._unscaled[:, None]

    @cached_property
    def by_time(self) -> Array:
        """Their slopes by ρ and by ln h, (m, 6, 3, P + 1)."""
        inputs = self.chain.unpack(self.x)[0]
        by_ratio = self.chain.by_ratio(self._values, self._elapsed, np.diff(inputs, axis=0), self.places)
        powers = np.arange(float(self.chain.order))[:, None]
        by_mean = self._free @ (powers * self._initial) - np.arange(DERIVATIVES)[:, None] * self._values
        return np.concatenate([by_ratio, by_mean[..., None]], axis=-1) * self._unscaled[:, None, None]

    def rows(self, places: Indices, weights: Array) -> Array:
        """Rows over the variables, (q, 3N + P + 1), of Σ weights · derivatives at places (q,), (q, 6, 3)."""
        flat = 3 * DERIVATIVES
        by_time = self.by_time.reshape(len(self.by_time), flat, -1)[places]
        by_time = (weights.reshape(len(weights), 1, flat) @ by_time)[:, 0]
        return np.concatenate([self.input_rows(places, weights), by_time], axis=1)

    def input_rows(self, places: Indices, weights: Array) -> Array:
        """The columns of these rows that belong to inputs, (q, 3N)."""
        by_input: Array = weights.swapaxes(1, 2) @ self.by_input[places]
        return by_input.reshape(len(weights), 3 * self.chain.intervals)

    @cached_property
    def _mean(self) -> float:
        return self.chain.unpack(self.x)[2]

    @cached_property
    def _unscaled(self) -> Array:
        return self._mean ** -np.arange(float(DERIVATIVES))

    @cached_property
    def _initial(self) -> Array:
        """The initial state, normalised, (r, 3)."""
        return self.chain.initial * self._mean ** np.arange(float(self.chain.order))[:, None]

    @cached_property
    def _knots(self) -> Array:
        return self.chain.normalized_knots(self.x)

    @cached_property
    def _at(self) -> Array:
        """Normalised times, (m,)."""
        interval, fraction = self.places.interval, self.places.fraction
        return (1.0 - fraction) * self._knots[interval] + fraction * self._knots[interval + 1]

    @cached_property
    def _elapsed(self) -> Array:
        """Normalised times since knots, (m, N + 1)."""
        return np.maximum(self._at[:, None] - self._knots, 0.0)

    @cached_property
    def _response(self) -> Array:
        return self.chain.response(self._elapsed, self.places.interval)

    @cached_property
    def _free(self) -> Array:
        return self.chain.taylor(self._at)

    @cached_property
    def _values(self) -> Array:
        """The derivatives, normalised."""
        return self._free @ self._initial + self._response @ self.chain.unpack(self.x)[0]


@dataclass(frozen=True, eq=False)
class PhasedChain:
    """`order` integrators in a row from an initial state, with so many intervals in each phase."""

    initial: Array  # derivatives below the order in SI units, (r, 3)
    counts: tuple[int, ...]  # intervals of each phase, (P,)

    @property
    def order(self) -> int:
        """The derivative that is constant on each interval."""
        return len(self.initial)

    @property
    def intervals(self) -> int:
        """Their number N."""
        return sum(self.counts)

    def variables(self, inputs: Array, interval: float) -> Array:
        """The variables of normalised inputs (N, 3) on equal intervals [s]."""
        return np.concatenate([inputs.T.ravel(), np.ones(len(self.counts)), [log(interval)]])

    def unpack(self, x: Array) -> tuple[Array, Array, float]:
        """Normalised inputs (N, 3), ratios ρ (P,) and the mean interval h [s]."""
        n = 3 * self.intervals
        return x[:n].reshape(3, -1).T, x[n:-1], exp(x[-1])

    def durations(self, x: Array) -> Array:
        """Of all intervals [s], (N,)."""
        _, ratios, mean = self.unpack(x)
        return mean * ratios[self._phase]

    def trajectory(self, x: Array, heading: float) -> Trajectory:
        """The path, exactly."""
        inputs, ratios, mean = self.unpack(x)
        return Trajectory.from_inputs(
            self.initial, inputs / mean**self.order, mean * ratios[self._phase], heading
        )

    def samples(self, x: Array, places: Places) -> Samples:
        """The derivatives at places, with their slopes."""
        return Samples(self, x, places)

    def normalized_knots(self, x: Array) -> Array:
        """Where intervals begin and end, in units of the mean interval, (N + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.unpack(x)[1][self._phase])])

    @cached_property
    def _phase(self) -> Indices:
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def knot_shifts(self) -> Array:
        """Rates at which knots move with ρ, (N + 1, P): how many intervals of each phase lie before them."""
        one_hot = np.eye(len(self.counts))[self._phase]
        return np.concatenate([np.zeros((1, len(self.counts))), np.cumsum(one_hot, axis=0)])

    def response(self, elapsed: Array, interval: Indices) -> Array:
        """Normalised derivatives per input, (m, 6, N), after the times since knots, (m, N + 1)."""
        response = np.zeros((len(elapsed), DERIVATIVES, self.intervals))
        power = np.ones_like(elapsed)
        for remaining in range(1, self.order + 1):
            power = power * elapsed / remaining
            response[:, self.order - remaining] = power[:, :-1] - power[:, 1:]
        response[np.arange(len(elapsed)), self.order, interval] = 1.0
        return response

    def taylor(self, at: Array) -> Array:
        """Normalised derivatives at times (m,) per initial derivative, (m, 6, r)."""
        taylor = np.zeros((len(at), DERIVATIVES, self.order))
        for d in range(self.order):
            for k in range(d, self.order):
                taylor[:, d, k] = at ** (k - d) / factorial(k - d)
        return taylor

    def by_ratio(self, values: Array, elapsed: Array, jumps: Array, places: Places) -> Array:
        """Slopes of the normalised derivatives by ρ, (m, 6, 3, P): places move, and knots before them."""
        m = len(elapsed)
        moved = self.knot_shifts[places.interval].copy()
        moved[np.arange(m), self._phase[places.interval]] += places.fraction
        slopes = np.zeros((m, DERIVATIVES, 3, len(self.counts)))
        slopes[:, :-1] = values[:, 1:, :, None] * moved[:, None, None, :]
        pushed = jumps[:, :, None] * self.knot_shifts[1:-1, None, :]  # (N - 1, 3, P)
        pushed = pushed.reshape(len(jumps), -1)
        passed = np.arange(1, self.intervals) <= places.interval[:, None]
        power = passed.astype(float)
        for remaining in range(1, self.order + 1):
            if remaining > 1:
                power = power * elapsed[:, 1:-1] / (remaining - 1)
            slopes[:, self.order - remaining] -= (power @ pushed).reshape(m, 3, -1)
        return slopes
