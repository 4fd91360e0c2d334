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
    HEADING,
    PageRow,
    heading,
    house_style,
    page_of_rows,
    set_scale,
    size_of,
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
THRUSTS, REASON = 0.85, 0.4  # [in] height of a planner's timeline, and of the reason why there is no plan


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
    height = 3.2 if is_flat(np.concatenate(paths)) else 4.8  # [in] of the paths
    last = [entry for entry in entries if entry.plan][-1]
    rows = [PageRow(height, (1.0,)), *(_row_of(entry, is_last=entry is last) for entry in entries)]
    with house_style():
        title = f"{comparison.problem.name} · planners for {comparison.vehicle.name}"
        fact = f"{len(plans)} of {len(entries)} planners found a plan"
        figure, ((axes,), *below) = page_of_rows(rows, title, [fact])
        problem = comparison.problem
        gates = dict.fromkeys(gate for plan in plans for gate in as_passed(problem.gates, plan.stages))
        camera = _draw_scene(axes, paths, tuple(gates), problem.surroundings.pieces.pieces)
        drawn = [(_name(entry), colour) for entry, colour in zip(entries, colours, strict=True) if entry.plan]
        for path, (name, colour) in zip(paths, drawn, strict=True):
            axes.plot(*camera.project(path).T, color=colour, linewidth=1.7, label=name)
        mark_ends(axes, camera.project(paths[0][[0, -1]]))
        heading(axes, "Paths")
        _draw_rows(below, comparison, colours)
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


def _row_of(entry: Entry, is_last: bool) -> PageRow:
    """Return the row of a planner's result: timeline, the last with its axis, and facts; or a reason."""
    if entry.plan is None:
        return PageRow(REASON, (1.0,), above=HEADING, below=0.2)
    return PageRow(THRUSTS, (6.3, 5.2), above=HEADING, below=AXIS if is_last else 0.1)


def _draw_rows(rows: Sequence[Sequence[Axes]], comparison: Comparison, colours: Sequence[str]) -> None:
    """Draw a row for each planner: timeline and facts, or why it has no plan."""
    timelines: list[Axes] = []
    for (axes, *beside), entry, colour in zip(rows, comparison.entries, colours, strict=True):
        heading(axes, "", _name(entry))
        if entry.plan is None:
            axes.set_axis_off()
            axes.text(0.0, 1.0, fill(entry.outcome, 150), size=NORMAL, va="top")
            continue
        _draw_thrusts(axes, entry.plan, comparison.vehicle, colour)
        _write_facts(beside[0], comparison, entry)
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


def _write_facts(axes: Axes, comparison: Comparison, entry: Entry) -> None:
    """Write the facts of a plan beside its timeline, and below them a note on planning and flight."""
    axes.set_axis_off()
    drawn = _drawn(comparison, entry)
    for k, fact in enumerate(drawn):
        wrong = fact.key == "certified" and not entry.certified
        axes.text(k / len(drawn), 1.0, fact.label, size=SMALL, color=MUTED, va="top")
        axes.text(k / len(drawn), 0.8, fact.words, size=TITLE, color=RED if wrong else INK, va="top")
    notes = (f"planned in {entry.planning_time:.2f} s", entry.note, entry.outcome)
    note = fill("; ".join(filter(None, notes)), 72)
    axes.text(0.0, 0.5, note, size=SMALL, color=MUTED, va="top")


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
