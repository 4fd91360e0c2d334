"""A sweep as a page: errors over time, crossings of each gate's plane, shares of outcomes."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.evaluation import Opening
from aerobat.reporting.page import (
    AXIS,
    COLUMNS,
    TITLES,
    blank_page,
    heading,
    house_style,
    legend,
    panel,
)
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.crossings import Crossings, draw_opening, draw_scatter
from aerobat.reporting.style import BAND, BLUE, INK, MUTED, RED, SKY, SMALL
from aerobat.simulation.outcome import length
from aerobat.studies.share import percent
from aerobat.studies.sweep.flights import PASSED
from aerobat.studies.sweep.result import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TIMELINE = (4.75, 1.9)  # [in] of the errors over time
THIRDS = (0.74, 4.5, 8.3)  # [in] where the columns below them begin
THIRD = 2.97  # [in] their width
GATE = 2.7  # [in] the height of a gate's picture
GATE_PITCH = GATE + AXIS + TITLES  # [in] from one to the next
BAR = 0.36  # [in] an outcome's height
NAMES = 1.05  # [in] the width of their names
CURVES = 1.3  # [in] the height of the distributions
SEEN = 4.0  # largest extent of an axis, relative to the error that 95 % of flights keep within


@validated
def sweep_figure(sweep: Sweep) -> Figure:
    """Draw a page on a sweep: errors over time, crossings of gates, outcomes, distributions of distances.

    Bands over time are those of the first flights, which are sampled. Failures are red.
    """
    gates = crossings(sweep)
    bars = BAR * len(sweep.outcomes)
    stacked = bars + AXIS + TITLES + CURVES
    beside = max(bars, CURVES)  # where no gate is in the way
    foot = max(GATE_PITCH * len(gates), AXIS + TITLES + (stacked if gates else beside))
    with house_style():
        title = f"{sweep.plan.problem.name} · {len(sweep)} flights of {sweep.vehicle.name}"
        success = f"{sweep.success} of the flights went well, at 95 % confidence; seed {sweep.seed}"
        facts = [f"conditions {sweep.conditions}".partition(";")[0], success]
        figure = blank_page(foot + AXIS + TIMELINE[1] + TITLES, title, facts)
        _draw_errors(figure, sweep, foot + AXIS)
        for k, (name, each) in enumerate(gates.items()):
            _draw_gate(figure, name, each, foot - GATE_PITCH * (k + 1) + AXIS)
        top = foot - TITLES
        _draw_outcomes(figure, sweep, THIRDS[2 if gates else 0], top - bars)
        if gates:
            _draw_distributions(figure, sweep, THIRDS[2], top - stacked)
        else:
            _draw_distributions(figure, sweep, THIRDS[1], top - CURVES)
    return figure


def crossings(sweep: Sweep) -> dict[str, Crossings]:
    """Return the points at which flights crossed each gate's plane, by the names of the passages."""
    found = {}
    for name, gate in sweep.passages.items():
        left, up = (np.asarray(sweep.table[f"{name}_{axis}_m"]) for axis in ("lateral", "up"))
        wrong = sweep.table[f"{name}_outcome"] != PASSED
        found[name] = Crossings(gate, -left, up, wrong, known_opening(sweep, name))
    return found


def _draw_errors(figure: Figure, sweep: Sweep, bottom: float) -> None:
    """Draw bands of both errors over time, side by side."""
    shown = f"of the first {len(sweep.position_error)} flights"
    stages, duration = sweep.plan.stages, sweep.plan.duration
    for x, name, unit, errors in (
        (COLUMNS[0], "position", "cm", 100.0 * sweep.position_error),
        (COLUMNS[1], "attitude", "°", np.rad2deg(sweep.attitude_error)),
    ):
        axes = panel(figure, x, bottom, *TIMELINE)
        _draw_band(axes, sweep.times, errors)
        axes.set_ylabel(f"{name} error [{unit}]")
        timelines.finish_column([axes], f"{name.capitalize()} error {shown}", stages, duration)


