"""Facts of a search for gains: the costs of flights with the old gains and the new."""

from __future__ import annotations

from collections.abc import Iterator

from aerobat.reporting.facts import Fact, Facts, facts, record
from aerobat.studies.tune import FlightCosts, Tuning


@facts.register
def _(tuning: Tuning) -> Iterator[Fact]:
    yield Fact(
        "vehicle", tuning.vehicle.name, text=f"{tuning.vehicle.name} · {tuning.evaluations} sets of gains"
    )
    yield from record(evaluations=tuning.evaluations, flights=tuning.fresh[0].failed.size)
    own, found = tuning.vehicle.controller, tuning.controller
    gains = {name: (getattr(own, name), getattr(found, name)) for name in tuning.gains}
    changes = (
        Fact(name, {"before": old, "after": new}, name, f"{old:.4g} → {new:.4g}")
        for name, (old, new) in gains.items()
    )
    yield Fact("gains", Facts(changes), "gains")
    yield Fact("training", Facts(_costs(tuning.training)), "flights of the search")
    yield Fact("fresh", Facts(_costs(tuning.fresh)), "fresh flights")
    low, high = tuning.interval
    yield Fact("cost_change_m", {"low": low, "high": high}, "so", tuning.verdict)
    yield Fact("better", tuning.is_better)


@facts.register
def _(costs: FlightCosts) -> Iterator[Fact]:
    yield from record(
        cost_m=costs.cost, error_95_m=costs.error_quantile_m, failed_fraction=costs.failed_fraction
    )


def _costs(costs: tuple[FlightCosts, FlightCosts]) -> Iterator[Fact]:
    for when, each in zip(("before", "after"), costs, strict=True):
        yield Fact(when, each, when, str(each))
