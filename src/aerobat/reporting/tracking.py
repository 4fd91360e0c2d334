"""One plan and how its flight kept to it: motion, forces, moments and rotors (paper, Figs. 8 to 10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aerobat.errors import SpecError
from aerobat.flatness import Reference, reference
from aerobat.flight import Flight
from aerobat.metrics import score
from aerobat.planning import Plan
from aerobat.reporting.figures import (
    AXIS,
    FACT,
    HEAD,
    TITLES,
    Place,
    flight_facts,
    plan_facts,
)
from aerobat.reporting.page import blank_page, heading, headline, house_style, panel
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.path import draw_path
from aerobat.reporting.panels.poses import actual_poses, reference_poses
from aerobat.reporting.panels.signals import (
    Signal,
    draw_signal,
    effort_signals,
    motion_signals,
    rotor_signals,
    shade,
)
from aerobat.reporting.style import PAGE_WIDTH
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROTORS = 1.45  # [in] the height of the rotors' timelines
EFFORTS = 2.3  # [in] of errors, collective thrust and moments
THIRDS = (0.74, 4.5, 8.3)  # [in] where these begin from the left
THIRD = 2.97  # [in] their width
GAP = 0.27  # [in] between timelines, one above the other
ROTOR_GAP = 0.3  # [in] between them, side by side
NEXT = AXIS + TITLES  # [in] from one block of timelines to the one above
FOOT = AXIS + ROTORS + NEXT + EFFORTS + NEXT  # [in] below path, positions and velocities
PATH: Place = (0.3, FOOT - 0.15, 6.1, 6.25)
POSITIONS: Place = (7.1, FOOT + 3.6, 4.17, 2.5)
VELOCITIES: Place = (7.1, FOOT, 4.17, 2.5)
HEIGHT = FOOT + 6.75  # [in] of the page below its headline
RATE = 1000.0  # [1/s] at which asked values are taken: they may peak sharply


@dataclass(frozen=True)
class Columns:
    """What timelines of a page share."""

    figure: Figure
    plan: Plan
    asked: Reference
    flight: Flight

    def finished(self, column: Sequence[Axes], title: str) -> None:
        """Complete a column with title, stages and time axis."""
        timelines.finish_column(column, title, self.plan.stages, self.plan.duration)

    def draw_signals(self, place: Place, signals: Sequence[Signal], title: str, named: bool = False) -> None:
        """Tracks one above the other, with names for a legend if asked."""
        column = stacked(self.figure, place, len(signals))
        for axes, signal in zip(column, signals, strict=True):
            self.draw_signal(axes, signal, named and axes is column[0])
        self.finished(column, title)

    def draw_signal(self, axes: Axes, signal: Signal, named: bool = False) -> None:
        """One of them."""
        draw_signal(axes, signal, self.asked.times, self.flight.times, named)

    def draw_errors(self, place: Place) -> None:
        """Errors of position and attitude."""
        column = stacked(self.figure, place, 2)
        timelines.draw_position_error(column[0], self.flight)
        timelines.draw_attitude_error(column[1], self.flight)
        for axes in column:
            shade(axes, self.flight.times, self.flight.saturated)
        self.finished(column, "Tracking error")


def tracking_figure(plan: Plan, vehicle: Vehicle, flight: Flight) -> Figure:
    """One page on what a plan asks and what its flight gave (paper, Figs. 8, 9 and 10).

    The path with the vehicle's attitude; positions and velocities; tracking errors; collective thrust,
    moments about the body's axes and every rotor's thrust. Asked (by flatness) is a band, flown is a line;
    limits are dashed, those of thrust and moments being what rotors within theirs give of each by itself; a
    shade shows where rotors are saturated. What does not move is left out. An axis that values would stretch
    far beyond its limits is cut off and says so. Raises SpecError for a batch of flights.
    """
    if flight.ends.ndim:
        raise SpecError("tracking_figure draws one flight; of a batch, give flight[k]")
    asked = reference(plan.trajectory, vehicle, rate=RATE, environment=plan.problem.environment)
    facts = _facts(plan, vehicle, flight)
    with house_style():
        figure = blank_page(PAGE_WIDTH, HEIGHT + HEAD + FACT * len(facts))
        headline(figure, f"{plan.problem.name} · tracking by {vehicle.name}", facts)
        path = panel(figure, *PATH)
        motions = reference_poses(asked), actual_poses(flight)
        note = draw_path(path, *motions, vehicle, next(iter(plan.problem.gates), None), plan.stages)
        heading(path, "Path and attitude", note)
        columns = Columns(figure, plan, asked, flight)
        positions, velocities = motion_signals(asked, flight)
        thrust, *moments = effort_signals(asked, flight, vehicle)
        errors, middle, right = ((x, AXIS + ROTORS + NEXT, THIRD, EFFORTS) for x in THIRDS)
        columns.draw_signals(POSITIONS, positions, "Position", named=True)
        columns.draw_signals(VELOCITIES, velocities, "Velocity")
        columns.draw_errors(errors)
        columns.draw_signals(middle, [thrust], "Collective thrust")
        columns.draw_signals(right, moments, "Keyframe about the body's axes")
        _draw_rotors(columns, rotor_signals(asked, flight, vehicle))
    return figure


def stacked(figure: Figure, place: Place, count: int) -> list[Axes]:
    """So many timelines in one place, the top one first."""
    left, bottom, width, height = place
    pitch = (height + GAP) / count
    return [panel(figure, left, bottom + k * pitch, width, pitch - GAP) for k in reversed(range(count))]


def _facts(plan: Plan, vehicle: Vehicle, flight: Flight) -> list[str]:
    rotors = None if plan.margin is None else f"rotors asked for {plan.margin}"
    proof = rotors if plan.certificate is None else plan.certificate.why
    flown = flight_facts(score(flight, plan.problem, vehicle))
    return [plan_facts(plan), *([] if proof is None else [proof]), flown]


def _draw_rotors(columns: Columns, signals: Sequence[Signal]) -> None:
    """All rotors side by side on one scale."""
    row = _side_by_side(columns.figure, len(signals))
    for i, (axes, signal) in enumerate(zip(row, signals, strict=True)):
        columns.draw_signal(axes, signal)
        timelines.mark_stages(axes, columns.plan.stages, columns.plan.duration, named=False)
        axes.set_xlabel("time [s]")
        heading(axes, "" if i else "Thrust of each rotor", f"rotor {i}")
    ends = [axes.get_ylim() for axes in row]
    for axes in row:
        axes.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))
    for axes in row[1:]:
        axes.set_ylabel("")
        axes.tick_params(labelleft=False)


def _side_by_side(figure: Figure, count: int) -> list[Axes]:
    """So many timelines across the foot of the page, the left one first."""
    pitch = (THIRDS[-1] + THIRD - THIRDS[0] + ROTOR_GAP) / count
    return [panel(figure, THIRDS[0] + k * pitch, AXIS, pitch - ROTOR_GAP, ROTORS) for k in range(count)]
