"""The paper's Fig. 3: the orientations imposed to perform a flip in roll."""

from __future__ import annotations

from collections.abc import Callable

from aerobat.planning import Plan
from aerobat.reporting.page import AXIS, TITLES, blank_page, heading, house_style, panel
from aerobat.reporting.panels.stages import draw_stages
from paper.flights import maneuver_flights
from paper.paper_figure import Caption, PaperFigure

HEIGHT = 6.9  # [in]
LEFTS = (0.74, 6.55)  # [in] of the two panels
WIDTH = 4.6  # [in]


def figure_3(begin: Callable[[str], None]) -> PaperFigure:
    """Draw the stages of the flip in roll as planned here, and as the printed program places them."""
    begin("the flip in roll, as here and as printed")
    flights = maneuver_flights("flip-roll")
    here, printed, vehicle = flights.here.plan, flights.printed.plan, flights.here.vehicle
    caption = _caption(here, printed)
    with house_style():
        figure = blank_page(HEIGHT, caption.heading, caption.lines)
        for left, plan, title in zip(LEFTS, (here, printed), ("Here", "As printed"), strict=True):
            axes = panel(figure, left, AXIS, WIDTH, HEIGHT - AXIS - TITLES)
            heading(axes, title, f"{plan.duration:.2f} s; {draw_stages(axes, plan, vehicle)}")
    return PaperFigure(caption, figure)


def _caption(here: Plan, printed: Plan) -> Caption:
    order = sorted(printed.stages, key=lambda stage: stage.time)
    return Caption(
        3,
        "Orientations imposed to perform a flip in roll",
        "five stages at 45°, 90°, upside down, 270° and 315° of roll, with the accelerations a_z + g and "
        "a_y that each stage requires. The figure is a sketch without numbers.",
        "the same five stages, at the times and places that a solver finds: within the limits of the "
        f"hexarotor's rotors ({here.duration:.2f} s), and in the proven optimum of the printed program "
        f"({printed.duration:.2f} s). As printed, a stage permits either sign of the thrust, and the order "
        f"is free: {', '.join(stage.name for stage in order)}, where “315°” is met at 135°.",
    )
