"""Splines of degree 9 between knots, as functions of the variables that the refinement optimizes.

Let h be the mean duration of a segment. The k-th derivative of position at a knot is Y_k/h^k, and a segment
lasts τ h. The variables are the Y_k at the knots, scaled to magnitudes near one, ln τ of every segment, and
ln h. With all other variables held, h changes only how fast the path is flown. Derivatives that the ends fix
are in SI units. On a segment of duration T = τ h the normalised data of both its knots are
Z_m = τ^m Y_m + T^m fixed_m. The k-th derivative of position on the segment is

    D_k(s) = T^-k Σ_m B_km(s) Z_m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from math import log, perm
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.flatness import lateral_drag
from aerobat.optimization.bordered_band import BorderedBand, Pattern
from aerobat.planning.task import Task
from aerobat.problem.end_state import EndState
from aerobat.trajectory import Trajectory, polynomial

END_ORDER = 5  # derivatives at either end of a segment that determine its polynomial: position to snap
DEGREE = 2 * END_ORDER - 1
DERIVATIVES = 6  # position to crackle
JERK, SNAP = 3, 4
TO_COEFFICIENTS = polynomial.hermite(np.eye(2 * END_ORDER)[:END_ORDER], np.eye(2 * END_ORDER)[END_ORDER:])
ORDERS = np.tile(np.arange(float(END_ORDER)), 2)  # orders of the derivatives at both ends, (10,)
POWERS = np.arange(float(DERIVATIVES))[:, None]  # k


def chebyshev(count: int) -> Array:
    """Return `count` Chebyshev points from 0 to 1, both ends included, denser toward the ends."""
    return np.asarray((1.0 - np.cos(np.linspace(0.0, np.pi, count))) / 2.0)


def basis(fractions: Array) -> Array:
    """Return B, the map from normalised knot data to derivatives by normalised time.

    The fractions of a segment are (..., p), the result is (..., p, 6, 10).
    """
    powers = [
        np.stack([perm(p, k) * fractions ** max(p - k, 0) for p in range(DEGREE + 1)], axis=-1)
        for k in range(DERIVATIVES)
    ]
    return np.stack(powers, axis=-2) @ TO_COEFFICIENTS


class KnotData(NamedTuple):
    """Normalised derivatives at both ends of all segments, and the segments' durations."""

    values: Array  # Z, (S, 10, 3)
    fixed: Array  # the part T^m fixed_m of Z, which the ends fix
    ratios: Array  # τ, (S,)
    durations: Array  # [s], (S,)
    origin: Array  # [m] of the positions in Z, world, (3,)

    def scaled(self, places: Array) -> Array:
        """Return T^-k B, (S, 6 p, 10), for places from `basis`, (S, p, 6, 10) or (p, 6, 10)."""
        found = places * (self.durations[:, None] ** -POWERS[:, 0])[:, None, :, None]
        return np.asarray(found.reshape(len(self.durations), -1, 2 * END_ORDER))

    def derivatives(self, places: Array) -> Array:
        """Return the derivatives of position at places, (S, p, 6, 3)."""
        return self.motion_of(self.scaled(places))

    def motion_of(self, scaled: Array) -> Array:
        """Return the derivatives of position, (S, p, 6, 3), for `scaled` places."""
        found = (scaled @ self.values).reshape(len(scaled), -1, DERIVATIVES, 3)
        found[:, :, 0] += self.origin
        return np.asarray(found)


