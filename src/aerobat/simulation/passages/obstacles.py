"""Flights past obstacles: the nearest obstacle on the way, or the first that the body touches.

The body, an ellipsoid with its propellers inside, is judged at every row of a flight: a tick, in flights that
are scored as they are flown. What it moves between two ticks is not looked at. Few rows are separated from
few obstacles. Stretches of a flight lie in boxes, most far from every piece. A plane that separates at
one row bounds the clearance at its neighbours from below; only what may be nearer is looked at again.
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

STRETCH = 32  # rows that share a box
AS_NEAR = 1e-5  # [m] by which the clearance that is told may be above the least
AT_ONCE = 2**18  # stretches times pieces that are compared at once, 20 MB
NEVER = np.iinfo(np.intp).max  # the row of a contact that there is not


@by_value
class NearestObstacle(PerFlight):
    """The obstacle that a flight comes nearest to before it touches any, else the first that it touches."""

    obstacle: str  # its name; empty: unknown
    clearance: float  # [m] between body and obstacle; negative: they touch
    time: float  # [s] when that was

    @property
    def failure(self) -> FlightFailure | None:
        """One flight's contact; None where there is none."""
        if not self.clearance < 0.0:
            return None
        return FlightFailure(self.time, Outcome.HIT_OBSTACLE, {"obstacle": self.obstacle})


class FlownBodies(NamedTuple):
    """Bodies of flights over time."""

    times: Array  # [s], (T,)
    position: Array  # [m] of their centres of mass, (flights, T, 3)
    q_world_body: Array  # (flights, T, 4)
    centre: Array  # [m] of their ellipsoids, body axes, (flights, 3)
    semi_axes: Array  # [m], (flights, 3)
    rows: NDArray[Any]  # that count of each, the first ones, (flights,)


