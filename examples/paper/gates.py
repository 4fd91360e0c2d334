"""The paper's Fig. 6: half-flips through gates at four tilts and three openings, errors and their causes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.reporting.page import AXIS, blank_page, heading, house_style, legend, panel
from aerobat.reporting.style import BLUE, INK, MUTED, PAPER, RED, SMALL, YELLOW
from aerobat.simulation import Flight
from aerobat.studies.error_causes import ErrorCauses
from aerobat.vehicle import Vehicle, load_vehicle
from paper.hardware import CAUSES, OPENINGS, TILTS, HardwareTrials, hardware_causes, hardware_trials
from paper.paper_figure import Caption, PaperFigure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEAR = 0.2  # [s] about the passage, of the tracks shown
REACH = 0.72  # [m] from a gate's centre to the end of its picture
ALONG = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0]])  # as who flies along x sees it: to the right, and up
SHOWN_TIMES = (-1.2, 1.3)  # [s] about the passage
ROW, PITCH = 1.35, 1.85  # [in] a tilt's height, and from one to the next
GATES = (0.8, 2.33, 3.86)  # [in] where the three openings begin from the left
TIMELINES = (5.75, 7.55)  # [in] likewise, of the errors
TIMELINE = 1.4  # [in] their width
COSTS, COSTS_WIDTH = 9.25, 1.0  # [in] likewise, of what causes cost
STRIDE = 8  # of rows of tracks and bands that are drawn
FIRST = 0.62  # [in] above the first row, for headings


@dataclass(frozen=True)
class _Row:
    """The panels of one tilt."""

    gates: list[Axes]
    errors: list[Axes]
    costs: Axes


def figure_6(begin: Callable[[str], None]) -> PaperFigure:
    """Fly all trials and draw them, a row a tilt."""
    measured = {
        tilt: hardware_causes(tilt, begin=lambda name, tilt=tilt: begin(f"half-flips at {tilt}°, {name}"))  # type: ignore[misc]
        for tilt in TILTS
    }
    return hardware_figure(measured)


def hardware_figure(measured: Mapping[int, ErrorCauses]) -> PaperFigure:
    """Draw trials that were flown, by the tilts [deg] of their gates."""
    caption = _caption(measured)
    vehicle = load_vehicle("hexarotor")
    height = AXIS + PITCH * len(measured) + FIRST - (PITCH - ROW)
    with house_style():
        figure = blank_page(height, caption.heading, caption.lines)
        rows = []
        for k, (tilt, causes) in enumerate(measured.items()):
            row = _panels(figure, AXIS + PITCH * (len(measured) - 1 - k))
            _draw_row(row, hardware_trials(causes), vehicle)
            row.gates[0].set_ylabel(f"gate at {tilt}°", weight="bold")
            rows.append(row)
        _finish(rows)
    return PaperFigure(caption, figure)


def _caption(measured: Mapping[int, ErrorCauses]) -> Caption:
    first = next(iter(measured.values()))
    none, together = (
        [100.0 * float(np.median(result.position_error)) for result in results]
        for results in zip(*((causes.none, causes.together) for causes in measured.values()), strict=True)
    )
    speed = float(np.mean(first.none.scores.passages[0].speed))
    return Caption(
        6,
        "Half-flips through gates of four tilts and three openings",
        "hardware flights through gates of various tilts and openings, at about 8 m/s at most: “generally "
        "tracked well, but there is more error than in simulation”. The authors suspect four causes, motor "
        "saturation first. The text gives no errors.",
        f"{len(first)} simulated flights per row in the paper's flight space (conditions lab), at "
        f"{speed:.1f} m/s in the gate, with the four causes switched on. The median of the largest position "
        f"error is {max(none):.1f} cm without the causes, and {min(together):.1f} to {max(together):.1f} cm "
        f"with all four. The most costly single cause is {_costliest(measured)}. Outlines show the bodies of "
        "the first flights in the gate, red if they touch the frame. Bands contain 90 % of the flights.",
    )


def _costliest(measured: Mapping[int, ErrorCauses]) -> str:
    """The cause that costs most by itself, and at which tilts."""
    tilts: dict[str, list[str]] = {}
    for tilt, causes in measured.items():
        alone = [result.cause for result in causes.results[1:-1]]
        name = max(alone, key=lambda name, causes=causes: causes.cost(name).median)  # type: ignore[misc]
        tilts.setdefault(name, []).append(f"{tilt}°")
    return ", ".join(f"{name} (at {', '.join(where)})" for name, where in tilts.items())


def _panels(figure: Figure, bottom: float) -> _Row:
    return _Row(
        [panel(figure, left, bottom, ROW, ROW) for left in GATES],
        [panel(figure, left, bottom, TIMELINE, ROW) for left in TIMELINES],
        panel(figure, COSTS, bottom, COSTS_WIDTH, ROW),
    )


def _draw_row(row: _Row, trials: HardwareTrials, vehicle: Vehicle) -> None:
    causes = trials.causes
    for axes, opening in zip(row.gates, OPENINGS, strict=True):
        _draw_gate(axes, trials, vehicle, opening)
    for flight, result, colour, name in (
        (trials.without, causes.none, MUTED, "no cause"),
        (trials.together, causes.together, BLUE, "all four"),
    ):
        times = flight.times - result.plan.stages[0].time
        _draw_band(row.errors[0], times, 100.0 * flight.position_error, colour, name)
        _draw_band(row.errors[1], times, np.rad2deg(flight.attitude_error), colour, "")
    _draw_costs(row.costs, causes)


def _draw_gate(axes: Axes, trials: HardwareTrials, vehicle: Vehicle, opening: tuple[float, float]) -> None:
    """Draw the gate as who passes it sees it, the tracks about it, and the bodies as they cross its plane."""
    from matplotlib.collections import LineCollection, PolyCollection

    result, flight = trials.causes.together, trials.together
    gate = replace(result.plan.problem.gates[0], width=opening[0], height=opening[1])
    [passage] = result.scores.passages
    width, height = np.asarray(passage.needed_width), np.asarray(passage.needed_height)
    fits = (width <= opening[0]) & (height <= opening[1])
    times = np.asarray(passage.time)
    corners = ALONG @ (gate.outline - gate.position).T
    axes.fill(*corners, facecolor=PAPER, edgecolor=YELLOW, linewidth=2.2, zorder=1.0)
    shown = sorted(range(len(flight.states.position)), key=lambda k: not fits[k])  # red ones above
    near = np.abs(flight.times - result.plan.stages[0].time) < NEAR
    colours = [BLUE if fits[k] else RED for k in shown]
    tracks = [(flight.states.position[k][near][::STRIDE] - gate.position) @ ALONG.T for k in shown]
    axes.add_collection(LineCollection(tracks, colors=[(c, 0.15) for c in colours], linewidths=0.6))
    crossed = [k for k in shown if np.isfinite(times[k])]
    outlines = [_outline(flight, k, float(times[k]), gate.position, vehicle) for k in crossed]
    edges = [(BLUE if fits[k] else RED, 0.5) for k in crossed]
    axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=edges, linewidths=0.6))
    axes.set(xlim=(-REACH, REACH), ylim=(-REACH, REACH), xticks=(-0.5, 0, 0.5), yticks=(-0.5, 0, 0.5))
    heading(axes, "", f"{100 * result.cleared_opening(*opening).fraction:.0f} % pass")


def _outline(flight: Flight, k: int, time: float, centre: Array, vehicle: Vehicle) -> Array:
    """The body of flight k as seen along the passage at a time [s], from the gate's centre [m], (n, 2)."""
    row = int(np.argmin(np.abs(flight.times - time)))
    position, attitude = flight.states.position[k, row], flight.states.q_world_body[k, row]
    seen = ALONG @ (so3.axes(attitude) * np.array(vehicle.bounding_ellipsoid.semi_axes))
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.asarray(circle @ np.linalg.cholesky(seen @ seen.T).T + (position - centre) @ ALONG.T)


