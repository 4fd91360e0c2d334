"""The paper's Fig. 2: a trajectory of N intervals, each a cubic of the time τ since it began."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from aerobat.planning import Plan
from aerobat.reporting.page import AXIS, TITLES, blank_page, heading, house_style, legend, panel, size_of
from aerobat.reporting.panels.timelines import finish_column
from aerobat.reporting.style import BAND, BLUE, FAINT, INK, MUTED, SKY, SMALL, YELLOW
from paper.flights import printed_plan
from paper.paper_figure import Caption, PaperFigure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PLANE = (1, 2)  # the axes of the flip in roll: y and z
SHOWN = 6  # the interval that is told in full
NAMED = 0.25  # [m] from an interval's start to its end, for its number to have room
SAMPLES = 41  # of an interval
ROWS = (("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s²"), ("jerk", "m/s³"))
ROW = 1.2  # [in] a quantity's height
PITCH = 1.42  # [in] from one to the next
HEIGHT = AXIS + 3 * PITCH + ROW + TITLES  # [in]
PAD = 0.35  # [m] free around the path


def figure_2(begin: Callable[[str], None]) -> PaperFigure:
    """Draw the flip in roll as printed, cut into its intervals."""
    begin("the flip in roll as printed")
    plan = printed_plan("flip-roll")
    caption = _caption(plan)
    with house_style():
        figure = blank_page(HEIGHT, caption.heading, caption.lines)
        path = panel(figure, 0.74, AXIS, 4.4, HEIGHT - AXIS - TITLES)
        _draw_path(path, plan)
        heading(path, "Path", "dots: where intervals meet")
        column = [panel(figure, 6.05, AXIS + k * PITCH, 5.15, ROW) for k in reversed(range(len(ROWS)))]
        for derivative, (axes, (name, unit)) in enumerate(zip(column, ROWS, strict=True)):
            _draw_derivative(axes, plan, derivative)
            axes.set_ylabel(f"{name} [{unit}]")
        _mark_length(column[0], plan)
        finish_column(column, "Position and its derivatives", (), plan.duration)
        heading(column[0], "", f"interval {SHOWN}, τ from 0 to dt:  {_cubic(plan)}")
    return PaperFigure(caption, figure)


def _caption(plan: Plan) -> Caption:
    assert plan.dt is not None, "the printed program has one dt"
    assert plan.cost is not None, "and a cost"
    return Caption(
        2,
        "A trajectory of N intervals",
        "each interval n is a polynomial of third degree with the duration dt. τ in [0, dt] is the time "
        "within the interval. The figure is a sketch without numbers.",
        f"the flip in roll, planned by the printed program, with N = {plan.intervals}, dt = {plan.dt:.3f} s "
        f"and a duration of {plan.duration:.2f} s. Jerk is constant on each interval, with |j| ≤ 200 m/s³ "
        f"on each axis as in the authors' reference code. The cost Σ‖j‖² = {plan.cost:.1f} is proven "
        f"optimal. Interval {SHOWN} is drawn in full.",
    )


def _draw_path(axes: Axes, plan: Plan) -> None:
    """Draw the path in the plane of the flip, interval by interval in two colours."""
    knots = plan.trajectory.knots
    for n, (start, end) in enumerate(pairwise(knots)):
        across, up = plan.trajectory.evaluate(np.linspace(start, end, SAMPLES)).T[list(PLANE)]
        shown = n == SHOWN
        if shown:
            axes.plot(across, up, color=YELLOW, linewidth=7.0, alpha=0.6, zorder=1.5)
        axes.plot(across, up, color=(BLUE, SKY)[n % 2], linewidth=2.0)
    across, up = plan.trajectory.evaluate(knots).T[list(PLANE)]
    axes.plot(across, up, "o", color=INK, markersize=3.2, zorder=3.0)
    low, high = np.array([across.min(), up.min()]) - PAD, np.array([across.max(), up.max()]) + PAD
    per_inch = float(((high - low) / size_of(axes)).max())
    centre, half = (low + high) / 2, size_of(axes) * per_inch / 2
    axes.set(
        xlim=(centre[0] - half[0], centre[0] + half[0]), ylim=(centre[1] - half[1], centre[1] + half[1]),
        xlabel="y [m]", ylabel="z [m]",
    )  # fmt: skip
    _name_intervals(axes, plan)


def _name_intervals(axes: Axes, plan: Plan) -> None:
    """Write each interval's number beside the middle of its arc, away from the loop's middle."""
    trajectory, knots = plan.trajectory, plan.trajectory.knots
    middles = (knots[:-1] + knots[1:]) / 2
    places, velocities = (trajectory.evaluate(middles, d)[:, list(PLANE)] for d in (0, 1))
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])  # to the right of the motion
    sides = velocities @ turn.T / np.linalg.norm(velocities, axis=1, keepdims=True)
    outward = np.sign(((places - places.mean(axis=0)) * sides).sum(axis=1, keepdims=True))
    lengths = np.linalg.norm(np.diff(trajectory.evaluate(knots), axis=0), axis=1)
    for n in np.flatnonzero(lengths > NAMED):
        axes.annotate(
            f"{n}", places[n], 11.0 * (outward * sides)[n], textcoords="offset points", size=SMALL,
            ha="center", va="center", color=INK if n == SHOWN else MUTED,
            weight="bold" if n == SHOWN else "normal",
        )  # fmt: skip


def _draw_derivative(axes: Axes, plan: Plan, derivative: int) -> None:
    """Draw one derivative's components in the plane over time, the intervals' ends and the one shown."""
    knots = plan.trajectory.knots
    axes.vlines(knots, 0.0, 1.0, transform=axes.get_xaxis_transform(), color=FAINT, linewidth=0.5, zorder=0.8)
    axes.axvspan(knots[SHOWN], knots[SHOWN + 1], color=YELLOW, alpha=0.35, linewidth=0.0, zorder=0.7)
    fractions = np.linspace(0.0, 1.0, SAMPLES)
    values = plan.trajectory.on_segments(fractions, derivative)  # one row of samples an interval
    times = knots[:-1, None] + np.diff(knots)[:, None] * fractions
    for axis, colour, name in zip(PLANE, (SKY, BLUE), "yz", strict=True):
        axes.plot(times.ravel(), values[..., axis].ravel(), color=colour, label="" if derivative else name)
    axes.axhline(0.0, color=BAND, linewidth=0.8, zorder=0.9)
    axes.grid(axis="x", visible=False)
    if not derivative:
        legend(axes, above=0.06)


def _mark_length(axes: Axes, plan: Plan) -> None:
    """Draw the shown interval's length as an arrow with two heads."""
    start, end = plan.trajectory.knots[SHOWN : SHOWN + 2]
    bottom, top = axes.get_ylim()
    level = bottom + 0.9 * (top - bottom)
    ends = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (end, level), (start, level), arrowprops=ends)
    axes.annotate(
        "dt", (start, level), (-3, 0), textcoords="offset points", size=SMALL, va="center", ha="right"
    )


def _cubic(plan: Plan) -> str:
    """The shown interval's height as a polynomial of τ [s]."""
    derivatives = [plan.trajectory.on_segments(np.zeros(1), k)[SHOWN, 0, PLANE[1]] for k in (3, 2, 1, 0)]
    factors, powers = (6.0, 2.0, 1.0, 1.0), ("τ³", "τ²", "τ", "")
    terms = [
        f"{value / factor:+.2f} {power}"
        for value, factor, power in zip(derivatives, factors, powers, strict=True)
        if abs(value / factor) >= 0.005
    ]
    text = " ".join(terms).removeprefix("+").replace("-", "− ").replace("+", "+ ")
    return f"$z_{{{SHOWN}}}$(τ) = {text.strip()} m"