@dataclass(frozen=True, eq=False)
class Motion:
    """Derivatives of position at places of all segments, with their Jacobian by the variables.

    A segment's local variables are the K variables of its two knots, its ln τ, and ln h.
    """

    derivatives: Array  # of position, (S, p, 6, 3)
    jacobian: Array  # of the derivatives by local variables, (S, p, 6, 3, K + 2)
    _scaled: Array  # T^-k B, (S, 6 p, 10)
    _data: KnotData
    _effect: Array  # slopes of Z by local variables, (S, 10, 3, K)

    def curvature(self, weights: Array) -> Array:
        """Return the Hessian (S, K + 2, K + 2) of Σ weights · derivatives, with weights (S, p, 6, 3)."""
        count = self._effect.shape[-1]
        found = np.zeros((len(weights), count + 2, count + 2))
        ratio, mean = count, count + 1
        flat = weights.reshape(len(weights), -1, 3)
        both = np.concatenate([flat, (-POWERS * weights).reshape(flat.shape)], axis=2)
        by_data = np.swapaxes(self._scaled, 1, 2) @ both
        plain, low = by_data[..., :3], by_data[..., 3:]
        orders = ORDERS[:, None]
        by_ratio, by_mean = (
            (each.reshape(len(weights), 1, -1) @ self._effect.reshape(len(weights), -1, count))[:, 0]
            for each in (orders * plain + low, low)
        )
        found[:, :count, ratio] = found[:, ratio, :count] = by_ratio
        found[:, :count, mean] = found[:, mean, :count] = by_mean
        squared = (weights * self.derivatives).sum(axis=(1, 3)) @ POWERS[:, 0] ** 2
        twice, data = orders**2 * plain, self._data

        def total(by_data: Array, data: Array) -> Array:
            return np.asarray(np.einsum("sma,sma->s", by_data, data))

        found[:, ratio, ratio] = squared + total(2.0 * orders * low + twice, data.values)
        both = squared + total(orders * low, data.values + data.fixed) + total(twice, data.fixed)
        found[:, ratio, mean] = found[:, mean, ratio] = both
        found[:, mean, mean] = squared + total(2.0 * orders * low + twice, data.fixed)
        return found


class _Variable(NamedTuple):
    """A variable's place in the knot data; data that two segments share have one column and two places."""

    segment: int
    row: int  # of the segment's data, (10,)
    direction: Array  # of the derivative that it changes, (3,)
    column: int  # its index among the variables


_FreeData = tuple[Array, list[tuple[int, int]]]  # the direction of a variable, and its segments with rows


class _Layout(NamedTuple):
    """The order of the variables."""

    free: list[_Variable]  # the scaled derivatives at knots; those at the seam of a closed course come last
    band: int  # the number of scaled derivatives that only two neighbouring segments share: not at the seam
    mean_column: int  # the index of ln h, after the scaled derivatives and ln τ of all segments


