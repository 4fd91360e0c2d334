"""Facts of a sweep: shares of outcomes, quantiles of errors, passages of gates."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import starmap
from math import isfinite

import numpy as np

from aerobat.evaluation.criteria import criterion
from aerobat.planning import planned_passages
from aerobat.reporting.facts import Columns, Fact, Facts, facts, line, picture, record
from aerobat.reporting.sweeps.figure import known_opening, sweep_figure
from aerobat.simulation import Outcome
from aerobat.simulation.outcome import length
from aerobat.studies.sweep import Share, Sweep
from aerobat.studies.sweep.flights import CLEARANCE, NEAREST
from aerobat.studies.sweep.result import LEVELS

ERRORS = (  # columns of the table, with their labels
    ("max_position_error_m", "position, max"),
    ("rms_position_error_m", "position, RMS"),
    ("max_attitude_error_deg", "attitude, max"),
    ("rms_attitude_error_deg", "attitude, RMS"),
)
WIDTHS = (0.01, 0.02, 0.05, 0.1)  # [m] off a gate's centre


@facts.register
def _(sweep: Sweep) -> Iterator[Fact]:
    problem, vehicle, conditions = sweep.plan.problem, sweep.vehicle.name, sweep.conditions.name
    yield Fact("table", Columns(sweep.table))
    yield line("", f"{problem.name} · {vehicle} · {conditions}")
    yield from record(problem=problem.name, vehicle=vehicle, conditions=conditions, seed=sweep.seed)
    yield Fact("flights", len(sweep), "flights", f"{len(sweep)}, seed {sweep.seed}")
    yield Fact("went_well", sweep.success, "went well", str(sweep.success))
    yield Fact("judged_by", criterion(problem), "judged by")
    yield Fact("outcomes", Facts(starmap(_outcome, sweep.outcomes.items())))
    errors = (_quantiles(sweep, column, column, label) for column, label in ERRORS)
    yield Fact("errors", Facts(errors), "error")
    if CLEARANCE in sweep.table:
        yield Fact("nearest", Facts(_nearest(sweep)))
    passages = (Fact(name, Facts(_passage(sweep, name)), name) for name in sweep.passages)
    yield Fact("passages", Facts(passages))


@facts.register
def _(share: Share) -> Iterator[Fact]:
    low, high = share.interval
    yield from record(count=share.count, fraction=share.fraction, low=low, high=high)


picture.register(Sweep, sweep_figure)


def _outcome(outcome: Outcome, share: Share) -> Fact:
    style = "" if outcome.is_success else "red"
    text = f"{share.count}, {share}"
    return Fact(outcome.name.lower(), share, outcome.words, text, style=style)


def _passage(sweep: Sweep, name: str) -> Iterator[Fact]:
    passed = sweep.passed(name)
    yield Fact("passed", passed, "passed", str(passed))
    yield _quantiles(sweep, f"{name}_miss_m", "miss_m", "off its centre")
    attitude = _quantiles(sweep, f"{name}_attitude_error_deg", "attitude_error_deg", "attitude")
    planned = planned_passages(sweep.plan.stages, sweep.plan.problem)
    required = {each.gate.name for each in planned if isfinite(each.attitude_tolerance)}
    yield attitude if sweep.passages[name].name in required else Fact(attitude.key, attitude.value)
    shares = {width: sweep.within(f"{name}_miss_m", width) for width in WIDTHS}
    text = ", ".join(f"{length(width)} {shares[width]}" for width in WIDTHS[1:3])
    rows = [Facts((Fact("miss_m", width), *facts(share))) for width, share in shares.items()]
    yield Fact("within", rows, "within", text)
    opening = known_opening(sweep, name)
    sides = opening and [opening.width, opening.height]
    yield Fact("smallest_opening_m", sides, "99 % pass" if opening else "", str(opening) if opening else None)


def _nearest(sweep: Sweep) -> Iterator[Fact]:
    """Yield the obstacle that flights come nearest to, and their clearance."""
    clearance = sweep.table[CLEARANCE]
    least = int(np.argmin(clearance))
    obstacle = str(sweep.table[NEAREST][least])
    low, middle = float(clearance[least]), float(np.median(clearance))
    apart = "touched" if low < 0.0 else f"{length(low)} at least"
    yield from record(obstacle=obstacle, least_clearance_m=low, median_clearance_m=middle)
    yield line("nearest", f"'{obstacle}', {apart}, {length(middle)} at the median")


def _quantiles(sweep: Sweep, column: str, key: str, label: str) -> Fact:
    """Return the quantiles of a column in its unit; None where one falls on flights that did not pass."""
    values = {level: sweep.quantile(column, level) for level in LEVELS}
    texts = [
        f"{_shown(value, column)} at {'most' if level == 1.0 else f'{100 * level:g} %'}"
        for level, value in values.items()
    ]
    named = {f"{100 * level:g}%": value for level, value in values.items()}
    return Fact(key, named, label, ", ".join(texts))


def _shown(value: float, column: str) -> str:
    if not isfinite(value):
        return "not passed"
    return length(value) if column.endswith("_m") else f"{value:.2f}°"
