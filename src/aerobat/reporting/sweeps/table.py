"""A sweep for people, as a table, and for machines, as plain data: shares, quantiles, gates."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Any

from rich.table import Table
from rich.text import Text

from aerobat.errors import SpecError
from aerobat.evaluation import Opening
from aerobat.evaluation.passages import criterion
from aerobat.reporting.tables import Fact, facts_table
from aerobat.simulation import Outcome
from aerobat.simulation.outcome import length
from aerobat.studies.sweep import Share, Sweep
from aerobat.studies.sweep.result import LEVELS

ERRORS = (  # columns of the table, and what people call them
    ("max_position_error_m", "position, max"),
    ("rms_position_error_m", "position, RMS"),
    ("max_attitude_error_deg", "attitude, max"),
    ("rms_attitude_error_deg", "attitude, RMS"),
)
PASSAGE = (("miss_m", "off its centre"), ("attitude_error_deg", "attitude"))
WIDTHS = (0.01, 0.02, 0.05, 0.1)  # [m] off a gate's centre
NEVER = "not passed"


def sweep_table(sweep: Sweep) -> Table:
    """The sweep, a fact a row."""
    facts: dict[str, Iterable[Fact]] = {
        "flights": _flight_facts(sweep),
        "error": [(name, _levels(sweep, column)) for column, name in ERRORS],
    }
    facts |= {name: _passage_facts(sweep, name) for name in sweep.passages}
    return facts_table(f"{sweep.plan.problem.name} · {sweep.vehicle.name} · {sweep.conditions.name}", facts)


def success_sentence(sweep: Sweep) -> str:
    """Return a sentence with the share of flights that went well, its interval and the seed."""
    return f"{sweep.success} of the flights went well, at 95 % confidence; seed {sweep.seed}"


def known_opening(sweep: Sweep, passage: str) -> Opening | None:
    """The smallest opening that 99 % pass; None where the flights are too few to say, or too many miss."""
    try:
        found = sweep.smallest_opening(passage)
    except SpecError:
        return None
    return found if isfinite(found.scale) else None


def outcome_name(outcome: Outcome) -> str:
    """An outcome in two or three words."""
    return outcome.name.lower().replace("_", " ")


def _flight_facts(sweep: Sweep) -> Iterable[Fact]:
    yield "number", f"{len(sweep)}, seed {sweep.seed}"
    yield "went well", str(sweep.success)
    yield "judged by", criterion(sweep.plan.problem)
    for outcome, share in sweep.outcomes.items():
        text = f"{share.count}, {share}"
        yield outcome_name(outcome), text if outcome.is_success else Text(text, style="red")


def _passage_facts(sweep: Sweep, name: str) -> Iterable[Fact]:
    yield "passed", str(sweep.passed(name))
    for column, fact in PASSAGE:
        yield fact, _levels(sweep, f"{name}_{column}")
    within = ", ".join(f"{length(w)} {sweep.within(f'{name}_miss_m', w)}" for w in WIDTHS[1:3])
    yield "within", within
    opening = known_opening(sweep, name)
    if opening is not None:
        yield "99 % pass", str(opening)


def _levels(sweep: Sweep, column: str) -> str:
    """Quantiles of a column in its unit."""
    shown = (f"{_shown(sweep.quantile(column, level), column)} at {100 * level:g} %" for level in LEVELS[:-1])
    return f"{', '.join(shown)}, {_shown(sweep.quantile(column, 1.0), column)} at most"


def _shown(value: float, column: str) -> str:
    if not isfinite(value):
        return NEVER
    return length(value) if column.endswith("_m") else f"{value:.2f}°"


def sweep_report(sweep: Sweep) -> dict[str, Any]:
    """The same facts as plain data; None where a quantile falls on flights that did not pass."""
    return {
        "problem": sweep.plan.problem.name,
        "vehicle": sweep.vehicle.name,
        "conditions": sweep.conditions.name,
        "seed": sweep.seed,
        "flights": len(sweep),
        "went_well": _share(sweep.success),
        "judged_by": criterion(sweep.plan.problem),
        "outcomes": {outcome.name.lower(): _share(share) for outcome, share in sweep.outcomes.items()},
        "errors": {column: _quantiles(sweep, column) for column, _ in ERRORS},
        "passages": {
            name: {"passed": _share(sweep.passed(name))}
            | {column: _quantiles(sweep, f"{name}_{column}") for column, _ in PASSAGE}
            | {
                "smallest_opening_m": _sides(known_opening(sweep, name)),
                "within": [{"miss_m": w, **_share(sweep.within(f"{name}_miss_m", w))} for w in WIDTHS],
            }
            for name in sweep.passages
        },
    }


def _sides(opening: Opening | None) -> list[float] | None:
    return None if opening is None else [opening.width, opening.height]


def _share(share: Share) -> dict[str, float]:
    low, high = share.interval
    return {"count": share.count, "fraction": share.fraction, "low": low, "high": high}


def _quantiles(sweep: Sweep, column: str) -> dict[str, float | None]:
    values = {f"{100 * level:g}%": sweep.quantile(column, level) for level in LEVELS}
    return {name: value if isfinite(value) else None for name, value in values.items()}