@dataclass(frozen=True, eq=False)
class Spline:
    """The free variables of a piecewise polynomial path, and the path at which an optimization starts.

    At inner knots position to jerk are free, and snap. Neighbouring segments share one snap if rotors have
    lag, as thrusts cannot jump; otherwise each segment has its own. At the ends the body rate is zero, but
    the thrust may change. There jerk along the thrust is free unless `still_ends`, and snap: along the thrust
    only if rotors have lag. Ends with a free attitude have all derivatives free that the problem does not
    fix. A closed course has no ends: the knot at its seam is an inner knot.
    """

    task: Task
    initial: Trajectory  # the path at the start, of degree 9
    still_ends: bool = False  # whether the jerk is zero at the ends

    @property
    def segments(self) -> int:
        """The number S of segments."""
        return self.initial.segments

    @cached_property
    def mean_duration(self) -> float:
        """The mean segment duration h of the path at the start [s]."""
        return self.initial.duration / self.segments

    @cached_property
    def size(self) -> int:
        """The number n of variables."""
        return self.mean_column + 1

    @property
    def mean_column(self) -> int:
        """The index of the variable ln h."""
        return self._layout.mean_column

    @cached_property
    def ratio_columns(self) -> Indices:
        """The indices of the variables ln τ, (S,)."""
        return np.arange(self.mean_column - self.segments, self.mean_column)

    @property
    def columns(self) -> Indices:
        """The indices of each segment's local variables, (S, K + 2), padded with n."""
        return self._arranged[0]

    @cached_property
    def start(self) -> Array:
        """The variables of the path at the start, (n,)."""
        x = np.zeros(self.size)
        for segment, row, direction, column in self._layout.free:
            order = row % END_ORDER
            offset = direction @ (self._ends[segment, row] - self._fixed_data[segment, row])
            x[column] = offset * self.mean_duration**order / self._sizes[order]
        x[self.ratio_columns] = np.log(self.initial.durations / self.mean_duration)
        x[self.mean_column] = log(self.mean_duration)
        return x

    def trajectory(self, x: Array) -> Trajectory:
        """Return the path that variables (n,) give."""
        data = self.data(x)
        coefficients = TO_COEFFICIENTS @ data.values
        coefficients[:, 0] += self._origin
        return Trajectory(data.durations, coefficients, self.task.problem.heading.start)

    def data(self, x: Array) -> KnotData:
        """Return the knot data that variables (n,) give."""
        local = self.gathered(x)
        ratios = np.exp(local[:, -2])
        durations = ratios * np.exp(local[:, -1])
        fixed = (durations[:, None] ** ORDERS)[..., None] * self._fixed_data
        moved = (self._arranged[1] @ local[:, None, :-2, None])[..., 0]
        return KnotData(
            (ratios[:, None] ** ORDERS)[..., None] * moved + fixed, fixed, ratios, durations, self._origin
        )

    def motion(self, data: KnotData, places: Array) -> Motion:
        """Return the derivatives at places, as `KnotData.derivatives` does, with their Jacobian."""
        segments, scaled = self.segments, data.scaled(places)
        derivatives = data.motion_of(scaled)
        effect = (data.ratios[:, None] ** ORDERS)[..., None, None] * self._arranged[1]
        by_durations = np.stack([ORDERS[:, None] * each for each in (data.values, data.fixed)], axis=-1)
        moved = np.concatenate([effect, by_durations], axis=-1)
        jacobian = (scaled @ moved.reshape(segments, 2 * END_ORDER, -1)).reshape(*derivatives.shape, -1)
        jacobian[..., -2:] -= (POWERS * derivatives)[..., None]
        return Motion(derivatives, jacobian, scaled, data, effect)

    def gathered(self, step: Array) -> Array:
        """Return each segment's local part (S, K + 2) of a step (n,)."""
        return np.append(step, 0.0)[self.columns]

    def scattered(self, parts: Array) -> Array:
        """Return the sum (n,) of the segments' local vectors (S, K + 2)."""
        total = np.bincount(self.columns.ravel(), parts.ravel(), self.size + 1)
        return np.asarray(total[:-1], dtype=float)

    def assembled(self, blocks: Array) -> BorderedBand:
        """Return the matrix (n, n) that sums the segments' local symmetric blocks (S, K + 2, K + 2)."""
        pattern, lower, where = self._entries
        values = np.bincount(where, blocks[lower], pattern.entries)
        return BorderedBand(pattern, np.asarray(values, dtype=float))

    @cached_property
    def _entries(self) -> tuple[Pattern, Mask, Indices]:
        """The pattern of matrices, which entries of the blocks it stores (S, K + 2, K + 2), and where.

        The band holds what two neighbouring segments share, and is as wide as the variables of one segment.
        """
        rows, columns = self.columns[:, :, None], self.columns[:, None]
        lower = (columns <= rows) & (rows < self.size)
        in_band = lower & (rows < self._layout.band)
        pattern = Pattern(self.size, self.size - self._layout.band, int((rows - columns)[in_band].max()))
        where = pattern.index(*np.broadcast_arrays(rows, columns))
        return pattern, lower, where[lower]

    @property
    def _shared(self) -> int:
        """The number of derivatives that the two segments at a knot share, from position on."""
        return END_ORDER if self.task.vehicle.lags.any() else SNAP

    @cached_property
    def _sizes(self) -> Array:
        """The scale of each normalised derivative Y_k [m], from the largest specific thrust acting over h."""
        length = self.task.vehicle.max_specific_thrust * self.mean_duration**2 / perm(DEGREE, 2)
        return np.array([length * perm(DEGREE, k) for k in range(END_ORDER)])

    @cached_property
    def _origin(self) -> Array:
        """The whole kilometres [m] nearest to the start of the path, (3,).

        High derivatives are differences of positions: in coordinates of UTM they would be lost in rounding.
        """
        return np.asarray(np.round(self.initial.evaluate(0.0), -3))

    @cached_property
    def _ends(self) -> Array:
        """The derivatives of the path at the start, at both ends of all segments, (S, 10, 3).

        Derivatives that neighbours share are the mean of both sides.
        """
        ends = np.stack([self.initial.on_segments([0.0, 1.0], k) for k in range(END_ORDER)], axis=2)
        for before, after, shared in self._joints:
            met = (ends[after, 0, :shared] + ends[before, 1, :shared]) / 2.0
            ends[after, 0, :shared] = ends[before, 1, :shared] = met
        ends[:, :, 0] -= self._origin
        return np.asarray(ends.reshape(self.segments, 2 * END_ORDER, 3))

    @property
    def _joints(self) -> list[tuple[int, int, int]]:
        """The segments before and after each inner knot, and the number of derivatives that they share.

        At the seam of a closed course all derivatives are shared.
        """
        order = range(self.segments)
        inner = [(before, after, self._shared) for before, after in pairwise(order)]
        return [*inner, (order[-1], 0, END_ORDER)] if self.task.stages.closed else inner

    @cached_property
    def _fixed_data(self) -> Array:
        """The derivatives that the ends fix, in SI units, zero elsewhere, (S, 10, 3)."""
        fixed = np.zeros((self.segments, 2 * END_ORDER, 3))
        drag = lateral_drag(self.task.vehicle)
        for segment, first, state in self._end_states:
            for order in state.asked:
                fixed[segment, first + order] = state.derivatives(JERK)[order] - (order == 0) * self._origin
            if state.leaves_attitude_free:
                continue
            along = self._thrust_direction(state)
            if not self.still_ends:
                fixed[segment, first + JERK] = -drag * state.derivatives(JERK)[JERK - 1]
            if self._shared == END_ORDER:
                jerk = fixed[segment, first + JERK]
                fixed[segment, first + SNAP] = -drag * (jerk - float(along @ jerk) * along)
        return fixed

    @property
    def _end_states(self) -> tuple[tuple[int, int, EndState], ...]:
        """The segment, the row of position in the data, and the state of each end, if there are ends."""
        places = {"start": (0, 0), "goal": (self.segments - 1, END_ORDER)}
        return tuple((*places[name], state) for name, state in self.task.problem.ends.items())

    def _thrust_direction(self, state: EndState) -> Array:
        """Return the direction of the thrust at an end, (3,)."""
        thrust = self.task.balance.specific_thrust(state.velocity, state.acceleration)
        return np.asarray(thrust / np.linalg.norm(thrust))

    @cached_property
    def _layout(self) -> _Layout:
        """The order of the variables."""
        ends = [self._end_data(*end) for end in self._end_states] or [[], []]
        knots = [_knot_data(*joint) for joint in self._joints]
        inner, seam = knots[: self.segments - 1], knots[self.segments - 1 :]
        in_band = [*ends[0], *chain(*inner), *ends[1]]
        data = [*in_band, *chain(*seam)]
        free = [
            _Variable(segment, row, direction, column)
            for column, (direction, places) in enumerate(data)
            for segment, row in places
        ]
        return _Layout(free, len(in_band), len(data) + self.segments)

    def _end_data(self, segment: int, first: int, state: EndState) -> list[_FreeData]:
        """Return the free data of an end, whose position is the row `first` of a segment's data."""
        orders = END_ORDER if state.leaves_attitude_free else JERK
        free = [(order, axis) for order in range(orders) if order not in state.asked for axis in np.eye(3)]
        if not state.leaves_attitude_free:
            along = self._thrust_direction(state)
            free += [] if self.still_ends else [(JERK, along)]
            free += [(SNAP, axis) for axis in ([along] if self._shared == END_ORDER else np.eye(3))]
        return [(axis, [(segment, first + order)]) for order, axis in free]

    @cached_property
    def _arranged(self) -> tuple[Indices, Array]:
        """`columns`, and the slopes of each segment's data by its local variables, (S, 10, 3, K)."""
        free = self._layout.free
        local: list[dict[int, int]] = [{} for _ in range(self.segments)]
        for segment, _, _, column in free:
            local[segment].setdefault(column, len(local[segment]))
        widest = max(map(len, local))
        columns = np.full((self.segments, widest + 2), self.size, dtype=np.intp)
        effect = np.zeros((self.segments, 2 * END_ORDER, 3, widest))
        for segment, row, direction, column in free:
            place = local[segment][column]
            columns[segment, place] = column
            effect[segment, row, :, place] += direction * self._sizes[row % END_ORDER]
        columns[:, -2], columns[:, -1] = self.ratio_columns, self.mean_column
        return columns, effect


def _knot_data(before: int, after: int, shared: int) -> Iterator[_FreeData]:
    """Yield the free data at the knot between two segments, the first `shared` derivatives in common."""
    for order in range(END_ORDER):
        sides = [(before, END_ORDER + order), (after, order)]
        for places in [sides] if order < shared else [[side] for side in sides]:
            yield from ((axis, places) for axis in np.eye(3))
