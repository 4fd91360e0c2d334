"""Figures as whole pages: a flight, a plan, and a report of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.flight import Flight
from aerobat.metrics import Score, attitude_error, position_error
from aerobat.planning import Plan
from aerobat.reporting.page import (
    blank_page,
    heading,
    headline,
    house_style,
    panel,
    png,
    save_figure,
)
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.path import draw_path
from aerobat.reporting.panels.poses import PoseHistory, actual_poses, plan_reference, reference_poses
from aerobat.reporting.panels.stages import draw_stages
from aerobat.reporting.style import PAGE_WIDTH
from aerobat.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw", "png", "report_figure", "save_figure"]

Place = tuple[float, float, float, float]  # [in] left, bottom, width, height

FLAT = 0.3  # a path whose height is less than this share of its length is drawn across the whole page
HEAD = 0.57  # [in] the page's title
FACT = 0.19  # [in] each line of facts under it
TITLES = 0.62  # [in] above timelines, for their title and the stages' names
AXIS = 0.5  # [in] below timelines, for the time axis
COLUMNS = (0.74, 6.52)  # [in] where timelines begin from the left
WIDTH = 4.75  # [in] of a timeline
ROW = 1.45  # [in] its height
PITCH = 1.72  # [in] from one row to the next


@dataclass(frozen=True)
class Pictures:
    """Where a report's two pictures go, above the timelines."""

    path: Place
    stages: Place
    height: float  # [in] of both, titles included


SIDE_BY_SIDE = Pictures((0.3, 0.05, 6.1, 6.1), (7.0, 0.5, 4.3, 5.65), 6.7)
STACKED = Pictures((0.3, 3.3, 11.0, 3.1), (0.74, 0.5, 10.53, 2.0), 6.95)


@dataclass(frozen=True)
class FlightPage:
    """Where a flight's picture and its three timelines go on a page of its own."""

    path: Place
    position: Place
    attitude: Place
    rotors: Place
    height: float  # [in] without the head


TIMELINES_BESIDE = FlightPage(
    path=(0.3, 0.2, 6.1, 6.0),
    position=(7.1, AXIS + 4.0, 4.2, 1.75),
    attitude=(7.1, AXIS + 2.0, 4.2, 1.75),
    rotors=(7.1, AXIS, 4.2, 1.75),
    height=6.85,
)
TIMELINES_BELOW = FlightPage(
    path=(0.3, 2.7, 11.0, 3.1),
    position=(0.68, AXIS, 3.05, 1.6),
    attitude=(4.5, AXIS, 3.05, 1.6),
    rotors=(8.3, AXIS, 3.05, 1.6),
    height=6.4,
)


def draw(flight: Flight, plan: Plan | None = None, vehicle: Vehicle | None = None) -> Figure:
    """A page on a flight, or a batch: its path with the vehicle's attitude, errors, rotor thrusts.

    With the plan, its gate and stages too. The vehicle may be left out where it is a preset. Raises
    SpecError where it is not.
    """
    vehicle = load_vehicle(flight.vehicles[0]) if vehicle is None else vehicle
    flown = actual_poses(flight)
    planned = reference_poses(flight if plan is None else plan_reference(plan, vehicle))
    page = TIMELINES_BELOW if is_flat(planned.position) else TIMELINES_BESIDE
    of = f"{'flight' if len(flown) == 1 else f'{len(flown)} flights'} of {vehicle.name}"
    with house_style():
        figure = blank_page(PAGE_WIDTH, page.height + HEAD + FACT)
        headline(figure, of if plan is None else f"{plan.problem.name} · {of}", [_error_facts(flight)])
        path = panel(figure, *page.path)
        gate, stages = (None, ()) if plan is None else (next(iter(plan.problem.gates), None), plan.stages)
        heading(path, "Path and attitude", draw_path(path, planned, flown, vehicle, gate, stages))
        lines = [panel(figure, *place) for place in (page.position, page.attitude, page.rotors)]
        timelines.draw_position_error(lines[0], flight)
        timelines.draw_attitude_error(lines[1], flight)
        timelines.draw_rotor_thrusts(lines[2], flight.times, flight.thrusts, vehicle)
        for column in [lines] if page is TIMELINES_BESIDE else [[axes] for axes in lines]:
            timelines.finish_column(column, "", stages, float(planned.times[-1]))
    return figure


def report_figure(
    plan: Plan, vehicle: Vehicle, flight: Flight | None = None, score: Score | None = None
) -> Figure:
    """One page on a plan and its flight: path, stages, errors, thrusts.

    Without a flight, what the plan asks of the vehicle, rotor thrusts by flatness.
    """
    with house_style():
        return _plan_page(plan, vehicle) if flight is None else _report_page(plan, vehicle, flight, score)


