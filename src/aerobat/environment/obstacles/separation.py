"""How far an ellipsoid is from convex pieces, by the plane that separates them best.

A body with centre c that is all c + L y with |y| ≤ 1 reaches |Lᵀ n| against a unit vector n. The gap between
it and a piece across planes with the normal n is φ(n) = n·c − |Lᵀ n| − h(n), with the piece's support h. Its
maximum over all n is the distance, where that is positive; where body and piece overlap it is how far they
have to be moved apart, negative. The gap of any n is a lower bound of the distance, however n was found.

It is found by Newton's method on the sphere. Kinks are smoothed: of the hull, max n·v → τ log Σ exp(n·v/τ),
and of flat roundings, |Lᵀ n| → √(|Lᵀ n|² + τ²), with τ falling to far less than a millimetre. Where a normal
that the method begins at has a larger gap, it is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.environment.obstacles.convex_piece import TINY, ConvexPiece

SMOOTHINGS = 2.0 ** -np.arange(20)
ROUNDEST = 0.1  # [m] τ at first: the last is a ten millionth of a metre
STEPS = 3  # of Newton's method in a round
LONGEST_STEP = 0.5  # [rad]
HALVINGS = 16  # of a step that leads to less: kinks that are hardly smoothed are missed by long ones
LEAST_GAIN = 1e-10  # [m] that a step is worth taking for


@dataclass(frozen=True, eq=False)
class Separation:
    """Planes between bodies and pieces, a pair a row."""

    normals: Array  # unit vectors from the piece to the body, (m, 3)
    offsets: Array  # [m] of the plane along them that touches the piece, h(n), (m,)
    gaps: Array  # [m] between body and piece across the plane, (m,)


@dataclass(frozen=True, eq=False)
class Pieces:
    """All convex pieces of a world, as arrays."""

    pieces: tuple[ConvexPiece, ...]

    def __len__(self) -> int:
        return len(self.pieces)

    def near(self, centres: Array, reach: float, within: float) -> tuple[Indices, Indices]:
        """Return the pairs of bodies and pieces that may be near, as numbers of bodies and of pieces.

        Args:
            centres: Of the bodies [m], (m, 3).
            reach: Of a body from its centre in whichever direction, at most [m].
            within: The distance [m] between body and piece from which on a pair is left out.
        """
        bodies, pieces = np.nonzero(self.box_distances(centres) < reach + within)
        return bodies, pieces

    def box_distances(self, points: Array) -> Array:
        """Return the distances [m] of points (m, 3) from the boxes around all pieces, (m, P)."""
        lower, upper = self._boxes
        beyond = np.maximum(np.maximum(lower - points[:, None], points[:, None] - upper), 0.0)
        return np.asarray(np.linalg.norm(beyond, axis=-1))

    def holding(self, point: Array) -> ConvexPiece | None:
        """Return a piece that a point [m] (3,) lies in; None where it lies in none."""
        _, pieces = self.near(point[None], 0.0, TINY) if self.pieces else (None, np.zeros(0, dtype=np.intp))
        count = len(pieces)
        found = self.separated(pieces, np.tile(point, (count, 1)), np.zeros((count, 3, 3)))
        inside = pieces[found.gaps < 0.0]
        return self.pieces[inside[0]] if len(inside) else None

    def separated(
        self, pieces: Indices, centres: Array, shapes: Array, exact_within: float = inf
    ) -> Separation:
        """Separate bodies from pieces, pair by pair.

        Args:
            pieces: The number of each pair's piece, (m,).
            centres: Of each pair's body [m], (m, 3).
            shapes: L of each pair's body [m], (m, 3, 3).
            exact_within: The gap [m] beyond which a plane between will do that is not the best.
        """
        if not len(pieces):
            return Separation(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
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

    def distances(self, points: Array) -> Array:
        """Return lower bounds of the distances of points (m, 3) to all pieces [m], (m,)."""
        found = [piece.distances(points) for piece in self.pieces]
        return np.asarray(np.min(found, axis=0)) if found else np.full(len(points), inf)

    @cached_property
    def largest(self) -> float:
        """The largest magnitude of any piece's coordinates [m], at most: what rounding is a part of."""
        return float(np.abs(self._boxes).max(initial=0.0))

    @cached_property
    def _points(self) -> Array:
        """The points of every piece, the first of them repeated where it has fewer than others, (P, V, 3)."""
        return _padded([piece.points for piece in self.pieces])

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
    """Bodies and pieces: from the piece's points to the body's centre, and both roundings."""

    offsets: Array  # c − v [m], (m, V, 3)
    roundings: Array  # L of the pieces [m], (m, 3, 3)
    shapes: Array  # L of the bodies [m], (m, 3, 3)

    def __getitem__(self, rows: Mask | Indices) -> _Pairs:
        return _Pairs(self.offsets[rows], self.roundings[rows], self.shapes[rows])

    def gaps(self, normals: Array) -> Array:
        """The gaps [m] across planes with these normals, (m, k, 3) -> (m, k)."""
        nearest = (normals @ np.swapaxes(self.offsets, 1, 2)).min(axis=-1)
        rounded = np.linalg.norm(normals @ self.roundings, axis=-1)
        return np.asarray(nearest - rounded - np.linalg.norm(normals @ self.shapes, axis=-1))

    def extents(self, normals: Array) -> Array:
        """How far bodies reach [m] against normals, (m, 3) -> (m,)."""
        return np.asarray(np.linalg.norm(_times(np.swapaxes(self.shapes, 1, 2), normals), axis=-1))

    def refined(self, normals: Array) -> Array:
        """The normals across which the gaps are largest, from some nearby, (m, 3)."""
        best, most = normals, self.gaps(normals[:, None])[:, 0]
        for smoothing in ROUNDEST * SMOOTHINGS:
            for _ in range(STEPS):
                normals = self._improved(normals, smoothing)
            gaps = self.gaps(normals[:, None])[:, 0]
            better = gaps > most
            best, most = np.where(better[:, None], normals, best), np.where(better, gaps, most)
        return best

    def _improved(self, normals: Array, smoothing: float) -> Array:
        """Normals one step of Newton's method later."""
        value, gradient, curvature = self._smoothed(normals, smoothing)
        tangent = np.eye(3) - normals[:, :, None] * normals[:, None]
        along = np.sum(gradient * normals, axis=-1)
        bend = -tangent @ curvature @ tangent
        bend += np.maximum(along, 0.01)[:, None, None] * tangent + normals[:, :, None] * normals[:, None]
        step = np.linalg.solve(bend, (tangent @ gradient[..., None]))[..., 0]
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, TINY))
        better, pending = normals.copy(), np.flatnonzero(np.sum(gradient * step, axis=-1) > LEAST_GAIN)
        for halving in range(HALVINGS):
            tried = normals[pending] + 0.5**halving * step[pending]
            tried /= np.linalg.norm(tried, axis=-1, keepdims=True)
            gains = self[pending]._value(tried, smoothing) > value[pending]
            better[pending[gains]] = tried[gains]
            pending = pending[~gains]
            if not len(pending):
                break
        return better

    def _value(self, normals: Array, smoothing: float) -> Array:
        """The smoothed gaps [m], (m,)."""
        exponents = -_times(self.offsets, normals) / smoothing
        largest = exponents.max(axis=-1)
        log_sum = largest + np.log(np.exp(exponents - largest[:, None]).sum(axis=-1))
        extents = [_smoothed_extents(root, normals, smoothing) for root in (self.roundings, self.shapes)]
        return np.asarray(-smoothing * log_sum - sum(extents))

    def _smoothed(self, normals: Array, smoothing: float) -> tuple[Array, Array, Array]:
        """The smoothed gaps, their slopes (m, 3) and second derivatives (m, 3, 3)."""
        exponents = -_times(self.offsets, normals) / smoothing
        weights = np.exp(exponents - exponents.max(axis=-1, keepdims=True))
        weights /= weights.sum(axis=-1, keepdims=True)
        mean = np.einsum("mv,mvi->mi", weights, self.offsets)
        spread = self.offsets - mean[:, None]
        gradient = mean
        curvature = -np.swapaxes(weights[..., None] * spread, 1, 2) @ spread / smoothing
        for root in (self.roundings, self.shapes):
            square = root @ np.swapaxes(root, 1, 2)
            reach = _smoothed_extents(root, normals, smoothing)
            touching = _times(square, normals) / reach[:, None]
            gradient = gradient - touching
            flat = square - touching[:, :, None] * touching[:, None]
            curvature = curvature - flat / reach[:, None, None]
        return self._value(normals, smoothing), gradient, curvature


