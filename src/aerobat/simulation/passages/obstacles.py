"""Flights past obstacles: the nearest obstacle on the way, or the first that the body touches.

The body is an ellipsoid that encloses the propellers. Its clearance is checked at every row of a flight (each
tick, for flights that are scored as they are flown), not between rows. Bounds keep exact checks rare: the
bounding boxes of stretches of a flight are far from most obstacle pieces, and a plane that separates body and
piece at one row bounds the clearance at the neighbouring rows from below. Only rows whose bound may still be
the minimum are checked exactly.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, Indices
from aerobat.declaration import by_value
from aerobat.environment.obstacles import Pieces
from aerobat.simulation.outcome import FlightFailure, Outcome
from aerobat.simulation.passages.passage import PerFlight
from aerobat.vehicle import Ellipsoid

ROWS_PER_BOX = 32  # rows that share a bounding box
CLEARANCE_TOLERANCE = 1e-5  # [m] tolerance by which the reported clearance may exceed the true minimum
MAX_PAIRS = 2**18  # stretches times pieces that are compared at once, which takes 20 MB
NO_CONTACT_ROW = np.iinfo(np.intp).max  # row number that stands for no contact


@by_value
class NearestObstacle(PerFlight):
    """The obstacle that a flight comes nearest to or, if it touches any, the first one that it touches."""

    obstacle: str  # its name; empty: unknown
    clearance: float  # [m] between body and obstacle; negative: they touch
    time: float  # [s] when that was

    @property
    def failure(self) -> FlightFailure | None:
        """The contact of one flight; None where there is none."""
        if not self.clearance < 0.0:
            return None
        return FlightFailure(self.time, Outcome.HIT_OBSTACLE, {"obstacle": self.obstacle})


class FlownBodies(NamedTuple):
    """States of the bodies of flights over time."""

    times: Array  # [s], (T,)
    position: Array  # [m] of their centres of mass, (flights, T, 3)
    q_world_body: Array  # (flights, T, 4)
    centre: Array  # [m] of their ellipsoids, body axes, (flights, 3)
    semi_axes: Array  # [m], (flights, 3)
    rows: NDArray[Any]  # number of rows of each flight that are valid, from the first, (flights,)


def nearest_obstacles(pieces: Pieces, flown: FlownBodies) -> NearestObstacle:
    """Return the nearest obstacles of many flights, fields (flights,), for one convex piece or more."""
    count = len(flown.rows)
    stretches = -(-len(flown.times) // ROWS_PER_BOX)
    size = max(1, MAX_PAIRS // (stretches * len(pieces)))
    found = [_NearestSearch(pieces, flown, slice(k, k + size)).found() for k in range(0, count, size)]
    piece, clearance, row = (np.concatenate(part) for part in zip(*found, strict=True))
    names = np.array([*(each.name for each in pieces.pieces), ""])  # the last name: none is known
    known = piece >= 0
    numbers: dict[str, Any] = {
        "obstacle": names[piece],
        "clearance": np.where(known, clearance, np.nan),
        "time": np.where(known, flown.times[row], np.nan),
    }
    return NearestObstacle(**numbers)


def nearest_in_log(
    pieces: Pieces, times: Array, position: Array, q_world_body: Array, body: Ellipsoid | None
) -> NearestObstacle | None:
    """Return the nearest obstacle of a logged flight; None where there are none, or no body is known.

    Args:
        pieces: The convex pieces of all obstacles.
        times: Of the log's rows [s], (T,).
        position: [m], (T, 3).
        q_world_body: (T, 4).
        body: The ellipsoid that encloses the vehicle.
    """
    if body is None or not len(pieces):
        return None
    size = body.centre[None], body.semi_axes[None]
    flown = FlownBodies(times, position[None], q_world_body[None], *size, np.array([len(times)]))
    return nearest_obstacles(pieces, flown).of_flight(0)


class _Encounters(NamedTuple):
    """Pairs of a stretch of a flight and a piece of an obstacle."""

    flight: Indices  # (m,)
    first: Indices  # its first row, (m,)
    piece: Indices  # (m,)

    def of(self, rows: Any) -> _Encounters:
        """Return the pairs of some rows."""
        return _Encounters(*(part[rows] for part in self))


class _NearestSearch:
    """The search for the nearest obstacles of some flights."""

    def __init__(self, pieces: Pieces, flown: FlownBodies, flights: slice) -> None:
        self._pieces = pieces
        self._times = flown.times
        self._position, self._attitude = flown.position[flights], flown.q_world_body[flights]
        self._centre, self._semi_axes = flown.centre[flights], flown.semi_axes[flights]
        last = np.maximum(flown.rows[flights].astype(np.intp) - 1, 0)
        self._last = last  # a flight keeps its last state
        self._piece = np.full(len(last), -1)
        self._clearance = np.full(len(last), inf)
        self._row = np.zeros(len(last), dtype=np.intp)
        self._touched = np.full(len(last), NO_CONTACT_ROW)  # first row known to touch an obstacle

    def found(self) -> tuple[Indices, Array, Indices]:
        """Return each flight's nearest piece (−1: unknown), its clearance [m] and row, (flights,)."""
        apart = self._gap_bounds
        self._check_rows(*self._nearest_boxes(apart))
        encounters = _Encounters(*np.nonzero(apart < np.maximum(self._clearance, 0.0)[:, None, None]))
        encounters = encounters._replace(first=encounters.first * ROWS_PER_BOX)
        middle = np.full(len(encounters.flight), ROWS_PER_BOX // 2)
        bounds, _ = self._separated(encounters, middle, exact_within=-inf)
        rows, ticks = self._nearest_per_flight(encounters, bounds, *self._candidate_pairs(encounters, bounds))
        while len(rows):
            bounds[rows] = np.maximum(bounds[rows], self._check_rows(encounters.of(rows), ticks))
            rows, ticks = self._candidate_pairs(encounters, bounds)
        return self._piece, self._clearance, np.minimum(self._row, self._last)

    @property
    def _gap_bounds(self) -> Array:
        """Lower bounds by boxes of the distance of bodies from pieces [m] over stretches, (flights, S, P)."""
        flights, rows, _ = self._position.shape
        padded = np.empty((3, flights, -(-rows // ROWS_PER_BOX) * ROWS_PER_BOX))
        padded[..., :rows] = np.moveaxis(self._position, -1, 0)
        for flight in np.flatnonzero(self._last < padded.shape[-1] - 1).tolist():
            last = self._last[flight]
            padded[:, flight, last + 1 :] = padded[:, flight, last, None]
        stretches = padded.reshape(3, flights, -1, ROWS_PER_BOX)
        lower, upper = (np.moveaxis(x, 0, -1) for x in (stretches.min(axis=-1), stretches.max(axis=-1)))
        reach = np.linalg.norm(self._centre, axis=-1) + self._semi_axes.max(axis=-1)
        begin = self._times[::ROWS_PER_BOX]
        end = self._times[np.minimum(np.arange(1, len(begin) + 1) * ROWS_PER_BOX, len(self._times)) - 1]
        over = np.broadcast_to(begin, lower.shape[:-1]), np.broadcast_to(end, lower.shape[:-1])
        apart = self._pieces.box_distances(lower, upper, over)
        return np.asarray(apart - reach[:, None, None])

    def _nearest_boxes(self, apart: Array) -> tuple[_Encounters, Indices]:
        """Return each flight's stretch and piece whose boxes are nearest, and the stretch's middle row."""
        flights, _, pieces = apart.shape
        best = np.argmin(apart.reshape(flights, -1), axis=1)
        known = np.flatnonzero(np.isfinite(apart).all(axis=(1, 2)))
        encounters = _Encounters(known, best[known] // pieces * ROWS_PER_BOX, best[known] % pieces)
        return encounters, np.full(len(known), ROWS_PER_BOX // 2)

    def _candidate_pairs(self, encounters: _Encounters, bounds: Array) -> tuple[Indices, Indices]:
        """Return the pairs that may be nearer than the best known clearance, and which row of each to check.

        Of flights that are known to touch, this is the first earlier row whose bound allows a contact.
        """
        touched = self._touched[encounters.flight]
        before = encounters.first[:, None] + np.arange(ROWS_PER_BOX) < touched[:, None]
        least = np.where(
            touched == NO_CONTACT_ROW, self._clearance[encounters.flight] - CLEARANCE_TOLERANCE, 0.0
        )
        may = before & (bounds < least[:, None])
        ticks = np.where(touched == NO_CONTACT_ROW, np.argmin(bounds, axis=1), np.argmax(may, axis=1))
        rows = np.flatnonzero(may.any(axis=1))
        return rows, ticks[rows]

    def _nearest_per_flight(
        self, encounters: _Encounters, bounds: Array, rows: Indices, ticks: Indices
    ) -> tuple[Indices, Indices]:
        """Return, of these rows and ticks, the nearest pair of each flight."""
        flights = encounters.flight[rows]
        order = np.lexsort((bounds[rows, ticks], flights))
        _, firsts = np.unique(flights[order], return_index=True)
        best = order[firsts]
        return rows[best], ticks[best]

    def _check_rows(self, encounters: _Encounters, ticks: Indices) -> Array:
        """Check one row of each pair exactly; return lower bounds for all rows, (m, ROWS_PER_BOX)."""
        bounds, gaps = self._separated(encounters, ticks)
        rows = encounters.first + ticks
        bounds[np.arange(len(ticks)), ticks] = np.maximum(bounds[np.arange(len(ticks)), ticks], gaps)
        touched = self._touched[encounters.flight]
        lower = gaps < self._clearance[encounters.flight]
        hit = (gaps < 0.0) & ((rows < touched) | ((rows == touched) & lower))
        order = np.lexsort((gaps, rows))[::-1]  # the last assignment wins: a flight's earliest row
        self._record(encounters, rows, gaps, order[hit[order]])
        np.minimum.at(self._touched, encounters.flight[hit], rows[hit])
        nearer = (self._touched[encounters.flight] == NO_CONTACT_ROW) & lower
        order = np.argsort(-gaps, kind="stable")
        self._record(encounters, rows, gaps, order[nearer[order]])
        return bounds

    def _record(self, encounters: _Encounters, rows: Indices, gaps: Array, chosen: Indices) -> None:
        flights = encounters.flight[chosen]
        self._piece[flights] = encounters.piece[chosen]
        self._clearance[flights] = gaps[chosen]
        self._row[flights] = rows[chosen]

    def _separated(
        self, encounters: _Encounters, ticks: Indices, exact_within: float = inf
    ) -> tuple[Array, Array]:
        """Return bounds for all rows, (m, ROWS_PER_BOX), by planes that separate at one, and its gaps."""
        flight, first, piece = encounters
        semi_axes, centre, last = self._semi_axes[flight], self._centre[flight], self._last[flight]
        row = np.minimum(first + ticks, last)
        q = self._attitude[flight, row]
        shapes = so3.axes(q) * semi_axes[:, None]
        centres = self._position[flight, row] + so3.rotate(q, centre)
        found = self._pieces.separated(piece, centres, shapes, exact_within, self._times[row])
        rows = np.minimum(first[:, None] + np.arange(ROWS_PER_BOX), last[:, None])
        position = self._position[flight[:, None], rows] - self._pieces.moved(piece, self._times[rows])
        normals = so3.unrotate(self._attitude[flight[:, None], rows], found.normals[:, None])
        reach = np.linalg.norm(normals * semi_axes[:, None], axis=-1)
        along = np.sum(position * found.normals[:, None], axis=-1)
        bounds = along + np.sum(normals * centre[:, None], axis=-1) - reach - found.offsets[:, None]
        return bounds, found.gaps
