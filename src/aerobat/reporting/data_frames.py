"""to_dataframe(): what is a table, as one of pandas."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat.arrays import AXES
from aerobat.declaration import validated
from aerobat.errors import BackendMissing
from aerobat.evaluation.score import Score
from aerobat.planning import Attempt, Plan
from aerobat.reporting.comparison import comparison_rows
from aerobat.simulation import Flight
from aerobat.studies.compare import Comparison
from aerobat.studies.feasibility import FeasibilityMap
from aerobat.studies.sweep import Sweep
from aerobat.studies.sweep.flights import passage_names

if TYPE_CHECKING:
    from pandas import DataFrame

COMPONENTS = {3: AXES, 4: "wxyz"}  # of vectors and quaternions
METRICS = (
    "max_position_error_m",
    "rms_position_error_m",
    "max_attitude_error_deg",
    "rms_attitude_error_deg",
    "saturated_fraction",
)


@validated
def to_dataframe(table: Flight | Plan | Comparison | Score | Sweep | FeasibilityMap) -> DataFrame:
    """Return a pandas DataFrame, SI units unless a column says otherwise.

    Of a flight its rows: time, then each series of SERIES by its components, as `position_x` and `thrusts_0`;
    of a batch all flights' rows, one flight below the other, with the number of the vehicle first. Of a plan
    its attempts, of a comparison its planners, of scores the flights with their passages through each gate,
    of a sweep its table, of a map of what is feasible its cells.
    Raises BackendMissing without pandas.
    """
    try:
        from pandas import DataFrame
    except ImportError:
        remedy = 'pip install "aerobat[pandas]"'
        raise BackendMissing(f"to_dataframe needs pandas; install it with {remedy}") from None
    if isinstance(table, Plan):
        return DataFrame([asdict(attempt) for attempt in table.attempts], columns=_names(Attempt))
    if isinstance(table, Sweep | FeasibilityMap):
        return DataFrame(dict(table.table))
    if isinstance(table, Comparison):
        return DataFrame(comparison_rows(table))
    return DataFrame(_of_scores(table) if isinstance(table, Score) else _of_flight(table))


def _names(cls: Any) -> list[str]:
    return list(cls.__dataclass_fields__)


def _of_flight(flight: Flight) -> dict[str, Any]:
    """The columns of a flight, or of a batch."""
    if not flight.is_batch:
        return dict(_columns(flight))
    each = [dict(_columns(flight[k])) for k in range(len(flight.vehicles))]
    numbers = [np.full(len(columns["time"]), k) for k, columns in enumerate(each)]
    joined = {name: np.concatenate([columns[name] for columns in each]) for name in each[0]}
    return {"vehicle": np.concatenate(numbers), **joined}


def _columns(flight: Flight) -> Iterator[tuple[str, Any]]:
    yield "time", flight.times
    for one in flight.kinds:
        values = flight.series[one.name]
        if not one.over_time:
            continue
        if values.ndim == 1:
            yield one.name, values
        else:
            names = COMPONENTS.get(values.shape[1]) if one.shape[0] > 0 else None
            for k, column in enumerate(values.T):
                yield f"{one.name}_{names[k] if names else k}", column


def _of_scores(scores: Score) -> dict[str, Any]:
    """The columns of many flights' scores."""
    columns: dict[str, Any] = {name: getattr(scores, name) for name in METRICS}
    columns["outcome"] = [outcome.name.lower() for outcome in scores.outcomes]
    for begin, passage in zip(passage_names(scores.passages), scores.passages, strict=True):
        names = (name for name in _names(type(passage)) if name not in ("gate", "lap"))
        columns |= {f"{begin}_{name}": getattr(passage, name) for name in names}
    for waypoint in (*scores.waypoints, *scores.places):
        begin = f"{waypoint.waypoint}_lap_{waypoint.lap}"
        columns |= {f"{begin}_{name}": getattr(waypoint, name) for name in ("time", "miss", "speed")}
    return columns
