"""Quantities over time: tracking errors, rotor thrusts and limits, specific thrust (paper, Fig. 5)."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat.arrays import Array
from aerobat.environment.obstacles import Pieces
from aerobat.flatness import force_balance
from aerobat.planning import PlacedStage, Plan, Tube
from aerobat.reporting.page import HEADING, heading, legend, size_of, spread_out, write_by
from aerobat.reporting.panels.keyframes import maneuver_plane, plan_keyframes
from aerobat.reporting.panels.poses import PoseHistory
from aerobat.reporting.style import BLUE, FAINT, INK, MUTED, SKY, SMALL, YELLOW
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR, FAR = 0.5, 1e4  # [m] first and last distance within which the nearest obstacle is searched
LIMIT: dict[str, Any] = {"color": INK, "linewidth": 0.9, "linestyle": (0, (4, 2))}
REACH = 1.0  # largest extent of an axis beyond limits, relative to the distance between these
LENGTHS = (("m", 1.0), ("cm", 1e-2))
NAME_WIDTH, LETTER = 0.36, 0.065  # [in] least width of a stage's name, and width of a letter


def draw_clearance(axes: Axes, poses: PoseHistory, vehicle: Vehicle, pieces: Pieces) -> None:
    """Draw the distance of the body from the nearest obstacle over time, below zero where they overlap."""
    rows = np.unique(np.linspace(0, len(poses.times) - 1, 200).round().astype(int))
    distances = clearances(poses.position[rows], poses.q_world_body[rows], vehicle, pieces, poses.times[rows])
    draw_series(axes, poses.times[rows], distances, INK)
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    lowest = max(1.1 * float(distances.min()), -0.25)  # of an overlap a quarter of a metre
    axes.set(ylabel="clearance [m]", ylim=(min(0.0, lowest), None))


def clearances(position: Array, q_world_body: Array, vehicle: Vehicle, pieces: Pieces, times: Array) -> Array:
    """Return the distances [m] of the body from the nearest of pieces, negative where they overlap, (T,).

    Args:
        position: The positions of the centre of mass [m], (T, 3).
        q_world_body: The attitudes, (T, 4).
        vehicle: The vehicle.
        pieces: The convex pieces of obstacles, one or more.
        times: The times, which place moving obstacles [s], (T,).
    """
    body = vehicle.bounding_ellipsoid
    offsets, shapes = body.turned(q_world_body)
    centres, reach = position + offsets, float(body.semi_axes.max())
    found, pending, within = np.full(len(position), np.inf), np.arange(len(position)), NEAR
    while len(pending) and within < FAR:
        bodies, numbers = pieces.near(centres[pending], reach, within, times[pending])
        rows = pending[bodies]
        apart = pieces.separated(numbers, centres[rows], shapes[rows], times=times[rows])
        np.minimum.at(found, rows, apart.gaps)
        pending = pending[found[pending] > within]  # of others, none that is farther is nearer
        within *= 2.0
    return found


def draw_errors(panels: Sequence[Axes], flight: Flight, tube: Tube | None = None) -> None:
    """Draw the distance between actual and reference position, and below it the angle between attitudes.

    The distance is in the unit that suits its largest value. The tube of a plan is shaded.
    """
    position, attitude = flight.position_error, np.rad2deg(flight.attitude_error)
    within = np.zeros((2, 1))
    if tube is not None:
        within = np.array([tube.position_error, np.rad2deg(tube.attitude_error)])
    largest = max(position.max(), within[0].max())
    unit, size = next((u for u in LENGTHS if largest >= u[1]), LENGTHS[-1])
    for axes, name, error, bound in (
        (panels[0], f"position error [{unit}]", position / size, within[0] / size),
        (panels[1], "attitude error [°]", attitude, within[1]),
    ):
        draw_series(axes, flight.times, error, INK)
        if tube is not None:
            label = f"{100 * tube.level:g} % of flights under {tube.conditions}"
            axes.fill_between(tube.times, 0.0, bound, color=SKY, alpha=0.35, linewidth=0.0, label=label)
        top = 1.12 * float(max(error.max(), bound.max()))
        axes.set(ylabel=name, ylim=(0.0, max(top, 0.01)))  # what is smaller is noise


def draw_rotor_thrusts(axes: Axes, times: Array, thrusts: Array, vehicle: Vehicle) -> None:
    """Draw every rotor's thrust (..., T, n) [N], blue or grey by its sense of turning, and dashed limits."""
    colours = rotor_colours(vehicle)  # a legend has room for the names of four
    for i, colour in enumerate(colours):
        label = f"rotor {i}" if i == 0 or len(colours) <= 4 else f"{i}"
        draw_series(axes, times, thrusts[..., i], colour, width=1.0, label=label)
    limits = sorted({*vehicle.min_thrusts.tolist(), *vehicle.max_thrusts.tolist()})
    draw_limits(axes, limits, "limits")
    low, high = min(float(thrusts.min()), limits[0]), max(float(thrusts.max()), limits[-1])
    axes.set(ylabel="rotor thrust [N]", ylim=(low - 0.08 * (high - low), high + 0.08 * (high - low)))


