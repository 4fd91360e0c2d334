"""The result of a sweep: a table with a row for each flight, shares, quantiles, and errors over time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from aerobat.arrays import Array
from aerobat.declaration import Label, Number, by_value, in_notebooks, unknown_name, validated
from aerobat.environment import Dispersion
from aerobat.evaluation.opening import Opening, Probability, opening_of
from aerobat.planning import Plan
from aerobat.problem import Gate
from aerobat.simulation import Outcome
from aerobat.simulation.outcome import length
from aerobat.simulation.passages.passage import REPEAT_SEPARATOR
from aerobat.studies.share import Share
from aerobat.studies.sweep.flights import PASSED
from aerobat.vehicle import Vehicle

Level = Annotated[float, Field(ge=0, le=1, description="number from 0 to 1")]

_LATERAL = "_lateral_m"
LEVELS = (0.5, 0.95, 1.0)  # levels of the quantiles that tables show


@in_notebooks
@by_value
class Sweep:
    """Many flights of one plan, a row of the table for each; for the first ones, errors over time too.

    Columns of the table, arrays (flights,): `flight`, the flight's number; its draws, which are the factors
    of `mass`, `inertia`, `lag_mean`, `thrust_mean` and `thrust_min` over the nominal vehicle's, `drag_1_s`
    over its mass, `start_offset_m`, `start_speed_m_s`, `start_tilt_deg`, `mean_wind_m_s`, `charge`;
    `outcome`, as text; the fields of a Score; and for each gate, after its name, `_time_s`, `_lateral_m`,
    `_up_m`, `_miss_m`, `_speed_m_s`, `_attitude_error_deg`, `_clearance_m`, `_needed_width_m` and
    `_needed_height_m`, NaN where its plane was not crossed, and `_outcome`: passed, not_reached, or the
    failure at the gate.
    """

    plan: Plan
    vehicle: Vehicle  # the nominal one
    conditions: Dispersion
    seed: int
    table: Mapping[str, NDArray[Any]]
    times: Array  # [s] of the errors over time, (T,)
    position_error: Array  # [m], (sampled flights, T)
    attitude_error: Array  # [rad], (sampled flights, T)

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        columns = {name: np.asarray(column) for name, column in self.table.items()}
        for array in (*columns.values(), self.times, self.position_error, self.attitude_error):
            array.flags.writeable = False
        object.__setattr__(self, "table", MappingProxyType(columns))

    def __len__(self) -> int:
        return len(self.table["flight"])

    def __str__(self) -> str:
        """Return one line with the share of successes and quantiles of the position error."""
        errors = [length(self.quantile("max_position_error_m", level)) for level in LEVELS[1:]]
        return (
            f"{len(self)} flights of {self.plan.problem.name}, {self.conditions.name}: {self.success} "
            f"went well; position error {errors[0]} at 95 %, {errors[1]} at most"
        )

    @property
    def outcomes(self) -> Mapping[Outcome, Share]:
        """The share of each outcome that occurred, the most frequent first."""
        counts = Counter(self.table["outcome"].tolist())
        return {Outcome[name.upper()]: Share(n, len(self)) for name, n in counts.most_common()}

    @property
    def success(self) -> Share:
        """The share of successful flights."""
        return Share(sum(s.count for outcome, s in self.outcomes.items() if outcome.is_success), len(self))

    @property
    def passages(self) -> Mapping[str, Gate]:
        """The gates in the order of passage, by the prefixes of their columns."""
        names = [name.removesuffix(_LATERAL) for name in self.table if name.endswith(_LATERAL)]
        return {name: self.plan.problem.gate(name.partition(REPEAT_SEPARATOR)[0]) for name in names}

    @validated
    def passed(self, passage: Label) -> Share:
        """Return the share of flights that passed a gate as required. Raises SpecError for unknown names."""
        self._gate(passage)
        return Share.where(self.table[f"{passage}_outcome"] == PASSED)

    @validated
    def smallest_opening(
        self, passage: Label, probability: Probability = 0.99, confidence: Probability = 0.95
    ) -> Opening:
        """Return the smallest opening about a gate's centre that flights pass, see `ab.smallest_opening`.

        Args:
            passage: the prefix of the gate's columns.
            probability: with which a flight must pass [-].
            confidence: with which the opening is large enough [-].

        Raises SpecError for an unknown name, and where the flights are too few for such a probability.
        """
        gate = self._gate(passage)
        names = (f"{passage}_needed_width_m", f"{passage}_needed_height_m")
        sides = zip(names, gate.opening.size.tolist(), strict=True)
        scales = np.maximum(*(self._errors(column) / side for column, side in sides))
        return opening_of(scales, gate, probability, confidence)

    def _gate(self, passage: str) -> Gate:
        if passage not in self.passages:
            raise unknown_name("passage", passage, self.passages)
        return self.passages[passage]

    @validated
    def quantile(self, column: Label, level: Level) -> float:
        """Return the smallest value, of one of the flights, that this fraction of them does not exceed.

        Args:
            column: of the table; a missing passage counts as infinite.
            level: the fraction of the flights [-].
        """
        values = self._errors(column)
        return float(np.quantile(values, level, method="higher"))

    @validated
    def within(self, column: Label, limit: Number) -> Share:
        """Return the share of flights with a value of at most `limit` in this column."""
        return Share.where(self._errors(column) <= limit)

    def _errors(self, column: str) -> Array:
        """Return a column of numbers, infinite where there was no passage."""
        numbers = [name for name, values in self.table.items() if values.dtype.kind in "fi"]
        if column not in numbers:
            raise unknown_name("column of numbers", column, numbers)
        values = np.asarray(self.table[column], dtype=float)
        return np.where(np.isnan(values), np.inf, values)
