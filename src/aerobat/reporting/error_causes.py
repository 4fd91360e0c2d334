"""The costs of causes of error, as a table for people and as plain data for machines."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from rich.table import Table

from aerobat.simulation.outcome import length
from aerobat.studies.error_causes import ErrorCauses, TrialResult

HEADINGS = (
    "cause",
    "plan",
    "error",
    "at 95 %",
    "costs",
    "95 % confidence",
    "in the gate",
    "attitude",
    "saturated",
    "well",
)
CAPTION = (
    "A row has a plan of its own where its cause concerns the plan. With jerk as the input that is another\n"
    "path, along which more flights may go well than without any cause. costs: growth of the median error."
)


def error_causes_table(measured: ErrorCauses) -> Table:
    """A row a trial: its errors, its cost, what became of its flights."""
    plan = measured.none.plan
    name = "" if plan.vehicle is None else f" · {plan.vehicle.name}"
    conditions = measured.none.trial.conditions.name
    table = Table(
        title=f"{plan.problem.name}{name} · {conditions}, {len(measured)} flights a row",
        title_justify="left",
        caption=CAPTION,
        caption_justify="left",
        box=None,
    )
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "cause" else "right", no_wrap=True)
    for result in measured.results:
        facts = _facts(measured, result)
        low, middle, high = (f"{100 * facts['cost_m'][key]:.1f}" for key in ("low", "median", "high"))
        costs = ("", "") if result is measured.none else (f"{middle} cm", f"{low} to {high}")
        table.add_row(
            result.cause,
            f"{facts['duration_s']:.3f} s",
            length(facts["error_m"]["median"]),
            length(facts["error_m"]["95"]),
            *costs,
            length(facts["gate_error_m"]),
            f"{facts['gate_attitude_error_deg']:.1f}°",
            f"{100 * facts['saturated_fraction']:.0f} %",
            f"{100 * facts['success']:.1f} %",
        )
    return table


def error_causes_report(measured: ErrorCauses) -> dict[str, Any]:
    """The same facts as plain data, trials by their causes."""
    plan = measured.none.plan
    return {
        "problem": plan.problem.name,
        "vehicle": None if plan.vehicle is None else plan.vehicle.name,
        "conditions": measured.none.trial.conditions.name,
        "flights": len(measured),
        "seed": measured.seed,
        "causes": {result.cause: _facts(measured, result) for result in measured.results},
    }


def _facts(measured: ErrorCauses, result: TrialResult) -> dict[str, Any]:
    """Return one trial's numbers: medians over its flights, unless a name says otherwise."""
    cost = measured.cost(result.cause)
    return {
        "duration_s": result.plan.duration,
        "error_m": {
            "median": _known(_quantile(result.position_error, 0.5)),
            "95": _known(_quantile(result.position_error, 0.95)),
        },
        "cost_m": {name: _known(getattr(cost, name)) for name in ("median", "low", "high")},
        "gate_error_m": _known(_quantile(result.gate_error, 0.5)),
        "gate_attitude_error_deg": _known(_quantile(result.gate_attitude_error, 0.5)),
        "saturated_fraction": float(np.mean(result.scores.saturated_fraction)),
        "success": float(result.scores.succeeded.mean()),
    }


def _known(number: float) -> float | None:
    """Return a number, or None for an infinite one: no gate was crossed, or flights are too few."""
    return number if isfinite(number) else None


def _quantile(errors: Any, level: float) -> float:
    """One of the errors, so that none between a finite one and an infinite one is made up."""
    return float(np.quantile(errors, level, method="higher"))