def draw_limits(axes: Axes, limits: Sequence[float], label: str = "") -> None:
    """Draw dashed lines across axes; the last one carries the label for the legend."""
    for limit in limits:
        axes.axhline(limit, **LIMIT, label=label if limit == limits[-1] else "")


def fit_to_limits(axes: Axes, limits: Sequence[float], values: Array) -> None:
    """Fit the vertical axis to limits and values (...); values far beyond are cut off, with a note."""
    low, high = min(limits), max(limits)
    lowest = min(float(values.min()), low)
    highest = max(float(values.max()), high)
    bottom = max(lowest, low - REACH * (high - low))
    top = min(highest, high + REACH * (high - low))
    pad = 0.08 * (top - bottom)
    axes.set_ylim(bottom - pad, top + pad)
    if lowest < bottom or highest > top:
        note_cut_off(axes, f"{lowest:.4g} to {highest:.4g}")


def note_cut_off(axes: Axes, what: str) -> None:
    """Write in the upper right corner which values lie beyond the vertical axis."""
    write_by(
        axes, f"cut off: {what}".replace("-", "−"), (1.0, 1.0), (-0.06, -0.06), size=SMALL, color=MUTED,
        ha="right", va="top", bbox={"fc": "white", "ec": "none", "pad": 1.5}, zorder=4.0,
    )  # fmt: skip


def rotor_colours(vehicle: Vehicle) -> list[str]:
    """Return the colours of rotors: shades of blue for counter-clockwise ones, of grey for clockwise ones."""
    from matplotlib.colors import to_hex, to_rgb

    colours = [""] * len(vehicle.rotors)
    for spin, dark, light in ((1, "#00315f", "#6fa3d4"), (-1, "#1c2b39", "#8b97a3")):
        same = [i for i, rotor in enumerate(vehicle.rotors) if rotor.spin == spin]
        for fraction, i in zip(np.linspace(0.0, 1.0, max(len(same), 2)), same, strict=False):
            colours[i] = to_hex((1 - fraction) * np.array(to_rgb(dark)) + fraction * np.array(to_rgb(light)))
    return colours


def draw_specific_thrust(axes: Axes, plan: Plan, vehicle: Vehicle) -> None:
    """Draw the specific thrust, drag counted, in the plane of the turn, with dots at the stages."""
    plane = maneuver_plane(plan, plan_keyframes(plan, vehicle).thrust)
    times = plan.trajectory.sample(200.0)
    stages = np.array([stage.time for stage in plan.stages])
    for at, style in ((times, "-"), (stages, "o")):
        velocity, acceleration = (plan.trajectory.evaluate(at, derivative) for derivative in (1, 2))
        thrust = force_balance(plan.problem.environment, vehicle).specific_thrust(velocity, acceleration)
        parts = plane.camera.project(thrust)
        for column, colour, name in ((1, BLUE, "along z"), (0, SKY, f"along {plane.name}")):
            label = name if style == "-" else ""
            axes.plot(at, parts[:, column], style, color=colour, markersize=3.5, label=label)
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.set(ylabel="specific thrust [m/s²]")


