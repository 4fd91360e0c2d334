"""Planners side by side: their facts, and a picture on a common time axis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.environment.obstacles import ConvexPiece
from aerobat.planning import Plan
from aerobat.planning.passages import as_passed
from aerobat.problem.gate import Gate
from aerobat.reporting.facts import Fact, Facts, facts, line, picture
from aerobat.reporting.page import (
    AXIS,
    COLUMNS,
    MARGIN,
    PAGE_WIDTH,
    TITLES,
    blank_page,
    heading,
    house_style,
    panel,
    set_scale,
    size_of,
    write,
)
from aerobat.reporting.panels.keyframes import plane_of
from aerobat.reporting.panels.path import mark_ends
from aerobat.reporting.panels.poses import is_flat, plan_reference
from aerobat.reporting.panels.timelines import draw_limits, fit_to_limits
from aerobat.reporting.scene.axes_box import draw_box_around
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import gate_corners, gate_shapes
from aerobat.reporting.scene.obstacles import obstacle_shapes, surfaces_beside
from aerobat.reporting.scene.shapes import draw_depth_sorted
from aerobat.reporting.style import BLUE, INK, MUTED, NORMAL, RED, SKY, SMALL, TITLE, YELLOW
from aerobat.simulation import Outcome
from aerobat.simulation.outcome import length
from aerobat.studies.compare import Comparison, Entry
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN = ("duration_s", "ratio", "certified", "min_margin_n", "max_position_error_m")  # beside a timeline
COLOURS = (INK, YELLOW, SKY, BLUE, MUTED)  # of planners, in their order
PLACES = (6.6, 7.5, 8.25, 9.2, 10.2)  # [in] where a row's facts begin


@facts.register
def _(comparison: Comparison) -> Iterator[Fact]:
    problem, vehicle = comparison.problem.name, comparison.vehicle.name
    yield Fact("problem", problem, text=f"{problem} · {vehicle}")
    yield Fact("vehicle", vehicle)
    yield Fact("planners", [_row(comparison, entry) for entry in comparison.entries], "planners")
    for entry in comparison.entries:  # outcomes that are worth a sentence
        if entry.score is None or entry.score.outcome is not Outcome.COMPLETE:
            yield line("", f"{_name(entry)}: {entry.outcome}")
    yield from (line("", f"{_name(entry)}: {entry.note}") for entry in comparison.entries if entry.note)


def _row(comparison: Comparison, entry: Entry) -> Facts:
    """Return the facts of a planner's result; numbers that follow from a plan are None without one."""
    plan = entry.plan
    error = None if entry.score is None else entry.score.max_position_error_m
    return Facts(
        (
            Fact("planner", entry.planner, "planner"),
            Fact("segments", plan and plan.intervals, "segments"),
            Fact("duration_s", plan and plan.duration, "duration", unit="s", form=".3f"),
            Fact("ratio", comparison.ratio(entry), "ratio", form=".2f"),
            Fact("certified", plan and entry.certified, "certified"),
            Fact("min_margin_n", _margin(plan), "margin", unit="N", form=".2g"),
            Fact("max_position_error_m", error, "error", None if error is None else length(error)),
            Fact("planning_s", entry.planning_time, "took", unit="s", form=".2f"),
            Fact("note", entry.note),
        )
    )


@validated
def comparison_figure(comparison: Comparison) -> Figure:
    """Draw a page: all paths in one picture, then each planner's rotor thrusts on a common time axis.

    Thrusts are those of the plan by flatness, and limits are dashed. A planner without a plan has its reason.
    """
    entries = comparison.entries
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(entries))]
    plans = [entry.plan for entry in entries if entry.plan]
    paths = [plan.trajectory.evaluate(np.linspace(0.0, plan.duration, 200)) for plan in plans]
    rows = AXIS + sum(map(_pitch, entries))
    height = 3.2 if is_flat(np.concatenate(paths)) else 4.8  # [in] of the paths
    with house_style():
        title = f"{comparison.problem.name} · planners for {comparison.vehicle.name}"
        fact = f"{len(plans)} of {len(entries)} planners found a plan"
        figure = blank_page(rows + AXIS + MARGIN + height + TITLES, title, [fact])
        axes = panel(figure, COLUMNS[0], rows + AXIS + MARGIN, PAGE_WIDTH - COLUMNS[0] - MARGIN, height)
        problem = comparison.problem
        gates = dict.fromkeys(gate for plan in plans for gate in as_passed(problem.gates, plan.stages))
        camera = _draw_scene(axes, paths, tuple(gates), problem.surroundings.pieces.pieces)
        drawn = [(_name(entry), colour) for entry, colour in zip(entries, colours, strict=True) if entry.plan]
        for path, (name, colour) in zip(paths, drawn, strict=True):
            axes.plot(*camera.project(path).T, color=colour, linewidth=1.7, label=name)
        mark_ends(axes, camera.project(paths[0][[0, -1]]))
        heading(axes, "Paths")
        _draw_rows(figure, comparison, colours, rows)
    return figure


picture.register(Comparison, comparison_figure)