def _draw_band(axes: Axes, times: Array, errors: Array, colour: str, name: str) -> None:
    """Draw the median of errors (flights, T) and the band that holds 90 % of them."""
    low, median, high = np.nanquantile(errors[:, ::STRIDE], (0.05, 0.5, 0.95), axis=0)
    times = times[::STRIDE]
    axes.fill_between(times, low, high, color=colour, alpha=0.22, linewidth=0.0)
    axes.plot(times, median, color=colour, linewidth=1.3, label=name)
    axes.axvline(0.0, color=YELLOW, linewidth=1.5, zorder=0.9)
    axes.set_xlim(*SHOWN_TIMES)


def _draw_costs(axes: Axes, causes: ErrorCauses) -> None:
    """Draw by how much each cause makes a flight's largest position error larger: median, 95 % interval."""
    names = [result.cause for result in causes.results[1:]]
    for place, name in enumerate(names):
        cost = causes.cost(name)
        colour = MUTED if place < len(CAUSES) else BLUE
        axes.barh(place, 100 * cost.median, color=colour, height=0.62, alpha=0.8)
        axes.plot([100 * cost.low, 100 * cost.high], [place, place], color=INK, linewidth=1.0)
        axes.annotate(
            f"{100 * cost.median:.1f}", (100 * cost.high, place), (3, 0), textcoords="offset points",
            va="center", size=SMALL,
        )  # fmt: skip
    axes.set_yticks(range(len(names)), names)
    axes.yaxis.tick_right()
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)


def _finish(rows: list[_Row]) -> None:
    """Share the scales of a column, name the columns and their axes."""
    for column in zip(*(row.errors for row in rows), strict=True):
        highest = max(axes.get_ylim()[1] for axes in column)
        for axes in column:
            axes.set_ylim(0.0, highest)
            axes.tick_params(labelbottom=axes is column[-1])
        column[-1].set_xlabel("time from the gate [s]")
    widest = 1.35 * max(row.costs.get_xlim()[1] for row in rows)
    for row in rows:
        row.costs.set_xlim(0.0, widest)
        row.costs.tick_params(labelbottom=row is rows[-1])
        for axes in row.gates:
            axes.tick_params(labelbottom=row is rows[-1])
        for axes in row.gates[1:]:
            axes.tick_params(labelleft=False)
    top = rows[0]
    for axes, (width, height) in zip(top.gates, OPENINGS, strict=True):
        heading(axes, f"{100 * width:.0f} × {100 * height:.0f} cm")
    for axes, title in zip(top.errors, ("Position error [cm]", "Attitude error [°]"), strict=True):
        heading(axes, title)
    heading(top.costs, "Cost of each cause", "in position error")
    legend(top.errors[0], above=0.06)
    rows[-1].gates[1].set_xlabel("to the right of the gate's centre [m]")
    rows[-1].costs.set_xlabel("cost [cm], 95 %")