def _report_page(plan: Plan, vehicle: Vehicle, flight: Flight, score: Score | None) -> Figure:
    facts = [plan_facts(plan), _error_facts(flight) if score is None else flight_facts(score)]
    figure, rows = _page(
        plan, vehicle, reference_poses(plan_reference(plan, vehicle)), actual_poses(flight), 2, facts
    )
    errors, thrusts = ([panel(figure, x, y, WIDTH, ROW) for y in rows] for x in COLUMNS)
    timelines.draw_position_error(errors[0], flight)
    timelines.draw_attitude_error(errors[1], flight)
    timelines.draw_specific_thrust(thrusts[0], plan, vehicle)
    timelines.draw_rotor_thrusts(thrusts[1], flight.times, flight.thrusts, vehicle)
    timelines.finish_column(errors, "Tracking error", plan.stages, plan.duration)
    timelines.finish_column(thrusts, "Thrust", plan.stages, plan.duration)
    return figure


def _plan_page(plan: Plan, vehicle: Vehicle) -> Figure:
    asked = plan_reference(plan, vehicle)
    facts = [plan_facts(plan), *([] if plan.margin is None else [f"rotors {plan.margin}"])]
    figure, rows = _page(plan, vehicle, reference_poses(asked), [], 1, facts)
    specific, rotors = (panel(figure, x, rows[0], WIDTH, ROW) for x in COLUMNS)
    timelines.draw_specific_thrust(specific, plan, vehicle)
    timelines.draw_rotor_thrusts(rotors, asked.times, asked.rotor_thrusts, vehicle)
    timelines.finish_column([specific], "Thrust", plan.stages, plan.duration)
    timelines.finish_column([rotors], "Thrust of each rotor", plan.stages, plan.duration)
    return figure


def _page(
    plan: Plan,
    vehicle: Vehicle,
    planned: PoseHistory,
    flown: Sequence[PoseHistory],
    rows: int,
    facts: Sequence[str],
) -> tuple[Figure, list[float]]:
    """A page with headline and pictures, and the bottoms [in] of its rows of timelines, top row first."""
    pictures = STACKED if is_flat(planned.position) else SIDE_BY_SIDE
    foot = AXIS + PITCH * (rows - 1) + ROW + TITLES
    figure = blank_page(PAGE_WIDTH, foot + pictures.height + HEAD + FACT * len(facts))
    headline(figure, f"{plan.problem.name} · {vehicle.name}", facts)
    path, stages = (
        panel(figure, left, foot + bottom, width, height)
        for left, bottom, width, height in (pictures.path, pictures.stages)
    )
    note = draw_path(path, planned, flown, vehicle, next(iter(plan.problem.gates), None), plan.stages)
    heading(path, "Path and attitude", note)
    heading(stages, "Stages" if plan.stages else "Attitudes", draw_stages(stages, plan, vehicle))
    return figure, [AXIS + PITCH * k for k in reversed(range(rows))]


def is_flat(positions: Array) -> bool:
    """Whether a path (T, 3) is much longer than high."""
    extents = np.ptp(positions, axis=0)
    return bool(extents[2] < FLAT * extents.max())


def plan_facts(plan: Plan) -> str:
    """How a plan came about, in a line."""
    dt = "" if plan.dt is None else f" of {plan.dt:.4f} s"
    return (
        f"{plan.planner}: {plan.duration:.3f} s in {plan.intervals} intervals{dt}, order {plan.order}, "
        f"cost {plan.cost:.6g} ({plan.backend}, {plan.nodes} nodes, {1000 * plan.solve_time:.0f} ms)"
    )


def flight_facts(score: Score) -> str:
    """How a flight went, in a line."""
    return (
        f"{score.outcome}; position error at most {length(score.max_position_error_m)}, "
        f"attitude error at most {score.max_attitude_error_deg:.2f}°, "
        f"{score.rms_attitude_error_deg:.2f}° RMS, "
        f"saturated {100 * score.saturated_fraction:.1f} % of the time"
    )


def length(metres: float) -> str:
    """A length with the unit that suits it."""
    return f"{metres:.2f} m" if metres >= 1.0 else f"{100 * metres:.2f} cm"


def _error_facts(flight: Flight) -> str:
    return (
        f"position error at most {length(float(position_error(flight).max()))}, "
        f"attitude error at most {np.rad2deg(attitude_error(flight).max()):.2f}°"
    )
