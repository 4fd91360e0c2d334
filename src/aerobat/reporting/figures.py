"""Figures as whole pages: a flight, a plan, and a report of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from aerobat.declaration import validated
from aerobat.evaluation.score import Score
from aerobat.evaluation.subject import Subject, subject_of
from aerobat.planning import Plan
from aerobat.reporting.captions import error_caption, plan_captions, score_caption
from aerobat.reporting.page import AXIS, TITLES, PageRow, heading, house_style, page_of_rows
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.path import draw_path
from aerobat.reporting.panels.poses import PoseHistory, actual_poses, is_flat, plan_reference, reference_poses
from aerobat.reporting.panels.stages import draw_stages
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TIMELINE, GAP = 1.45, 0.27  # [in] height of a timeline, and room between two


@validated
def draw(flight: Flight | Plan, plan: Plan | None = None, vehicle: Vehicle | str | None = None) -> Figure:
    """Draw a page on a flight, or a batch: path and attitude, errors, rotor thrusts.

    With the plan, its gates and stages too. Of a plan alone, its path, stages and thrusts. Raises SpecError
    where the vehicle is not known.

    Args:
        flight: What is drawn.
        plan: What was flown.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
    """
    subject = subject_of(flight, plan, vehicle)
    if isinstance(flight, Plan):
        return report_figure(flight, subject.vehicle)
    if plan is not None:
        return report_figure(plan, subject.vehicle, flight)
    with house_style():
        return _bare_page(subject, flight)


def _bare_page(subject: Subject, flight: Flight) -> Figure:
    """Draw a page on a flight whose plan is not known: path and attitude, errors, rotor thrusts."""
    many = f"{len(flight.vehicles)} flights" if flight.is_batch else "flight"
    rows = [PageRow(5.2, (1.0,), below=0.0, left=0.3), *_timelines(2)]
    figure, ((path,), *below) = page_of_rows(
        rows, f"{many} of {subject.vehicle.name}", [error_caption(flight)]
    )
    reference = reference_poses(flight)
    note = draw_path(path, subject, reference, actual_poses(flight))
    heading(path, "Path and attitude", note)
    errors, (thrusts, empty) = zip(*below, strict=True)
    empty.remove()
    timelines.draw_errors(errors, flight)
    timelines.draw_rotor_thrusts(thrusts, flight.times, flight.thrusts, subject.vehicle)
    for column, title in ((errors, "Tracking error"), ([thrusts], "Thrust of each rotor")):
        timelines.finish_column(column, title, (), float(reference.times[-1]))
    return figure


def _timelines(count: int) -> list[PageRow]:
    """Return rows of timelines in two columns, close together."""
    inner = [PageRow(TIMELINE, above=TITLES if not k else GAP, below=0.0) for k in range(count)]
    return [*inner[:-1], inner[-1]._replace(below=AXIS)]


def report_figure(
    plan: Plan, vehicle: Vehicle, flight: Flight | None = None, score: Score | None = None
) -> Figure:
    """Draw a page on a plan and its flight: path, stages, errors, thrusts.

    Without a flight, the thrusts are those of the plan by flatness.

    Args:
        plan: The plan.
        vehicle: The vehicle that it is for.
        flight: One flight of the plan, or a batch.
        score: The score of that flight, for the lines under the title; without it, the largest errors.
    """
    with house_style():
        return _plan_page(plan, vehicle) if flight is None else _flight_page(plan, vehicle, flight, score)


def _flight_page(plan: Plan, vehicle: Vehicle, flight: Flight, score: Score | None) -> Figure:
    facts = [*plan_captions(plan), error_caption(flight) if score is None else score_caption(score)]
    reference = reference_poses(plan_reference(plan, vehicle))
    figure, rows = _pictures(plan, vehicle, reference, actual_poses(flight), 2, facts)
    errors, thrusts = (list(column) for column in zip(*rows[:2], strict=True))
    timelines.draw_errors(errors, flight, plan.tube)
    timelines.draw_specific_thrust(thrusts[0], plan, vehicle)
    timelines.draw_rotor_thrusts(thrusts[1], flight.times, flight.thrusts, vehicle)
    errors += _clearance_panel(rows[2:], plan, vehicle, reference)
    timelines.finish_column(errors, "Tracking error", plan.stages, plan.duration)
    timelines.finish_column(thrusts, "Thrust", plan.stages, plan.duration)
    return figure


def _plan_page(plan: Plan, vehicle: Vehicle) -> Figure:
    reference = plan_reference(plan, vehicle)
    facts = [*plan_captions(plan), *([] if plan.tube is None else [str(plan.tube)])]
    poses = reference_poses(reference)
    figure, ((specific, rotors), *rows) = _pictures(plan, vehicle, poses, [], 1, facts)
    timelines.draw_specific_thrust(specific, plan, vehicle)
    timelines.draw_rotor_thrusts(rotors, reference.times, reference.rotor_thrusts, vehicle)
    below = _clearance_panel(rows, plan, vehicle, poses)
    timelines.finish_column([specific, *below], "Thrust", plan.stages, plan.duration)
    timelines.finish_column([rotors], "Thrust of each rotor", plan.stages, plan.duration)
    return figure


def _clearance_panel(
    rows: Sequence[Sequence[Axes]], plan: Plan, vehicle: Vehicle, poses: PoseHistory
) -> list[Axes]:
    """Draw the planned clearance in the first column of the rows that are left: none without obstacles."""
    for axes, empty in rows:
        timelines.draw_clearance(axes, poses, vehicle, plan.problem.surroundings.pieces)
        empty.remove()
    return [axes for axes, _ in rows]


def _pictures(
    plan: Plan,
    vehicle: Vehicle,
    reference: PoseHistory,
    actual: Sequence[PoseHistory],
    count: int,
    facts: Sequence[str],
) -> tuple[Figure, list[list[Axes]]]:
    """Return a page with its pictures of path and stages, and its rows of timelines in two columns.

    Obstacles add a row, for the clearance.
    """
    subject = Subject(plan, plan, vehicle)
    pictures = [PageRow(6.0, (6.6, 4.9), left=0.4)]
    if is_flat(reference.position):  # one above the other
        pictures = [PageRow(4.0, (1.0,), left=0.3, below=0.2), PageRow(2.2, (1.0,))]
    warnings = () if plan.assessment is None else plan.assessment.warnings
    below = _timelines(count + bool(subject.pieces))
    title = f"{subject.name} · {vehicle.name}"
    figure, rows = page_of_rows([*pictures, *below], title, facts, warnings)
    path, stages = (axes for row in rows[: len(pictures)] for axes in row)
    note = draw_path(path, subject, reference, actual)
    heading(path, "Path and attitude", note)
    heading(stages, "Stages" if plan.stages else "Attitudes", draw_stages(stages, plan, vehicle))
    return figure, rows[len(pictures) :]
