"""The paper's Fig. 5: the four maneuvers in space, and how well each is tracked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.evaluation.subject import Subject
from aerobat.reporting.page import AXIS, blank_page, heading, house_style, panel
from aerobat.reporting.panels.path import draw_path
from aerobat.reporting.panels.poses import actual_poses, plan_reference, reference_poses
from aerobat.reporting.style import BLUE, MUTED, YELLOW
from aerobat.simulation.outcome import length
from paper.flights import MANEUVERS, ManeuverFlights, maneuver_flights
from paper.paper_figure import Caption, PaperFigure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = (0.3, 5.98)  # [in] where the two columns of maneuvers begin from the left
PATH: tuple[float, float] = (3.35, 4.3)  # [in] width and height of a path's picture
VEHICLE = 0.15  # as drawn, relative to its path: six rotors are to be told apart
ERRORS = 3.78  # [in] from a column's left to its timelines
WIDTH, ROW, PITCH = 1.6, 1.55, 2.15  # [in] a timeline's width and height, and from one to the next
BLOCK = PATH[1] + 0.75  # [in] from one row of maneuvers to the next
HEIGHT = 2 * BLOCK + 0.15  # [in]
LOWEST = 1e-3  # [cm], [°] where the axes begin: less is rounding
TITLES = ("Flip in roll", "Flip in roll with translation", "Flip in pitch", "Half-flip with translation")


def figure_5(begin: Callable[[str], None]) -> PaperFigure:
    """Draw each maneuver's path and errors, as flown here and as printed."""
    flown = []
    for name in MANEUVERS:
        begin(name)
        flown.append(maneuver_flights(name))
    caption = _caption(flown)
    with house_style():
        figure = blank_page(HEIGHT, caption.heading, caption.lines)
        blocks = [
            _draw_block(figure, COLUMNS[k % 2], BLOCK * (1 - k // 2), title, flights)
            for k, (title, flights) in enumerate(zip(TITLES, flown, strict=True))
        ]
        for quantity in zip(*blocks, strict=True):
            _share_scale(quantity)
    return PaperFigure(caption, figure)


def _caption(flown: Sequence[ManeuverFlights]) -> Caption:
    here = [each.here.score for each in flown]
    printed = [each.printed.score for each in flown]
    return Caption(
        5,
        "The four maneuvers, flown in simulation",
        "paths and errors of the four maneuvers. The vehicle “always passes through the gate”, with a "
        "“reasonably low tracking error in position”. The attitude error is higher in the two translating "
        "maneuvers. The text gives no numbers.",
        "plans within the limits of the hexarotor's rotors, flown with the full controller (blue), and "
        "plans of the printed program, flown with the printed control law (grey). The errors of the blue "
        f"flights are at most {length(max(s.max_position_error_m for s in here))} and "
        f"{max(s.max_attitude_error_deg for s in here):.2f}°, and all four pass their gates. The errors of "
        f"the grey flights are {_range([100 * s.max_position_error_m for s in printed], 'cm')} and "
        f"{_range([s.max_attitude_error_deg for s in printed], '°')}, and "
        f"{sum(s.outcome.is_success for s in printed)} of 4 pass their gates ({_failures(flown)}). The jerk "
        "of the printed program jumps, which the thrust of a rotor cannot follow. Blue dot: start; dark "
        "dot: end; diamonds: stages. Discs are blue from above and white from below.",
    )


def _failures(flown: Sequence[ManeuverFlights]) -> str:
    """What became of the printed flights that did not go well."""
    printed = zip(TITLES, (each.printed.score for each in flown), strict=True)
    return "; ".join(f"{title.lower()}: {s.sentence}" for title, s in printed if not s.outcome.is_success)


def _range(values: Sequence[float], unit: str) -> str:
    return f"{min(values):.0f} to {max(values):.0f} {unit}".replace(" °", "°")


def _draw_block(
    figure: Figure, left: float, bottom: float, title: str, flights: ManeuverFlights
) -> tuple[Axes, Axes]:
    """Draw one maneuver, its path beside its errors; return the errors' axes.

    Args:
        figure: The page.
        left: Where the block begins [in].
        bottom: Likewise, from below.
        title: The maneuver's.
        flights: As here, and as printed.
    """
    here, printed = flights.here, flights.printed
    path = panel(figure, left, bottom + 0.2, *PATH)
    reference = reference_poses(plan_reference(here.plan, here.vehicle))
    subject = Subject(here.flight, here.plan, here.vehicle)
    note = draw_path(path, subject, reference, actual_poses(here.flight), size=VEHICLE)
    drawn = path.get_legend()
    assert drawn is not None, "a path has its start and its end"
    drawn.remove()  # the caption says it once for all
    durations = f"{here.plan.duration:.2f} s, as printed {printed.plan.duration:.2f} s"
    heading(path, f"{title}: {durations}", note.partition(";")[0])
    position, attitude = (panel(figure, left + ERRORS, bottom + AXIS + k * PITCH, WIDTH, ROW) for k in (1, 0))
    for each, colour, name in ((printed, MUTED, "printed"), (here, BLUE, "here")):
        times = each.flight.times
        _draw_error(position, times, 100.0 * each.flight.position_error, colour, name)
        _draw_error(attitude, times, np.rad2deg(each.flight.attitude_error), colour, name)
    for axes, name, unit in ((position, "Position error", " cm"), (attitude, "Attitude error", "°")):
        _tell_largest(axes, name, unit)
        for stage in subject.stages:
            if stage.gate is not None:
                axes.axvline(stage.time, color=YELLOW, linewidth=1.6, zorder=1.4)
    position.tick_params(labelbottom=False)
    position.set_ylabel("position error [cm]")
    attitude.set(xlabel="time [s]", ylabel="attitude error [°]")
    return position, attitude


def _draw_error(axes: Axes, times: Array, error: Array, colour: str, name: str) -> None:
    """Draw an error over time; what is below the axis is left out."""
    axes.plot(times, np.maximum(error, 0.5 * LOWEST), color=colour, linewidth=1.2, label=name)


def _tell_largest(axes: Axes, name: str, unit: str) -> None:
    """Write the largest error of each line above axes."""
    largest = (
        f"{line.get_label()} {short_number(float(np.max(line.get_ydata())))}{unit}" for line in axes.lines
    )
    heading(axes, name, ", ".join(largest))


def short_number(value: float) -> str:
    """A number in a word: one digit or two of it, or all before the point."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.{1 if value < 0.01 else 2}g}"


def _share_scale(quantity: Sequence[Axes]) -> None:
    """One logarithmic scale for all maneuvers."""
    top = max(float(np.max(line.get_ydata())) for axes in quantity for line in axes.lines)
    for axes in quantity:
        axes.set(yscale="log", ylim=(LOWEST, 3.0 * top))
        axes.set_xlim(left=0.0)
        axes.minorticks_off()