def _margin(plan: Plan | None) -> float | None:
    """Return the margin of the rotors to their limits [N], the certificate's if there is one."""
    if plan is None:
        return None
    if plan.certificate is not None:
        return plan.certificate.margin
    return None if plan.margin is None else plan.margin.margin


def _name(entry: Entry) -> str:
    """Return the name of a planner with its number of segments."""
    if entry.plan is None:
        return entry.planner
    return f"{entry.planner}, {entry.plan.intervals} segments"


def _drawn(comparison: Comparison, entry: Entry) -> list[Fact]:
    """Return the facts of a planner's result that stand beside its timeline."""
    return [fact for fact in _row(comparison, entry) if fact.key in DRAWN]


def _pitch(entry: Entry) -> float:
    """Return the height of a planner's row with its name [in]; less where there is no plan."""
    return 0.75 if entry.plan is None else 1.3


def _draw_rows(figure: Figure, comparison: Comparison, colours: Sequence[str], top: float) -> None:
    """Draw a row for each planner, from `top` [in] downward: timeline and facts, or why it has no plan."""
    timelines: list[Axes] = []
    for x, fact in zip(PLACES, _drawn(comparison, comparison.entries[0]), strict=True):
        write(figure, x, top, fact.label, size=SMALL, color=MUTED)
    for entry, colour in zip(comparison.entries, colours, strict=True):
        top -= _pitch(entry)
        if entry.plan is None:
            write(figure, COLUMNS[0], top + 0.4, _name(entry), size=SMALL, color=MUTED)
            write(figure, COLUMNS[0], top + 0.3, fill(entry.outcome, 150), size=NORMAL, va="top")
            continue
        axes = panel(figure, COLUMNS[0], top, 5.5, 0.85)
        _draw_thrusts(axes, entry.plan, comparison.vehicle, colour)
        heading(axes, "", _name(entry))
        _write_facts(figure, comparison, entry, top)
        timelines.append(axes)
    _share_scales(timelines)


def _draw_thrusts(axes: Axes, plan: Plan, vehicle: Vehicle, colour: str) -> None:
    """Draw the thrusts of all rotors by flatness, up to the end of the plan."""
    reference = plan_reference(plan, vehicle)
    axes.plot(reference.times, reference.rotor_thrusts, color=colour, linewidth=1.1)
    axes.axvline(plan.duration, color=colour, linewidth=2.4)
    limits = sorted({*vehicle.min_thrusts.tolist(), *vehicle.max_thrusts.tolist()})
    draw_limits(axes, limits)
    fit_to_limits(axes, limits, reference.rotor_thrusts)
    axes.set(ylabel="thrust [N]", xlim=(0.0, 1.02 * plan.duration))


def _share_scales(timelines: Sequence[Axes]) -> None:
    """Give all timelines the same scales of time and of thrust."""
    ends = np.array([[*axes.get_xlim(), *axes.get_ylim()] for axes in timelines])
    for axes in timelines:
        axes.set(xlim=(0.0, ends[:, 1].max()), ylim=(ends[:, 2].min(), ends[:, 3].max()))
        axes.tick_params(labelbottom=axes is timelines[-1])
    timelines[-1].set_xlabel("time [s]")


def _write_facts(figure: Figure, comparison: Comparison, entry: Entry, bottom: float) -> None:
    """Write the facts of a plan beside its timeline, and below them a note on planning and flight."""
    for x, fact in zip(PLACES, _drawn(comparison, entry), strict=True):
        wrong = fact.key == "certified" and not entry.certified
        write(figure, x, bottom + 0.6, fact.words, size=TITLE, color=RED if wrong else INK)
    notes = (f"planned in {entry.planning_time:.2f} s", entry.note, entry.outcome)
    note = fill("; ".join(filter(None, notes)), 72)
    write(figure, PLACES[0], bottom + 0.42, note, size=SMALL, color=MUTED, va="top")


def _draw_scene(
    axes: Axes, paths: Sequence[Array], gates: Sequence[Gate], pieces: Sequence[ConvexPiece]
) -> Camera:
    """Draw what is around paths, in the vertical plane that holds them or in space; return the camera.

    Args:
        axes: The axes.
        paths: The paths [m], (T, 3) each.
        gates: The gates of the problem; a moving gate is drawn where each path passes it.
        pieces: The convex pieces of obstacles, which are drawn where they are near.
    """
    surfaces, points = surfaces_beside(pieces, [*paths, gate_corners(gates)])
    plane = plane_of(points)
    if plane is None:
        pad = 0.02 * float(np.ptp(points, axis=0).max())
        _, camera = draw_box_around(axes, points, pad, points, gates)
    else:
        camera = plane.camera
        picture = camera.project(points)
        low, high = picture.min(axis=0), picture.max(axis=0)
        free = size_of(axes) - 0.5  # [in] a quarter of an inch around
        set_scale(axes, (low + high) / 2, max(float(((high - low) / free).max()), 1e-3))
        axes.set(xlabel=plane.label, ylabel="z [m]")
    shapes = obstacle_shapes(surfaces, camera) + [shape for gate in gates for shape in gate_shapes(gate)]
    if shapes:
        draw_depth_sorted(axes, shapes, camera, zorder=1.5)
    return camera
