"""One plan and how its flight kept to it: motion, forces, moments and rotors (paper, Figs. 8 to 10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.evaluation.score import score
from aerobat.evaluation.subject import Subject
from aerobat.flatness import Reference, reference
from aerobat.planning import Plan
from aerobat.reporting.captions import plan_caption, score_caption
from aerobat.reporting.page import AXIS, TITLES, Place, blank_page, heading, house_style, panel
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.path import draw_path
from aerobat.reporting.panels.poses import actual_poses, reference_poses
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle, as_vehicle
from paper.signals import (
    Signal,
    draw_signal,
    effort_signals,
    motion_signals,
    rotor_signals,
    shade,
)

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
TRACKING_RATE = 1000.0  # [1/s] at which reference values are taken: they may peak sharply


@dataclass(frozen=True)
class TrackingPage:
    """A page of timelines, and what they share."""

    figure: Figure
    plan: Plan
    reference: Reference
    flight: Flight

    def draw_signals(self, place: Place, signals: Sequence[Signal], title: str, named: bool = False) -> None:
        """Draw signals one above the other, with names for a legend if asked."""
        column = self._stacked(place, len(signals))
        for axes, signal in zip(column, signals, strict=True):
            self._draw_signal(axes, signal, named and axes is column[0])
        timelines.finish_column(column, title, self.plan.stages, self.plan.duration)

    def draw_errors(self, place: Place) -> None:
        """Draw errors of position and attitude."""
        column = self._stacked(place, 2)
        timelines.draw_errors(column, self.flight)
        for axes in column:
            shade(axes, self.flight.times, self.flight.saturated)
        timelines.finish_column(column, "Tracking error", self.plan.stages, self.plan.duration)

    def draw_rotors(self, signals: Sequence[Signal]) -> None:
        """Draw all rotors side by side across the foot of the page, on one scale."""
        pitch = (THIRDS[-1] + THIRD - THIRDS[0] + ROTOR_GAP) / len(signals)
        row = []
        for i, signal in enumerate(signals):
            axes = panel(self.figure, THIRDS[0] + i * pitch, AXIS, pitch - ROTOR_GAP, ROTORS)
            self._draw_signal(axes, signal)
            timelines.mark_stages(axes, self.plan.stages, self.plan.duration, named=False)
            axes.set_xlabel("time [s]")
            heading(axes, "" if i else "Thrust of each rotor", f"rotor {i}")
            row.append(axes)
        ends = [axes.get_ylim() for axes in row]
        for axes in row:
            axes.set_ylim(min(low for low, _ in ends), max(high for _, high in ends))
        for axes in row[1:]:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)

    def _draw_signal(self, axes: Axes, signal: Signal, named: bool = False) -> None:
        draw_signal(axes, signal, self.reference.times, self.flight.times, named)

    def _stacked(self, place: Place, count: int) -> list[Axes]:
        """So many timelines in one place, the top one first."""
        left, bottom, width, height = place
        pitch = (height + GAP) / count
        bottoms = [bottom + k * pitch for k in reversed(range(count))]
        return [panel(self.figure, left, y, width, pitch - GAP) for y in bottoms]


@validated
def tracking_figure(plan: Plan, vehicle: Vehicle | str, flight: Flight) -> Figure:
    """Draw a page on what a plan asks and what its flight gave (paper, Figs. 8, 9 and 10).

    The path with the vehicle's attitude; positions and velocities; tracking errors; collective thrust,
    moments about the body's axes and every rotor's thrust. The reference (by flatness) is a band, the actual
    is a line; limits are dashed, those of thrust and moments being what rotors within theirs give of each by
    itself; a shade shows where rotors are saturated. What does not move is left out. An axis that values
    would stretch far beyond its limits is cut off and says so. Raises SpecError for a batch of flights.
    """
    if flight.is_batch:
        raise SpecError("tracking_figure draws one flight; of a batch, give flight[k]")
    vehicle = as_vehicle(vehicle)
    rotors = None if plan.margin is None else f"rotors asked for {plan.margin}"
    proof = rotors if plan.certificate is None else plan.certificate.why
    result = score_caption(score(flight, plan.problem, vehicle))
    facts = [plan_caption(plan), *([] if proof is None else [proof]), result]
    return tracking_page(plan, vehicle, flight, f"{plan.problem.name} · tracking by {vehicle.name}", facts)


def tracking_page(plan: Plan, vehicle: Vehicle, flight: Flight, title: str, facts: Sequence[str]) -> Figure:
    """Draw the page of `tracking_figure` under a title.

    Args:
        plan: What was flown.
        vehicle: What flew it.
        flight: One flight.
        title: The page's.
        facts: A line each, under the title.
    """
    asked = reference(plan, vehicle, rate=TRACKING_RATE)
    with house_style():
        figure = blank_page(HEIGHT, title, facts)
        path = panel(figure, *PATH)
        subject = Subject(flight, plan, vehicle)
        note = draw_path(path, subject, reference_poses(asked), actual_poses(flight))
        heading(path, "Path and attitude", note)
        page = TrackingPage(figure, plan, asked, flight)
        positions, velocities = motion_signals(asked, flight)
        thrust, *moments = effort_signals(asked, flight, vehicle)
        errors, middle, right = ((x, AXIS + ROTORS + NEXT, THIRD, EFFORTS) for x in THIRDS)
        page.draw_signals(POSITIONS, positions, "Position", named=True)
        page.draw_signals(VELOCITIES, velocities, "Velocity")
        page.draw_errors(errors)
        page.draw_signals(middle, [thrust], "Collective thrust")
        page.draw_signals(right, moments, "Moments about the body's axes")
        page.draw_rotors(rotor_signals(asked, flight, vehicle))
    return figure
