"""The distance between an ellipsoid and convex pieces, by the plane that separates them best.

A body with centre c and points c + L y, |y| ≤ 1, extends by |Lᵀ n| against a unit vector n. The gap between
the body and a piece across planes with the normal n is φ(n) = n·c − |Lᵀ n| − h(n), with the piece's support
h. Where the maximum over all n is positive, it is the distance. Where body and piece overlap, it is negative:
minus the penetration depth. The gap for any n is a lower bound of the distance.

The maximum is found by Newton's method on the sphere. The kinks of the hull are kept in the model: near n,
the gap is the minimum of some planes, one for each point of the hull that nearly touches, minus a paraboloid
for the curvature of the two roundings. The maximum of the model is where one, two or three of its planes
meet. Where the normals of the hull's own faces have a larger gap, the search starts there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.environment.obstacles.convex_piece import TINY, ConvexPiece, ObstacleMotion, units

MAX_STEPS = 40  # limit of Newton steps; most pairs take five
MIN_GAIN = 1e-11  # [m] gain below which a step is the last
INITIAL_POINTS = 4  # points of a hull in the first model: as many as touch a plane along a box's side
MAX_ADDED_POINTS = 3  # points added to the model, one by one, for hulls with more points
LENGTH_SMOOTHING = 1e-4  # [m] smoothing of lengths, whose slopes jump at zero
MAX_STEP_ANGLE = 0.5  # [rad]
STEP_FRACTIONS = np.array([0.0, 1.0, 0.5, 0.25, 0.1, 0.02])  # fractions of a step that are tried
MIN_CURVATURE = 0.01  # [m] smallest curvature of a gap on the sphere in the model, also where bodies overlap
VANISHING = 1e-30  # [m²]


@dataclass(frozen=True, eq=False)
class Separation:
    """Planes between bodies and pieces, one row for each pair."""

    normals: Array  # unit vectors from the piece to the body, (m, 3)
    # [m] h(n): offset along the normal of the plane that touches the piece at its initial place, (m,)
    offsets: Array
    gaps: Array  # [m] between body and piece across the plane, (m,)


@dataclass(frozen=True, eq=False)
class Pieces:
    """All convex pieces of an environment, as arrays.

    With times [s], pieces are at their places at these times, else at their initial places.
    """

    pieces: tuple[ConvexPiece, ...]

    def __len__(self) -> int:
        return len(self.pieces)

    @property
    def still(self) -> Pieces:
        """The pieces that never move."""
        return Pieces(tuple(piece for piece in self.pieces if piece.motion is None))

    @cached_property
    def moving(self) -> tuple[tuple[int, ObstacleMotion], ...]:
        """The indices and motions of the moving pieces."""
        return tuple((k, piece.motion) for k, piece in enumerate(self.pieces) if piece.motion is not None)

    def moved(self, pieces: Indices, times: Array) -> Array:
        """Return the displacements [m] of pieces (m,) at times (m, ...), (m, ..., 3)."""
        found = np.zeros((*times.shape, 3))
        for number, motion in self.moving:
            own = np.broadcast_to(pieces.reshape(-1, *[1] * (times.ndim - 1)) == number, times.shape)
            found[own] = motion.moved(times[own])
        return found

    def near(
        self, centres: Array, reach: float, within: float, times: Array | None = None
    ) -> tuple[Indices, Indices]:
        """Return the pairs of bodies and pieces that may be near, as indices of bodies and of pieces.

        Args:
            centres: Centres of the bodies [m], (m, 3).
            reach: Upper bound of a body's extent from its centre in any direction [m].
            within: Distance [m] between body and piece beyond which a pair is left out.
            times: Times of the bodies [s], (m,).
        """
        over = None if times is None else (times, times)
        bodies, pieces = np.nonzero(self.box_distances(centres, centres, over) < reach + within)
        return bodies, pieces

    def box_distances(self, lower: Array, upper: Array, over: tuple[Array, Array] | None = None) -> Array:
        """Return lower bounds of the distances between boxes and all pieces [m], from the pieces' boxes.

        Args:
            lower: Lower corners [m], (..., 3).
            upper: Upper corners [m], (..., 3).
            over: Start and end of each box's time interval [s], (...) each.

        Returns:
            Distances (..., P).
        """
        own_lower, own_upper = self._boxes
        if over is not None and self.moving:
            own_lower, own_upper = self._boxes_over(*over, lower.shape[:-1])
        squares: Array = np.zeros((*lower.shape[:-1], len(self)))
        for k in range(3):  # faster than a last axis of three
            between = np.maximum(
                own_lower[..., k] - upper[..., None, k], lower[..., None, k] - own_upper[..., k]
            )
            squares += np.maximum(between, 0.0) ** 2
        return np.sqrt(squares)

    def holding(self, point: Array) -> ConvexPiece | None:
        """Return a piece that contains a point [m] (3,), or None."""
        _, pieces = self.near(point[None], 0.0, TINY)
        count = len(pieces)
        found = self.separated(pieces, np.tile(point, (count, 1)), np.zeros((count, 3, 3)))
        inside = pieces[found.gaps < 0.0]
        return self.pieces[inside[0]] if len(inside) else None

    def _boxes_over(self, begin: Array, end: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Return the corners of the boxes around all pieces over times (...), (..., P, 3) each."""
        lower, upper = (np.broadcast_to(each, (*shape, *each.shape)).copy() for each in self._boxes)
        for number, motion in self.moving:
            least, most = motion.reach(begin, end)
            lower[..., number, :] += least
            upper[..., number, :] += most
        return lower, upper

    def separated(
        self,
        pieces: Indices,
        centres: Array,
        shapes: Array,
        exact_within: float = inf,
        times: Array | None = None,
    ) -> Separation:
        """Separate bodies from pieces, pair by pair; planes refer to the pieces' initial places.

        Args:
            pieces: The index of each pair's piece, (m,).
            centres: The centre of each pair's body [m], (m, 3).
            shapes: L of each pair's body [m], (m, 3, 3).
            exact_within: The gap [m] beyond which any separating plane is enough, not the best one.
            times: Times of the pairs [s], (m,).
        """
        if not len(pieces):
            return Separation(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
        if times is not None and self.moving:
            centres = centres - self.moved(pieces, times)
        normals = np.empty_like(centres)
        for number in np.unique(pieces):
            own = pieces == number
            normals[own] = _best_of(self.pieces[number], centres[own], shapes[own])
        pairs = _Pairs(centres[:, None] - self._points[pieces], self._roundings[pieces], shapes)
        near = pairs.gaps(normals[:, None])[:, 0] < exact_within
        if near.any():
            normals[near] = pairs[near].refined(normals[near])
        gaps = pairs.gaps(normals[:, None])[:, 0]
        return Separation(normals, np.sum(normals * centres, axis=-1) - pairs.extents(normals) - gaps, gaps)

    def distances(self, points: Array, exact_within: float = inf, times: Array | None = None) -> Array:
        """Return lower bounds of the distances to all pieces [m], (m,), or to boxes around them.

        Args:
            points: The points [m], (m, 3).
            exact_within: The distance [m] from a piece's box beyond which the distance from the box is
                enough.
            times: Times of the points [s], (m,).
        """
        found = self.box_distances(points, points, None if times is None else (times, times))
        for number, near in enumerate((found < exact_within).T):
            if near.any():
                moved = 0.0 if times is None else self.moved(np.full(near.sum(), number), times[near])
                found[near, number] = self.pieces[number].distances(points[near] - moved)
        return np.asarray(found.min(axis=1, initial=inf))

    @cached_property
    def largest(self) -> float:
        """The largest magnitude of any piece's coordinates [m], for bounds of rounding errors."""
        return float(np.abs(self._boxes).max(initial=0.0))

    @cached_property
    def _points(self) -> Array:
        """The points of every piece, padded with the first point, (P, V, 3)."""
        rows = np.arange(max(len(piece.points) for piece in self.pieces))
        return np.array([piece.points[np.where(rows < len(piece.points), rows, 0)] for piece in self.pieces])

    @cached_property
    def _roundings(self) -> Array:
        return np.array([piece.rounding for piece in self.pieces])

    @cached_property
    def _boxes(self) -> tuple[Array, Array]:
        """The corners of the boxes around all pieces, (P, 3) each."""
        corners = np.array([piece.box for piece in self.pieces]).reshape(-1, 2, 3)
        return corners[:, 0], corners[:, 1]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Bodies and pieces: vectors from the piece's points to the body's centre, and both roundings."""

    offsets: Array  # c − v [m], (m, V, 3)
    roundings: Array  # L of the pieces [m], (m, 3, 3)
    shapes: Array  # L of the bodies [m], (m, 3, 3)

    def __getitem__(self, rows: Mask | Indices) -> _Pairs:
        return _Pairs(self.offsets[rows], self.roundings[rows], self.shapes[rows])

    def gaps(self, normals: Array) -> Array:
        """Return the gaps [m] across planes with these normals, (m, k, 3) -> (m, k)."""
        nearest = (normals @ np.swapaxes(self.offsets, 1, 2)).min(axis=-1)
        rounded = np.linalg.norm(normals @ self.roundings, axis=-1)
        return np.asarray(nearest - rounded - np.linalg.norm(normals @ self.shapes, axis=-1))

    def extents(self, normals: Array) -> Array:
        """Return the extents [m] of bodies against normals, (m, 3) -> (m,)."""
        return np.asarray(np.linalg.norm(_times(np.swapaxes(self.shapes, 1, 2), normals), axis=-1))

    def refined(self, normals: Array) -> Array:
        """Return the normals with the largest gaps, starting from these normals, (m, 3)."""
        found, gaps = normals.copy(), self.gaps(normals[:, None])[:, 0]
        rising = np.arange(len(normals))
        for _ in range(MAX_STEPS):
            better, most = self[rising]._improved(found[rising])
            gains = most - gaps[rising]
            found[rising], gaps[rising] = better, most
            rising = rising[gains > MIN_GAIN]
            if not len(rising):
                break
        return found

    def _improved(self, normals: Array) -> tuple[Array, Array]:
        """Return the normals after one step, (m, 3), and their gaps [m], (m,).

        The best of some fractions of the step to the model's maximum is taken.
        """
        across = _across(normals)
        turns = self._nearby(normals, across).best_turns
        lengths = np.linalg.norm(turns, axis=-1, keepdims=True)
        turns *= np.minimum(1.0, MAX_STEP_ANGLE / np.maximum(lengths, TINY))
        tried = normals[:, None] + STEP_FRACTIONS[:, None] * (turns[:, None] @ across)
        tried /= np.linalg.norm(tried, axis=-1, keepdims=True)
        gaps = self.gaps(tried)
        rows, best = np.arange(len(gaps)), np.argmax(gaps, axis=1)
        return tried[rows, best], gaps[rows, best]

    def _nearby(self, normals: Array, across: Array) -> _Model:
        """Return a model of the gaps near normals, for turns along two directions across each, (m, 2, 3)."""
        values, slopes = _times(self.offsets, normals), self.offsets @ np.swapaxes(across, 1, 2)
        curvature = np.zeros((len(normals), 2, 2))
        for root in (self.roundings, self.shapes):
            reach = _times(np.swapaxes(root, 1, 2), normals)
            length = np.hypot(np.linalg.norm(reach, axis=-1), LENGTH_SMOOTHING)
            along = across @ root
            slope = _times(along, reach / length[:, None])
            values, slopes = values - length[:, None], slopes - slope[:, None]
            flat = along @ np.swapaxes(along, 1, 2) - slope[:, :, None] * slope[:, None]
            curvature += flat / length[:, None, None]
        curvature += np.maximum(values.min(axis=1), MIN_CURVATURE)[:, None, None] * np.eye(2)
        return _Model(values, slopes, curvature)


@dataclass(frozen=True, eq=False)
class _Model:
    """A model of gaps near normals: for turns t, the minimum of all v + s·t, minus t·B t / 2."""

    values: Array  # v [m], (m, k)
    slopes: Array  # s [m], (m, k, 2)
    curvature: Array  # B [m], (m, 2, 2), positive definite

    @property
    def best_turns(self) -> Array:
        """The turns [rad] that maximize the model, (m, 2)."""
        chosen = np.argsort(self.values, axis=1, kind="stable")[:, :INITIAL_POINTS]
        turns = self._of(chosen)._best()
        for _ in range(MAX_ADDED_POINTS if self.values.shape[1] > INITIAL_POINTS else 0):
            least = np.argmin(self.values + _times(self.slopes, turns), axis=1)
            chosen = np.concatenate([chosen, least[:, None]], axis=1)
            turns = self._of(chosen)._best()
        return turns

    def _of(self, terms: Indices) -> _Model:
        """Return the model of some terms, (m, k)."""
        values = np.take_along_axis(self.values, terms, axis=1)
        return _Model(values, np.take_along_axis(self.slopes, terms[..., None], axis=1), self.curvature)

    def _best(self) -> Array:
        """Return the best of all candidates, (m, 2)."""
        turns = self._candidates
        planes = (self.values[:, None] + turns @ np.swapaxes(self.slopes, 1, 2)).min(axis=-1)
        gaps = planes - 0.5 * np.sum(turns @ self.curvature * turns, axis=-1)
        return np.asarray(turns[np.arange(len(gaps)), np.argmax(gaps, axis=1)])

    @property
    def _candidates(self) -> Array:
        """The maxima where one, two or three of the terms are smallest, (m, c, 2)."""
        inverse = np.linalg.inv(self.curvature)
        free = self.slopes @ inverse
        pairs, triples = _choices(self.values.shape[1])
        value, slope = self._beyond(*pairs)
        along = slope @ inverse
        required = value + np.sum(slope * free[:, pairs[0]], axis=-1)
        parts = required / _safe_divisor(np.sum(slope * along, axis=-1))
        (v, a), (w, b) = self._beyond(*triples[:2]), self._beyond(*triples[::2])
        twice = _safe_divisor(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
        corners = np.stack([w * a[..., 1] - v * b[..., 1], v * b[..., 0] - w * a[..., 0]], axis=-1)
        edges = free[:, pairs[0]] - parts[..., None] * along
        return np.concatenate([free, edges, corners / twice[..., None]], axis=1)

    def _beyond(self, first: Indices, second: Indices) -> tuple[Array, Array]:
        """Return the differences between terms: of their values (m, n) and slopes (m, n, 2)."""
        return self.values[:, first] - self.values[:, second], self.slopes[:, first] - self.slopes[:, second]


@lru_cache
def _choices(count: int) -> tuple[Indices, Indices]:
    """Return all choices of two and of three indices, (2, n) and (3, n)."""
    numbers = range(count)
    two, three = (np.array(list(combinations(numbers, k)), np.intp).reshape(-1, k).T for k in (2, 3))
    return two, three


def _across(normals: Array) -> Array:
    """Return two unit vectors across each normal, (m, 2, 3)."""
    least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, least)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, np.cross(normals, first)], axis=1)


def _safe_divisor(values: Array) -> Array:
    """Return divisors, with those near zero replaced by a huge number."""
    return np.where(np.abs(values) > VANISHING, values, 1.0 / VANISHING)


def _best_of(piece: ConvexPiece, centres: Array, shapes: Array) -> Array:
    """Return the direction with the largest gap among those known for each piece, (m, 3)."""
    offsets = centres[:, None] - piece.points
    candidates = np.concatenate([piece.normals_toward(centres), units(offsets)], axis=1)
    roundings = np.broadcast_to(piece.rounding, (len(centres), 3, 3))
    best = np.argmax(_Pairs(offsets, roundings, shapes).gaps(candidates), axis=1)
    return np.asarray(candidates[np.arange(len(best)), best])


def _times(matrices: Array, vectors: Array) -> Array:
    """Return matrices (m, k, 3) times vectors (m, 3), (m, k)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
