"""A sweep as a page: errors over time, crossings of each gate's plane, shares of outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.evaluation import Opening
from aerobat.reporting.page import PageRow, heading, house_style, legend, page_of_rows
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

ERRORS, GATE, CURVES = 1.9, 2.7, 1.3  # [in] heights of errors over time, a gate's picture, distributions
BAR = 0.4  # [in] an outcome's height, with its name
SEEN = 4.0  # largest extent of an axis, relative to the error that 95 % of flights keep within


@validated
def sweep_figure(sweep: Sweep) -> Figure:
    """Draw a page on a sweep: errors over time, crossings of gates, outcomes, distributions of distances.

    Bands over time are those of the first flights, which are sampled. Failures are red.
    """
    gates = crossings(sweep)
    below = PageRow(max(BAR * len(sweep.outcomes), CURVES))
    with house_style():
        title = f"{sweep.plan.problem.name} · {len(sweep)} flights of {sweep.vehicle.name}"
        success = f"{sweep.success} of the flights went well, at 95 % confidence; seed {sweep.seed}"
        facts = [f"conditions {sweep.conditions}".partition(";")[0], success]
        figure, (errors, *pictures, (outcomes, distributions)) = page_of_rows(
            [PageRow(ERRORS), *[PageRow(GATE)] * len(gates), below], title, facts
        )
        _draw_errors(errors, sweep)
        for (name, each), (opening, scatter) in zip(gates.items(), pictures, strict=True):
            _draw_gate(opening, scatter, name, each)
        _draw_outcomes(outcomes, sweep)
        _draw_distributions(distributions, sweep)
    return figure


def crossings(sweep: Sweep) -> dict[str, Crossings]:
    """Return the points at which flights crossed each gate's plane, by the names of the passages."""
    found = {}
    for name, gate in sweep.passages.items():
        left, up = (np.asarray(sweep.table[f"{name}_{axis}_m"]) for axis in ("lateral", "up"))
        wrong = sweep.table[f"{name}_outcome"] != PASSED
        found[name] = Crossings(gate, -left, up, wrong, known_opening(sweep, name))
    return found


def _draw_errors(panels: Sequence[Axes], sweep: Sweep) -> None:
    """Draw bands of both errors over time, side by side."""
    shown = f"of the first {len(sweep.position_error)} flights"
    stages, duration = sweep.plan.stages, sweep.plan.duration
    for axes, name, unit, errors in (
        (panels[0], "position", "cm", 100.0 * sweep.position_error),
        (panels[1], "attitude", "°", np.rad2deg(sweep.attitude_error)),
    ):
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


def _draw_gate(opening: Axes, scatter: Axes, name: str, crossed: Crossings) -> None:
    """Draw a gate's opening with all crossings, and beside it the crossings enlarged."""
    draw_opening(opening, crossed)
    draw_scatter(scatter, crossed)
    dashed = "" if crossed.smallest is None else "; dashed: 99 % pass"
    heading(opening, f"Plane of {name}", f"as who passes upright sees it; {crossed.note}{dashed}")
    half, most = map(length, crossed.rings)
    heading(scatter, "Centres there", f"half within {half}, 95 % within {most}")


def _draw_outcomes(axes: Axes, sweep: Sweep) -> None:
    """Draw a bar for each outcome under its name, the most frequent on top, with its interval."""
    shares = sweep.outcomes
    heading(axes, "Outcomes", "lines: 95 % confidence")
    for row, (outcome, share) in enumerate(shares.items()):
        colour = BLUE if outcome.is_success else RED
        axes.barh(row + 0.2, 100 * share.fraction, 0.4, color=colour, linewidth=0.0)
        axes.plot(100 * np.array(share.interval), [row + 0.2] * 2, color=INK, linewidth=1.2)
        name = f"{outcome.words}: {share.count}, {percent(share.fraction)} %"
        axes.text(0.5, row - 0.05, name, size=SMALL, va="bottom")
    axes.set(xlim=(0.0, 100.0), ylim=(len(shares) - 0.5, -0.5), xlabel="share of flights [%]", yticks=[])
    axes.grid(axis="y", visible=False)


def _draw_distributions(axes: Axes, sweep: Sweep) -> None:
    """Draw the share of flights within a largest error, and within distances from the two worst gates."""
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
