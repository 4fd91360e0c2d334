"""Gains that were found, for people, as a table, and for machines, as plain data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.table import Table

from aerobat.reporting.tables import Fact, facts_table
from aerobat.studies.tune import FlightCosts, Tuning


def tuning_table(tuning: Tuning) -> Table:
    """Before and after, a fact a row."""
    facts: dict[str, Iterable[Fact]] = {
        "gains": [(name, f"{old:.4g} → {new:.4g}") for name, (old, new) in _gains(tuning).items()],
        "flights of the search": _costs(tuning.training),
        "fresh flights": [*_costs(tuning.fresh), ("so", tuning.verdict)],
    }
    return facts_table(f"{tuning.vehicle.name} · {tuning.evaluations} sets of gains", facts)


def tuning_report(tuning: Tuning) -> dict[str, Any]:
    """The same facts as plain data."""
    return {
        "vehicle": tuning.vehicle.name,
        "evaluations": tuning.evaluations,
        "flights": tuning.fresh[0].failed.size,
        "gains": {name: {"before": old, "after": new} for name, (old, new) in _gains(tuning).items()},
        "training": _measures(tuning.training),
        "fresh": _measures(tuning.fresh),
        "cost_change_m": {"low": tuning.interval[0], "high": tuning.interval[1]},
        "better": tuning.is_better,
    }


def _gains(tuning: Tuning) -> dict[str, tuple[float, float]]:
    """The gains that were sought, before and after."""
    own, found = tuning.vehicle.controller, tuning.controller
    return {name: (getattr(own, name), getattr(found, name)) for name in tuning.gains}


def _costs(costs: tuple[FlightCosts, FlightCosts]) -> list[Fact]:
    return [(when, str(each)) for when, each in zip(("before", "after"), costs, strict=True)]


def _measures(costs: tuple[FlightCosts, FlightCosts]) -> dict[str, dict[str, float]]:
    return {
        when: {
            "cost_m": each.cost,
            "error_95_m": each.error_quantile_m,
            "failed_fraction": each.failed_fraction,
        }
        for when, each in zip(("before", "after"), costs, strict=True)
    }
