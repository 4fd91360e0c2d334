"""Facts of causes of error: the cost of each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from aerobat.reporting.facts import Fact, Facts, facts, line, record
from aerobat.simulation.outcome import length
from aerobat.studies.error_causes import ErrorCauses, TrialResult

CAPTION = (
    "A row has a plan of its own where its cause concerns the plan. With jerk as the input that is another "
    "path, along which more flights may go well than without any cause. costs: "
    "the median growth of a flight's largest error, beside the same flight without any cause."
)


@facts.register
def _(measured: ErrorCauses) -> Iterator[Fact]:
    plan, conditions = measured.none.plan, measured.none.trial.conditions.name
    vehicle = None if plan.vehicle is None else plan.vehicle.name
    name = "" if vehicle is None else f" · {vehicle}"
    yield line("", f"{plan.problem.name}{name} · {conditions}, {len(measured)} flights a row")
    yield from record(problem=plan.problem.name, vehicle=vehicle, conditions=conditions)
    yield from record(flights=len(measured), seed=measured.seed)
    yield Fact("causes", [Facts(_row(measured, result)) for result in measured.results], "causes")
    yield line("", CAPTION)


def _row(measured: ErrorCauses, result: TrialResult) -> Iterator[Fact]:
    """Yield the facts of a trial. Errors are medians over its flights, unless the key says otherwise.

    Infinite numbers, None in JSON, mean that flights did not cross a gate, or are too few.
    """
    cost, is_none = measured.cost(result.cause), result is measured.none
    low, middle, high = (f"{100 * value:z.1f}" for value in (cost.low, cost.median, cost.high))
    median, most = (_quantile(result.position_error, level) for level in (0.5, 0.95))
    gate, attitude = _quantile(result.gate_error, 0.5), _quantile(result.gate_attitude_error, 0.5)
    saturated = float(np.mean(result.scores.saturated_fraction))
    success = float(result.scores.succeeded.mean())
    yield Fact("cause", result.cause, "cause")
    yield Fact("duration_s", result.plan.duration, "plan", unit="s", form=".3f")
    yield Fact("error_median_m", median, "error", length(median))
    yield Fact("error_95_m", most, "at 95 %", length(most))
    yield Fact("cost_median_m", cost.median, "costs", "" if is_none else f"{middle} cm")
    yield Fact("cost_low_m", cost.low, "95 % confidence", "" if is_none else f"{low} to {high}")
    yield Fact("cost_high_m", cost.high)
    yield Fact("gate_error_m", gate, "in the gate", length(gate))
    yield Fact("gate_attitude_error_deg", attitude, "attitude", f"{attitude:.1f}°")
    yield Fact("saturated_fraction", saturated, "saturated", f"{100 * saturated:.0f} %")
    yield Fact("success", success, "well", f"{100 * success:.1f} %")


def _quantile(errors: Any, level: float) -> float:
    """Return a quantile that is one of the errors: interpolation to infinite errors is meaningless."""
    return float(np.quantile(errors, level, method="higher"))