def _draw_band(axes: Axes, times: Array, errors: Array) -> None:
    """Draw the median of errors (flights, T), the band of 90 % about it, and the largest."""
    low, median, high, most = np.quantile(errors, (0.05, 0.5, 0.95, 1.0), axis=0)
    axes.fill_between(times, low, high, color=BAND, linewidth=0.0, label="5 to 95 %")
    axes.plot(times, median, color=INK, label="median")
    axes.plot(times, most, color=MUTED, linewidth=0.8, label="max")
    largest, seen = float(most.max()), SEEN * float(high.max())
    axes.set_ylim(0.0, max(1.08 * min(largest, seen), 1e-2))
    if largest > seen:
        timelines.note_cut_off(axes, f"up to {largest:.3g}")


def _draw_gate(figure: Figure, name: str, crossed: Crossings, bottom: float) -> None:
    """Draw a gate's opening with all crossings, and beside it the crossings enlarged."""
    opening, scatter = (panel(figure, x, bottom, THIRD, GATE) for x in THIRDS[:2])
    draw_opening(opening, crossed)
    draw_scatter(scatter, crossed)
    dashed = "" if crossed.smallest is None else "; dashed: 99 % pass"
    heading(opening, f"Plane of {name}", f"as who passes upright sees it; {crossed.note}{dashed}")
    half, most = map(length, crossed.rings)
    heading(scatter, "Centres there", f"half within {half}, 95 % within {most}")


def _draw_outcomes(figure: Figure, sweep: Sweep, left: float, bottom: float) -> None:
    """Draw a bar for each outcome, the most frequent on top, with its interval."""
    shares = sweep.outcomes
    axes = panel(figure, left + NAMES, bottom, THIRD - NAMES, BAR * len(shares))
    heading(axes, "Outcomes", "lines: 95 % confidence", left=NAMES)
    for row, (outcome, share) in enumerate(shares.items()):
        axes.barh(row, 100 * share.fraction, 0.5, color=BLUE if outcome.is_success else RED, linewidth=0.0)
        axes.plot(100 * np.array(share.interval), [row, row], color=INK, linewidth=1.2)
        name = f"{outcome.words}\n{share.count}, {percent(share.fraction)} %"
        axes.text(-3.0, row, name, size=SMALL, ha="right", va="center", linespacing=1.15)
    axes.set(xlim=(0.0, 100.0), ylim=(len(shares) - 0.5, -0.5), xlabel="share of flights [%]", yticks=[])
    axes.grid(axis="y", visible=False)


def _draw_distributions(figure: Figure, sweep: Sweep, left: float, bottom: float) -> None:
    """Draw the share of flights within a largest error, and within distances from the two worst gates."""
    axes = panel(figure, left, bottom, THIRD, CURVES)
    worst = sorted(sweep.passages, key=lambda name: sweep.quantile(f"{name}_miss_m", 0.95))[-2:]
    columns = {"largest error": "max_position_error_m"} | {name: f"{name}_miss_m" for name in worst}
    shares = 100.0 * np.arange(1, len(sweep) + 1) / len(sweep)
    for (name, column), colour in zip(columns.items(), (INK, BLUE, SKY), strict=False):
        distances = np.sort(sweep.table[column])
        axes.step(100.0 * distances, shares, where="post", color=colour, label=name)
    axes.axhline(95.0, color=MUTED, linewidth=0.8, linestyle=(0, (4, 2)))
    ends = [sweep.quantile(column, 0.99) for column in columns.values()]
    most = [SEEN * sweep.quantile(column, 0.95) for column in columns.values()]
    widest = 100.0 * min(max(filter(isfinite, each), default=0.01) for each in (ends, most))
    label = "error, or distance from the gate's centre [cm]" if worst else "position error [cm]"
    axes.set(xlim=(0.0, widest), ylim=(0.0, 102.0), xlabel=label, ylabel="flights within [%]")
    axes.set_yticks([0, 50, 95], ["0", "50", "95"])
    axes.locator_params(axis="x", nbins=5)
    legend(axes, above=0.1)  # where the note would be: names need the width
    heading(axes, "Distances" if len(worst) == len(sweep.passages) else "Distances, in the worst gates")


def known_opening(sweep: Sweep, passage: str) -> Opening | None:
    """Return the smallest opening that 99 % pass; None where flights are too few, or too many miss."""
    try:
        found = sweep.smallest_opening(passage)
    except SpecError:
        return None
    return found if isfinite(found.scale) else None