def nearest_obstacles(pieces: Pieces, flown: FlownBodies) -> NearestObstacle:
    """The nearest obstacles of many flights, fields (flights,).

    Args:
        pieces: Of all obstacles, at least one.
        flown: The flights.
    """
    count = len(flown.rows)
    stretches = -(-len(flown.times) // STRETCH)
    size = max(1, AT_ONCE // (stretches * len(pieces)))
    found = [_NearestSearch(pieces, flown, slice(k, k + size)).found() for k in range(0, count, size)]
    piece, clearance, row = (np.concatenate(part) for part in zip(*found, strict=True))
    names = np.array([*(each.name for each in pieces.pieces), ""])  # the last where none is known
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
    """The nearest obstacle of a flight that was logged; None where there are none, or no body is known.

    Args:
        pieces: Of all obstacles.
        times: Of the log's rows [s], (T,).
        position: [m], (T, 3).
        q_world_body: (T, 4).
        body: What encloses the vehicle.
    """
    if body is None or not len(pieces):
        return None
    size = body.centre[None], body.semi_axes[None]
    flown = FlownBodies(times, position[None], q_world_body[None], *size, np.array([len(times)]))
    return nearest_obstacles(pieces, flown).of_flight(0)


class _Encounters(NamedTuple):
    """Stretches of flights beside pieces."""

    flight: Indices  # (m,)
    first: Indices  # its first row, (m,)
    piece: Indices  # (m,)

    def of(self, rows: Any) -> _Encounters:
        """The encounters of some rows."""
        return _Encounters(*(part[rows] for part in self))


class _NearestSearch:
    """The search for the nearest obstacles of some flights."""

    def __init__(self, pieces: Pieces, flown: FlownBodies, flights: slice) -> None:
        self._pieces = pieces
        self._times = flown.times
        self._position, self._attitude = flown.position[flights], flown.q_world_body[flights]
        self._centre, self._semi_axes = flown.centre[flights], flown.semi_axes[flights]
        last = np.maximum(flown.rows[flights].astype(np.intp) - 1, 0)
        self._last = last  # a flight stays where it ends
        self._piece = np.full(len(last), -1)
        self._clearance = np.full(len(last), inf)
        self._row = np.zeros(len(last), dtype=np.intp)
        self._touched = np.full(len(last), NEVER)  # the first row that is known to

    def found(self) -> tuple[Indices, Array, Indices]:
        """Of each flight the piece, −1 where none is known, the clearance [m] and its row, (flights,)."""
        apart = self._apart
        self._look_at(*self._likeliest(apart))
        encounters = _Encounters(*np.nonzero(apart < np.maximum(self._clearance, 0.0)[:, None, None]))
        encounters = encounters._replace(first=encounters.first * STRETCH)
        middle = np.full(len(encounters.flight), STRETCH // 2)
        bounds, _ = self._separated(encounters, middle, exact_within=-inf)
        rows, ticks = self._best_of_flights(encounters, bounds, *self._nearer(encounters, bounds))
        while len(rows):
            bounds[rows] = np.maximum(bounds[rows], self._look_at(encounters.of(rows), ticks))
            rows, ticks = self._nearer(encounters, bounds)
        return self._piece, self._clearance, np.minimum(self._row, self._last)

    @property
    def _apart(self) -> Array:
        """How far at least bodies are from pieces [m] over each stretch, by boxes, (flights, S, P)."""
        flights, rows, _ = self._position.shape
        padded = np.empty((3, flights, -(-rows // STRETCH) * STRETCH))
        padded[..., :rows] = np.moveaxis(self._position, -1, 0)
        for flight in np.flatnonzero(self._last < padded.shape[-1] - 1).tolist():
            last = self._last[flight]
            padded[:, flight, last + 1 :] = padded[:, flight, last, None]
        stretches = padded.reshape(3, flights, -1, STRETCH)
        lower, upper = (np.moveaxis(x, 0, -1) for x in (stretches.min(axis=-1), stretches.max(axis=-1)))
        reach = np.linalg.norm(self._centre, axis=-1) + self._semi_axes.max(axis=-1)
        begin = self._times[::STRETCH]
        end = self._times[np.minimum(np.arange(1, len(begin) + 1) * STRETCH, len(self._times)) - 1]
        over = np.broadcast_to(begin, lower.shape[:-1]), np.broadcast_to(end, lower.shape[:-1])
        apart = self._pieces.apart(lower, upper, over)
        return np.asarray(apart - reach[:, None, None])

    def _likeliest(self, apart: Array) -> tuple[_Encounters, Indices]:
        """Of each flight the stretch and piece whose boxes are nearest, and the middle row of the stretch."""
        flights, _, pieces = apart.shape
        best = np.argmin(apart.reshape(flights, -1), axis=1)
        known = np.flatnonzero(np.isfinite(apart).all(axis=(1, 2)))
        encounters = _Encounters(known, best[known] // pieces * STRETCH, best[known] % pieces)
        return encounters, np.full(len(known), STRETCH // 2)

    def _nearer(self, encounters: _Encounters, bounds: Array) -> tuple[Indices, Indices]:
        """The encounters that may be nearer than what is known, and which row of each to look at.

        Of flights that are known to touch, the first row before that touches, if any does.
        """
        touched = self._touched[encounters.flight]
        before = encounters.first[:, None] + np.arange(STRETCH) < touched[:, None]
        least = np.where(touched == NEVER, self._clearance[encounters.flight] - AS_NEAR, 0.0)
        may = before & (bounds < least[:, None])
        ticks = np.where(touched == NEVER, np.argmin(bounds, axis=1), np.argmax(may, axis=1))
        rows = np.flatnonzero(may.any(axis=1))
        return rows, ticks[rows]

    def _best_of_flights(
        self, encounters: _Encounters, bounds: Array, rows: Indices, ticks: Indices
    ) -> tuple[Indices, Indices]:
        """Of the rows and ticks those of the nearest encounter of each flight."""
        flights = encounters.flight[rows]
        order = np.lexsort((bounds[rows, ticks], flights))
        _, firsts = np.unique(flights[order], return_index=True)
        best = order[firsts]
        return rows[best], ticks[best]

    def _look_at(self, encounters: _Encounters, ticks: Indices) -> Array:
        """Note how near one row of each encounter is, and return bounds for all rows, (m, STRETCH)."""
        bounds, gaps = self._separated(encounters, ticks)
        rows = encounters.first + ticks
        bounds[np.arange(len(ticks)), ticks] = np.maximum(bounds[np.arange(len(ticks)), ticks], gaps)
        touched = self._touched[encounters.flight]
        lower = gaps < self._clearance[encounters.flight]
        hit = (gaps < 0.0) & ((rows < touched) | ((rows == touched) & lower))
        order = np.lexsort((gaps, rows))[::-1]  # of several of a flight, the last one stays
        self._note(encounters, rows, gaps, order[hit[order]])
        np.minimum.at(self._touched, encounters.flight[hit], rows[hit])
        nearer = (self._touched[encounters.flight] == NEVER) & lower
        order = np.argsort(-gaps, kind="stable")
        self._note(encounters, rows, gaps, order[nearer[order]])
        return bounds

    def _note(self, encounters: _Encounters, rows: Indices, gaps: Array, chosen: Indices) -> None:
        flights = encounters.flight[chosen]
        self._piece[flights] = encounters.piece[chosen]
        self._clearance[flights] = gaps[chosen]
        self._row[flights] = rows[chosen]

    def _separated(
        self, encounters: _Encounters, ticks: Indices, exact_within: float = inf
    ) -> tuple[Array, Array]:
        """Bounds for all rows by the planes that separate at one, (m, STRETCH), and the gaps there, (m,)."""
        flight, first, piece = encounters
        semi_axes, centre, last = self._semi_axes[flight], self._centre[flight], self._last[flight]
        row = np.minimum(first + ticks, last)
        q = self._attitude[flight, row]
        shapes = so3.axes(q) * semi_axes[:, None]
        centres = self._position[flight, row] + so3.rotate(q, centre)
        found = self._pieces.separated(piece, centres, shapes, exact_within, self._times[row])
        rows = np.minimum(first[:, None] + np.arange(STRETCH), last[:, None])
        position = self._position[flight[:, None], rows] - self._pieces.moved(piece, self._times[rows])
        normals = so3.unrotate(self._attitude[flight[:, None], rows], found.normals[:, None])
        reach = np.linalg.norm(normals * semi_axes[:, None], axis=-1)
        along = np.sum(position * found.normals[:, None], axis=-1)
        bounds = along + np.sum(normals * centre[:, None], axis=-1) - reach - found.offsets[:, None]
        return bounds, found.gaps
