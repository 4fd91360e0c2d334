"""Polynomials of degree 9 between knots, as functions of free variables: what a refinement moves.

With h a mean duration, the k-th derivative of position at a knot is Y_k/h^k, and a segment lasts τ h. The
variables are the Y_k at the knots, scaled to a size of one, ln τ of every segment and ln h: with all others
held, h changes how fast a path is flown and not the path. What ends fix, they fix in SI units. On a segment
of duration T = τ h the normalised data of both its knots are Z_m = τ^m Y_m + T^m fixed_m. The k-th derivative
of the motion that the data make is

    D_k(s) = T^-k Σ_m B_km(s) Z_m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import log, perm

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.flatness import lateral_drag
from aerobat.planning.task import Task
from aerobat.problem.end_state import EndState
from aerobat.trajectory import Trajectory, polynomial

END_ORDER = 5  # derivatives at either end of a segment that make its polynomial: position to snap
DEGREE = 2 * END_ORDER - 1
DERIVATIVES = 6  # position to crackle
JERK, SNAP = 3, 4
TO_COEFFICIENTS = polynomial.hermite(np.eye(2 * END_ORDER)[:END_ORDER], np.eye(2 * END_ORDER)[END_ORDER:])
ORDERS = np.tile(np.arange(float(END_ORDER)), 2)  # of the derivatives at both ends
POWERS = np.arange(float(DERIVATIVES))[:, None]  # k


def basis(fractions: Array) -> Array:
    """Return B: derivatives by normalised time, at fractions (..., p), of data at knots, (..., p, 6, 10)."""
    powers = [
        np.stack([perm(p, k) * fractions ** max(p - k, 0) for p in range(DEGREE + 1)], axis=-1)
        for k in range(DERIVATIVES)
    ]
    return np.stack(powers, axis=-2) @ TO_COEFFICIENTS


@dataclass(frozen=True, eq=False)
class Motion:
    """Derivatives of position at places of all segments, and how they follow from the variables.

    A segment's local variables are those of its knots, K of them, its ln τ, and ln h.
    """

    derivatives: Array  # (S, p, 6, 3)
    slopes: Array  # by local variables, (S, p, 6, 3, K + 2)
    _scaled: Array  # T^-k B, (S, p, 6, 10)
    _by_knots: Array  # the same times τ^m
    _data: Array  # Z, (S, 10, 3)
    _fixed: Array  # its part that is fixed in SI units
    _effect: Array  # of local variables on Y, (S, 10, 3, K)

    def curvature(self, weights: Array) -> Array:
        """Second derivatives of Σ weights · derivatives, weights (S, p, 6, 3), by local variables."""
        count = self._effect.shape[-1]
        found = np.zeros((len(weights), count + 2, count + 2))
        ratio, mean = count, count + 1
        lowered = -POWERS * weights
        plain, low = (np.einsum("spka,spkm->sma", each, self._by_knots) for each in (weights, lowered))
        by_ratio = np.einsum("sma,smaK->sK", ORDERS[:, None] * plain + low, self._effect)
        by_mean = np.einsum("sma,smaK->sK", low, self._effect)
        found[:, :count, ratio] = found[:, ratio, :count] = by_ratio
        found[:, :count, mean] = found[:, mean, :count] = by_mean
        once, once_fixed, twice, twice_fixed = (
            self._scaled @ (ORDERS[:, None] ** power * data)[:, None]
            for power in (1, 2)
            for data in (self._data, self._fixed)
        )
        squared = POWERS**2 * self.derivatives

        def total(values: Array) -> Array:
            return np.asarray(np.sum(weights * values, axis=(1, 2, 3)))

        found[:, ratio, ratio] = total(squared - 2.0 * POWERS * once + twice)
        both = total(squared - POWERS * (once + once_fixed) + twice_fixed)
        found[:, ratio, mean] = found[:, mean, ratio] = both
        found[:, mean, mean] = total(squared - 2.0 * POWERS * once_fixed + twice_fixed)
        return found


@dataclass(frozen=True, eq=False)
class Spline:
    """The variables of a problem's polynomials, and the path that begins there.

    Free are position to jerk at the inner knots, and snap: one for both neighbours if rotors lag, whose
    thrusts cannot jump, else one for each. At the ends the body does not turn but its thrust may be
    changing: free are jerk along the thrust, unless ends are still, and snap along it if rotors lag, else
    all of it; where any attitude will do, all from acceleration on. A closed course has no ends: the knot at
    its seam is an inner one.
    """

    task: Task
    begun: Trajectory  # of degree 9
    still_ends: bool = False

    @property
    def segments(self) -> int:
        """Their number S."""
        return self.begun.segments

    @cached_property
    def mean_duration(self) -> float:
        """h of the path that it begins with [s]."""
        return self.begun.duration / self.segments

    @cached_property
    def size(self) -> int:
        """The number n of variables."""
        return self.mean_column + 1

    @property
    def mean_column(self) -> int:
        """The variable ln h."""
        return self._layout[2]

    @cached_property
    def ratio_columns(self) -> Indices:
        """The variables ln τ, (S,)."""
        return np.array(self._layout[1], dtype=np.intp)

    @property
    def columns(self) -> Indices:
        """The variables of each segment, (S, K + 2); -1 in place of those that a segment lacks."""
        return self._arranged[0]

    @cached_property
    def start(self) -> Array:
        """The variables of the path that it begins with, (n,)."""
        x = np.zeros(self.size)
        for segment, row, direction, column in self._layout[0]:
            order = row % END_ORDER
            offset = direction @ (self._ends[segment, row] - self._fixed_data[segment, row])
            x[column] = offset * self.mean_duration**order / self._sizes[order]
        x[self.ratio_columns] = np.log(self.begun.durations / self.mean_duration)
        x[self.mean_column] = log(self.mean_duration)
        return x

    def trajectory(self, x: Array) -> Trajectory:
        """The path of variables (n,)."""
        data, _, _, durations = self._data(x)
        return Trajectory(durations, TO_COEFFICIENTS @ data, self.task.problem.heading.start)

    def derivatives(self, x: Array, places: Array) -> Array:
        """Derivatives of position (S, p, 6, 3) at places, (S, p, 6, 10) or (p, 6, 10) as `basis` has them."""
        data, _, _, durations = self._data(x)
        scaled = places * (durations[:, None] ** -POWERS[:, 0])[:, None, :, None]
        return np.asarray(scaled @ data[:, None])

    def motion(self, x: Array, places: Array) -> Motion:
        """The same with their slopes."""
        data, fixed, ratios, durations = self._data(x)
        effect = self._arranged[1]
        scaled = places * (durations[:, None] ** -POWERS[:, 0])[:, None, :, None]
        derivatives = scaled @ data[:, None]
        by_knots = scaled * (ratios[:, None] ** ORDERS)[:, None, None]
        segments, count, local = len(data), places.shape[-3], effect.shape[-1]
        slopes = np.empty((segments, count, DERIVATIVES, 3, local + 2))
        flat = by_knots.reshape(segments, count * DERIVATIVES, -1) @ effect.reshape(
            segments, 2 * END_ORDER, -1
        )
        slopes[..., :local] = flat.reshape(segments, count, DERIVATIVES, 3, local)
        for column, moved in ((local, data), (local + 1, fixed)):
            slopes[..., column] = scaled @ (ORDERS[:, None] * moved)[:, None] - POWERS * derivatives
        return Motion(derivatives, slopes, scaled, by_knots, data, fixed, effect)

    def gathered(self, step: Array) -> Array:
        """Each segment's own part of a step (n,), (S, K + 2)."""
        return np.append(step, 0.0)[self.columns]

    def scattered(self, parts: Array) -> Array:
        """The sum (n,) of segments' parts (S, K + 2)."""
        total = np.zeros(self.size + 1)
        np.add.at(total, self.columns, parts)
        return total[:-1]

    def assembled(self, blocks: Array) -> Array:
        """The sum (n, n) of segments' blocks (S, K + 2, K + 2)."""
        total = np.zeros((self.size + 1, self.size + 1))
        for columns, block in zip(self.columns, blocks, strict=True):
            total[np.ix_(columns, columns)] += block
        return total[:-1, :-1]

    def _data(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Z (S, 10, 3), its part that is fixed in SI units, τ (S,) and durations [s] (S,)."""
        local = self.gathered(x)
        ratios = np.exp(local[:, -2])
        durations = ratios * np.exp(local[:, -1])
        fixed = (durations[:, None] ** ORDERS)[..., None] * self._fixed_data
        moved = (self._arranged[1] @ local[:, None, :-2, None])[..., 0]
        return (ratios[:, None] ** ORDERS)[..., None] * moved + fixed, fixed, ratios, durations

    @property
    def _shared(self) -> int:
        """The number of derivatives that both neighbours of a knot share."""
        return END_ORDER if self.task.vehicle.lags.any() else SNAP

    @cached_property
    def _sizes(self) -> Array:
        """What one is of each normalised derivative [m]: what the greatest specific thrust does in h."""
        length = self.task.vehicle.max_specific_thrust * self.mean_duration**2 / perm(DEGREE, 2)
        return np.array([length * perm(DEGREE, k) for k in range(END_ORDER)])

    @cached_property
    def _ends(self) -> Array:
        """The derivatives of the path that it begins with at both ends of all segments, (S, 10, 3)."""
        ends = np.stack([self.begun.on_segments([0.0, 1.0], k) for k in range(END_ORDER)], axis=2)
        for before, after, shared in self._joints:
            met = (ends[after, 0, :shared] + ends[before, 1, :shared]) / 2.0
            ends[after, 0, :shared] = ends[before, 1, :shared] = met
        return np.asarray(ends.reshape(self.segments, 2 * END_ORDER, 3))

    @property
    def _joints(self) -> list[tuple[int, int, int]]:
        """Segments before and after each inner knot, and how many derivatives they share: all at a seam."""
        order = range(self.segments)
        inner = [(before, after, self._shared) for before, after in pairwise(order)]
        return [*inner, (order[-1], 0, END_ORDER)] if self.task.stages.closed else inner

    @cached_property
    def _fixed_data(self) -> Array:
        """What the ends fix of the derivatives, in SI units, zero elsewhere, (S, 10, 3)."""
        fixed = np.zeros((self.segments, 2 * END_ORDER, 3))
        drag = lateral_drag(self.task.vehicle)
        for segment, first, state in self._end_states:
            for order in state.asked:
                fixed[segment, first + order] = state.derivatives(JERK)[order]
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
        """The segment, the row of its position and the state of both ends, if there are any."""
        places = {"start": (0, 0), "goal": (self.segments - 1, END_ORDER)}
        return tuple((*places[name], state) for name, state in self.task.problem.ends.items())

    def _thrust_direction(self, state: EndState) -> Array:
        """Where the thrust points at an end, (3,)."""
        thrust = self.task.balance.specific_thrust(state.velocity, state.acceleration)
        return np.asarray(thrust / np.linalg.norm(thrust))

    @cached_property
    def _layout(self) -> tuple[list[tuple[int, int, Array, int]], list[int], int]:
        """Segment, row, direction and column of all data that variables move; columns of ln τ; of ln h."""
        moved: list[tuple[int, int, Array, int]] = []
        ratios: list[int] = []
        count = 0

        def add(direction: Array, *where: tuple[int, int]) -> None:
            nonlocal count
            moved.extend((segment, row, direction, count) for segment, row in where)
            count += 1

        start, goal = self._end_states or ((), ())
        for direction, *where in self._end_variables(*start) if start else ():
            add(direction, *where)
        joints = {before: (after, shared) for before, after, shared in self._joints}
        for before in range(self.segments):
            ratios.append(count)
            count += 1
            after, shared = joints.get(before, (0, 0))
            for order in range(END_ORDER if before in joints else 0):
                sides = [(before, END_ORDER + order), (after, order)]
                for where in [sides] if order < shared else [[side] for side in sides]:
                    for axis in np.eye(3):
                        add(axis, *where)
        for direction, *where in self._end_variables(*goal) if goal else ():
            add(direction, *where)
        return moved, ratios, count

    def _end_variables(
        self, segment: int, first: int, state: EndState
    ) -> list[tuple[Array, tuple[int, int]]]:
        """The directions in which an end's data are free, each with its segment and row."""
        orders = range(END_ORDER if state.leaves_attitude_free else JERK)
        free: list[tuple[Array, tuple[int, int]]] = [
            (axis, (segment, first + order))
            for order in orders
            if order not in state.asked
            for axis in np.eye(3)
        ]
        if state.leaves_attitude_free:
            return free
        along = self._thrust_direction(state)
        if not self.still_ends:
            free.append((along, (segment, first + JERK)))
        if self._shared == END_ORDER:
            free.append((along, (segment, first + SNAP)))
        else:
            free.extend((axis, (segment, first + SNAP)) for axis in np.eye(3))
        return free

    @cached_property
    def _arranged(self) -> tuple[Indices, Array]:
        """`columns`, and the effect of each segment's variables on its data, (S, 10, 3, K)."""
        moved, ratios, mean = self._layout
        local: list[dict[int, int]] = [{} for _ in range(self.segments)]
        for segment, _, _, column in moved:
            local[segment].setdefault(column, len(local[segment]))
        widest = max(map(len, local))
        columns = np.full((self.segments, widest + 2), -1, dtype=np.intp)
        effect = np.zeros((self.segments, 2 * END_ORDER, 3, widest))
        for segment, row, direction, column in moved:
            place = local[segment][column]
            columns[segment, place] = column
            effect[segment, row, :, place] += direction * self._sizes[row % END_ORDER]
        columns[:, -2], columns[:, -1] = ratios, mean
        return columns, effect
