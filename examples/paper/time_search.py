"""The paper's Figs. 8, 9 and 10: the search on times of Section V, and how its paths are tracked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from aerobat.planning import MinSnap, Plan, plan
from aerobat.problem import load_problem
from aerobat.reporting.page import AXIS, TITLES, blank_page, heading, house_style, panel, size_of
from aerobat.reporting.panels.path import mark_ends
from aerobat.reporting.panels.poses import plan_reference, reference_poses
from aerobat.reporting.panels.timelines import draw_limits
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import enlargement, vehicle_shapes
from aerobat.reporting.scene.shapes import draw_depth_sorted
from aerobat.reporting.style import BAND, BLUE, INK, MUTED, RED, SMALL
from aerobat.simulation.outcome import length
from aerobat.vehicle import Vehicle, load_vehicle
from paper.flights import FlownPlan, flown
from paper.paper_figure import Caption, PaperFigure
from paper.tracking import tracking_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SECTION_V = "section-v"  # the problem, and the vehicle
STOPPED_AFTER = 6  # iterations, in the paper's Fig. 10
HEIGHT = 5.7  # [in]
FOOT = AXIS + 0.13  # [in] for numbers in two lines
PLANE = Camera(float(np.deg2rad(-90.0)))  # x to the right, z up
POSES = 9  # vehicles along the last path
SIZE = 0.55  # [m] a vehicle, as drawn
PAPER_ITERATIONS = 12
PAPER_TIMES = {PAPER_ITERATIONS: (1.6, 3.1), STOPPED_AFTER: (1.0, 2.5)}  # [s] t1 and t2, its captions


@dataclass(frozen=True, eq=False)
class TimeSearch:
    """The plans of a search's iterations, in their order; only the last one is within the rotors' limits."""

    iterations: tuple[Plan, ...]
    vehicle: Vehicle

    @property
    def optimized(self) -> FlownPlan:
        """The last plan, flown (paper, Fig. 9)."""
        return flown(self.iterations[-1], self.vehicle)

    @property
    def stopped(self) -> FlownPlan:
        """The plan of the search stopped early, flown (paper, Fig. 10)."""
        return flown(self.iterations[STOPPED_AFTER - 1], self.vehicle)


@cache  # two figures show it, or three
def time_search() -> TimeSearch:
    """Search as printed, and plan with the search stopped at each iteration before the last."""
    problem, vehicle = load_problem(SECTION_V), load_vehicle(SECTION_V)
    last = plan(problem, MinSnap(), vehicle)
    before = (plan(problem, MinSnap(stop_after=k), vehicle) for k in range(1, len(last.attempts)))
    return TimeSearch((*before, last), vehicle)


def figure_8(begin: Callable[[str], None]) -> PaperFigure:
    """Draw the paths of all iterations, and the thrusts that each asks."""
    search = _searched(begin)
    caption = _path_caption(search)
    with house_style():
        figure = blank_page(HEIGHT, caption.heading, caption.lines)
        path = panel(figure, 0.74, FOOT, 6.2, HEIGHT - FOOT - TITLES)
        _draw_paths(path, search)
        heading(path, "Path", "thin: earlier iterations; vehicles on the last, at equal steps of time")
        thrusts = panel(figure, 7.75, FOOT, 3.45, HEIGHT - FOOT - TITLES)
        _draw_thrusts(thrusts, search)
        heading(
            thrusts, "Thrusts asked of the rotors", "from the least to the largest; red: beyond the limits"
        )
    return PaperFigure(caption, figure)


def figure_9(begin: Callable[[str], None]) -> PaperFigure:
    """Draw how the optimized path is tracked."""
    search = _searched(begin)
    flown, count = search.optimized, len(search.iterations)
    times = _times(search, count)
    caption = Caption(
        9,
        f"Tracking after {count} iterations",
        f"the path after {PAPER_ITERATIONS} iterations, with "
        f"{_times_text(PAPER_TIMES[PAPER_ITERATIONS])}. Forces and moments stay within the dashed "
        "actuator constraints.",
        f"{count} iterations, {_times_text(times)}. Rotor thrusts: {flown.plan.margin}, proven over "
        "continuous time. The largest errors of the simulated flight are "
        f"{length(flown.score.max_position_error_m)} and "
        f"{flown.score.max_attitude_error_deg:.2f}°; rotors are saturated "
        f"{100 * flown.score.saturated_fraction:.1f} % of the time.",
    )
    return _tracking_figure(caption, flown)


def figure_10(begin: Callable[[str], None]) -> PaperFigure:
    """Draw how the path of the search stopped early is tracked: it is not."""
    search = _searched(begin)
    flown = search.stopped
    caption = Caption(
        10,
        f"Tracking when stopped after {STOPPED_AFTER} iterations",
        f"the search stopped early, with {_times_text(PAPER_TIMES[STOPPED_AFTER])}. The constraints are "
        "violated, yet the path is tracked, because the paper's simulation has no actuator limits: “on a "
        "real system, the tracking would not be as good since the actuators would saturate”.",
        f"{_times_text(_times(search, STOPPED_AFTER))}. Required rotor thrusts: {flown.plan.margin}. In "
        f"this simulation the rotors saturate, {100 * flown.score.saturated_fraction:.0f} % of the time. The "
        f"flight {flown.score.sentence}.",
    )
    return _tracking_figure(caption, flown)


def _tracking_figure(caption: Caption, flown: FlownPlan) -> PaperFigure:
    page = tracking_page(flown.plan, flown.vehicle, flown.flight, caption.heading, caption.lines)
    return PaperFigure(caption, page)


def _searched(begin: Callable[[str], None]) -> TimeSearch:
    begin("the search on times")
    return time_search()


def _times(search: TimeSearch, iteration: int) -> tuple[float, float]:
    """When the path of an iteration, counted from 1, is at its waypoint and at its end [s]."""
    t1, t2 = search.iterations[iteration - 1].trajectory.knots[1:]
    return float(t1), float(t2)


def _times_text(times: tuple[float, float]) -> str:
    return f"t₁ = {times[0]:.1f} s, t₂ = {times[1]:.1f} s"


def _path_caption(search: TimeSearch) -> Caption:
    waypoint = search.iterations[-1].trajectory.evaluate(_times(search, len(search.iterations))[0])
    return Caption(
        8,
        "A path of the alternative method",
        "a path from (0, 0, 0) through a height of −2 m, with free x and y, to (6, 0, 0). A search delays "
        "both times, from 0.5 and 2 s, until the actuator constraints hold. The search takes 12 iterations.",
        f"polynomials of degree 9, and {len(search.iterations)} iterations. Only the last iteration keeps "
        "every rotor within −0.2 to 18 N (the paper draws limits without numbers). The path crosses "
        f"−2 m at x = {waypoint[0]:.2f} m, {100 * waypoint[0] / 6.0:.0f} % of the way.",
    )


def _draw_paths(axes: Axes, search: TimeSearch) -> None:
    """Draw all paths in the plane that holds them, the vehicle along the last one."""
    last = search.iterations[-1]
    for each in search.iterations:
        path = PLANE.project(each.trajectory.evaluate(np.linspace(0.0, each.duration, 201)))
        final = each is last
        axes.plot(*path.T, color=INK if final else BAND, linewidth=1.8 if final else 0.9, zorder=2.0 + final)
    shown = reference_poses(plan_reference(last, search.vehicle))
    scale = enlargement(search.vehicle, SIZE)
    for k in shown.rows(np.linspace(0.0, last.duration, POSES)):
        shapes = vehicle_shapes(search.vehicle, shown.position[k], shown.q_world_body[k], scale)
        draw_depth_sorted(axes, shapes, PLANE, zorder=3.5)
    axes.axhline(-2.0, color=MUTED, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1.0)
    axes.text(
        -0.48, -2.05, "z = −2 m at t₁", size=SMALL, color=MUTED, va="top",
        bbox={"fc": "white", "ec": "none", "pad": 1.0},
    )  # fmt: skip
    width, height = size_of(axes)
    half = 3.55
    middle = -1.0
    axes.set(
        xlim=(3.0 - half, 3.0 + half), ylim=(middle - half * height / width, middle + half * height / width),
        xlabel="x [m]", ylabel="z [m]",
    )  # fmt: skip
    mark_ends(axes, PLANE.project(shown.position[[0, -1]]))


def _draw_thrusts(axes: Axes, search: TimeSearch) -> None:
    """Draw the range of thrusts that each iteration asks, over the duration that it comes to."""
    for number, each in enumerate(search.iterations, start=1):
        margin = each.margin
        assert margin is not None, "a plan for a vehicle has its rotors' margin"
        colour = BLUE if each.certified else RED
        axes.plot([number, number], [margin.min_thrust, margin.max_thrust], color=colour, linewidth=4.5)
    axes.set_yscale("symlog", linthresh=20.0)
    limits = (float(search.vehicle.min_thrusts.min()), float(search.vehicle.max_thrusts.max()))
    draw_limits(axes, limits)
    axes.set(xlabel="iteration", ylabel="rotor thrust [N], logarithmic beyond 20 N")
    ticks = [1, 3, STOPPED_AFTER, 9, len(search.iterations)]
    names = [f"{k}\n{search.iterations[k - 1].duration:.1f} s" for k in ticks]
    axes.set_xticks(ticks, names)