def draw_series(
    axes: Axes, times: Array, values: Array, colour: str, width: float = 1.3, label: str = ""
) -> None:
    """Draw one line (T,), or a bundle of thin ones (..., T)."""
    lines = values.reshape(-1, values.shape[-1])
    if len(lines) == 1:
        axes.plot(times, lines[0], color=colour, linewidth=width, label=label)
        return
    from matplotlib.collections import LineCollection

    opacity = max(0.1, len(lines) ** -0.5)
    bundle = np.stack([np.broadcast_to(times, lines.shape), lines], axis=-1)
    axes.add_collection(
        LineCollection(list(bundle), colors=[(colour, opacity)], linewidths=0.6), autolim=False
    )
    axes.plot([], [], color=colour, linewidth=width, label=label)


def mark_stages(axes: Axes, stages: Sequence[PlacedStage], duration: float, named: bool) -> None:
    """Draw upright lines at the stages' times, passages of gates in yellow, and names above if `named`.

    Without room for all names, stages are numbered in their order; if there are very many, only every second
    or third number is written.
    """
    axes.set_xlim(0.0, duration or None)  # of a flight that is over as it begins what matplotlib takes
    times = np.array([stage.time for stage in stages])
    gates = [stage.gate is not None for stage in stages]
    lines = [[(t, 0.0), (t, 1.0)] for t in times]
    colours = [YELLOW if gate else FAINT for gate in gates]
    widths = [1.8 if gate else 0.8 for gate in gates]
    _draw_lines(axes, lines, colors=colours, linewidths=widths, zorder=1.5)
    if not (named and stages):
        return
    width, height = size_of(axes)
    names = [stage.name for stage in stages]
    pitch = max(NAME_WIDTH, LETTER * max(map(len, names)))
    if pitch * (len(names) - 1) > width:
        pitch = NAME_WIDTH
        every = slice(None, None, ceil(pitch * (len(names) - 1) / width))
        names = [str(k) for k in range(1, len(names) + 1)][every]
        times, gates = times[every], gates[every]
    places = spread_out(times / duration * width, pitch, 0.0, width) / width * duration
    top = 1.0 + 0.1 / height
    for gate, name, place in zip(gates, names, places, strict=True):
        axes.text(
            place, top, name, size=SMALL, ha="center", va="bottom", color=INK if gate else MUTED,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    ties = [[(t, 1.0), (place, top)] for t, place in zip(times, places, strict=True)]
    _draw_lines(axes, ties, colors=FAINT, linewidths=0.7, clip_on=False)


def _draw_lines(axes: Axes, lines: list[list[tuple[float, float]]], **style: Any) -> None:
    """Draw lines between points of time [s] and height, a fraction of the axes."""
    from matplotlib.collections import LineCollection

    collection = LineCollection(lines, transform=axes.get_xaxis_transform(), **style)
    axes.add_collection(collection, autolim=False)


def finish_column(column: Sequence[Axes], title: str, stages: Sequence[PlacedStage], duration: float) -> None:
    """Add the title of a column of timelines, their stages, legends and common time axis."""
    for axes in column:
        mark_stages(axes, stages, duration, named=axes is column[0])
        legend(axes, above=HEADING if axes is column[0] else 0.06)
        axes.yaxis.set_label_coords(-0.52 / float(size_of(axes)[0]), 0.5)  # in line down the column
        if axes is not column[-1]:
            axes.tick_params(labelbottom=False)
    column[-1].set_xlabel("time [s]")
    heading(column[0], title)