def _best_of(piece: ConvexPiece, centres: Array, shapes: Array) -> Array:
    """Of the directions to bodies that a piece knows, those with the largest gap, (m, 3)."""
    offsets = centres[:, None] - piece.points
    length = np.maximum(np.linalg.norm(offsets, axis=-1, keepdims=True), TINY)
    candidates = np.concatenate([piece.normals_toward(centres), offsets / length], axis=1)
    roundings = np.broadcast_to(piece.rounding, (len(centres), 3, 3))
    best = np.argmax(_Pairs(offsets, roundings, shapes).gaps(candidates), axis=1)
    return np.asarray(np.take_along_axis(candidates, best[:, None, None], axis=1)[:, 0])


def _smoothed_extents(roots: Array, normals: Array, smoothing: float) -> Array:
    """How far all L y with |y| ≤ 1 reach [m] along normals, without the kink that flat ones have, (m,)."""
    reach = np.linalg.norm(_times(np.swapaxes(roots, 1, 2), normals), axis=-1)
    return np.asarray(np.hypot(reach, smoothing))


def _times(matrices: Array, vectors: Array) -> Array:
    """Matrices (m, k, 3) times vectors (m, 3), (m, k)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _padded(rows: Sequence[Array]) -> Array:
    """Arrays (k, 3) of different lengths as one, the first row of each repeated."""
    most = max(map(len, rows))
    return np.array([np.concatenate([each, np.repeat(each[:1], most - len(each), axis=0)]) for each in rows])
