"""Chunks of a sweep's flights: draws, scores, and errors over time of the first flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.evaluation.score import METRICS, Score
from aerobat.evaluation.score_flights import score_over_time
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.passages import Passage, passage_names
from aerobat.studies.flights import CHUNK, FlightTask, cut

SAMPLED = 4 * CHUNK  # number of flights, from the first, whose errors over time are kept
STRIDE = 10  # ticks between the instants of errors over time
PASSED, NOT_REACHED = "passed", "not_reached"  # outcomes of a passage beside failures
NEAREST, CLEARANCE = "nearest", "clearance_m"  # columns where there are obstacles

Columns = dict[str, NDArray[Any]]

_OVER_TIME = ("times", "position_error", "attitude_error")  # names of a chunk's arrays over time

_PASSAGE = (  # fields of a passage, each with the suffix of its column
    ("time", "time_s"),
    ("lateral", "lateral_m"),
    ("up", "up_m"),
    ("miss", "miss_m"),
    ("speed", "speed_m_s"),
    ("attitude_error_deg", "attitude_error_deg"),
    ("clearance", "clearance_m"),
    ("needed_width", "needed_width_m"),
    ("needed_height", "needed_height_m"),
)


@dataclass(frozen=True, eq=False)
class Chunk:
    """Flights of a sweep: columns of the table, and errors over time of sampled flights."""

    table: Columns  # (flights,)
    times: Array  # [s], (T,); empty where no flight is sampled
    position_error: Array  # [m], (sampled flights, T)
    attitude_error: Array  # [rad], (sampled flights, T)

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that files keep of the chunk."""
        columns = {f"column_{k}": column for k, column in enumerate(self.table.values())}
        over_time = {name: getattr(self, name) for name in _OVER_TIME}
        return {"names": np.array(list(self.table))} | over_time | columns

    @classmethod
    def of(cls, flights: range, arrays: Mapping[str, NDArray[Any]]) -> Chunk | None:
        """Return the chunk of these flights from the arrays of a file; None if they are no such chunk."""
        try:
            columns = {str(name): arrays[f"column_{k}"] for k, name in enumerate(arrays["names"])}
            found = cls(columns, *(arrays[name] for name in _OVER_TIME))
        except (KeyError, TypeError):
            return None
        return found if all(column.shape == (len(flights),) for column in columns.values()) else None

    @classmethod
    def joined(cls, chunks: Sequence[Chunk]) -> Chunk:
        """Return chunks of consecutive flights as one."""
        sampled = [chunk for chunk in chunks if len(chunk.times)] or chunks[:1]
        return cls(
            {name: np.concatenate([chunk.table[name] for chunk in chunks]) for name in chunks[0].table},
            sampled[0].times,
            np.concatenate([chunk.position_error for chunk in sampled]),
            np.concatenate([chunk.attitude_error for chunk in sampled]),
        )


def fly_chunk(task: FlightTask, flights: range) -> Chunk:
    """Fly flights of consecutive numbers; the batch size does not change a bit."""
    is_sampled = flights.start < SAMPLED
    return Chunk.joined([_flown(task, numbers, is_sampled) for numbers in cut(flights, task.batch)])


def _flown(task: FlightTask, numbers: range, is_sampled: bool) -> Chunk:
    """Fly one batch."""
    draws = Draws(task.conditions, len(task.vehicle.rotors), task.seed, numbers)
    stride = STRIDE if is_sampled else None
    scores, errors = score_over_time(task.plan, task.vehicle, task.config(numbers), stride)
    columns = _drawn(draws) | _scored(scores)
    if not is_sampled:
        return Chunk(columns, np.zeros(0), *np.zeros((2, 0, 0)))
    return Chunk(columns, errors.times, errors.position, errors.attitude)


def _drawn(draws: Draws) -> Columns:
    """Return columns with a summary of the draws of flights."""
    effectiveness = draws.columns["effectiveness"]
    return {
        "flight": np.array(draws.flights),
        "mass": draws.columns["mass"],
        "inertia": draws.columns["inertia"],
        "lag_mean": draws.columns["lags"].mean(axis=1),
        "thrust_mean": effectiveness.mean(axis=1),
        "thrust_min": effectiveness.min(axis=1),
        "drag_1_s": draws.columns["drag"],
        "start_offset_m": _norms(draws.columns["start_position"]),
        "start_speed_m_s": _norms(draws.columns["start_velocity"]),
        "start_tilt_deg": np.rad2deg(_norms(draws.columns["start_attitude"])),
        "mean_wind_m_s": _norms(draws.columns["mean_wind"]),
        "charge": draws.columns["charge"],
    }


def _norms(vectors: Array) -> Array:
    return np.asarray(np.linalg.norm(vectors, axis=1))


def _scored(scores: Score) -> Columns:
    """Return columns with the results of flights: outcome, errors, nearest obstacle and passages."""
    flights = list(scores)
    columns: Columns = {"outcome": np.array([flight.outcome.name.lower() for flight in flights])}
    columns |= {name: np.array(getattr(scores, name)) for name in METRICS}
    if scores.nearest is not None:
        columns |= {NEAREST: np.array(scores.nearest.obstacle), CLEARANCE: np.array(scores.nearest.clearance)}
    for number, name in enumerate(passage_names(scores.passages)):
        passage = scores.passages[number]
        columns |= {f"{name}_{column}": np.array(getattr(passage, field)) for field, column in _PASSAGE}
        ends = [_passage_outcome(flight.passages[number]) for flight in flights]
        columns[f"{name}_outcome"] = np.array(ends)
    return columns


def _passage_outcome(passage: Passage) -> str:
    """Return the outcome of one passage: passed, not reached, or its failure by the name of an `Outcome`."""
    if passage.failure is not None:
        return passage.failure.outcome.name.lower()
    return NOT_REACHED if np.isnan(passage.time) else PASSED
