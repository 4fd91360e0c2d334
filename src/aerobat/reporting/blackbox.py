"""A flight controller's own log beside its plan: rates that were planned, asked and measured, and motors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aerobat.declaration import validated
from aerobat.flatness import reference
from aerobat.interchange.blackbox import Blackbox
from aerobat.planning import Plan
from aerobat.reporting.page import AXIS, TITLES, blank_page, heading, house_style, legend, panel
from aerobat.reporting.style import BLUE, INK, MUTED, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROW = 1.5  # [in] the height of a timeline
GAP = 0.85  # [in] between them, for a title
LEFT, WIDTH = 0.9, 10.4  # [in]
RATE = 500.0  # [1/s] of the plan's rates
_AXES = ("Roll", "Pitch", "Yaw")
_COLOURS = (INK, BLUE, RED, MUTED)


@validated
def blackbox_figure(log: Blackbox, plan: Plan) -> Figure:
    """Draw the body rates that a plan has, those that the sticks asked and the gyro measured, and the motors.

    The log's clock is laid on the plan's where the measured rates fit best. Raises SpecError for a log that
    is shorter than the plan.
    """
    planned = reference(plan, rate=RATE)
    begin = log.begin(planned.times, planned.setpoint.omega_body)
    rows = (log.times >= begin) & (log.times <= begin + plan.duration)
    times = log.times[rows] - begin
    with house_style():
        height = AXIS + 4 * (ROW + GAP) + TITLES
        about = f"the plan begins at {begin:.3f} s of the log's clock"
        figure = blank_page(height, f"{plan.problem.name} by the flight controller's log", [about])
        for k, name in enumerate((*_AXES, "Motors")):
            axes = panel(figure, LEFT, height - TITLES - ROW - k * (ROW + GAP), WIDTH, ROW)
            if k < len(_AXES):
                heading(axes, name, "[rad/s]")
                axes.plot(planned.times, planned.setpoint.omega_body[:, k], color=INK, label="plan")
                axes.plot(times, log.rate_setpoint[rows, k], color=BLUE, linewidth=0.8, label="asked")
                axes.plot(times, log.omega_body[rows, k], color=RED, linewidth=0.8, label="measured")
            else:
                heading(axes, name, "[%] of their range")
                for motor, colour in zip(
                    log.motors[rows].T, np.resize(_COLOURS, log.motors.shape[1]), strict=True
                ):
                    axes.plot(times, 100.0 * motor, color=colour, linewidth=0.8)
            axes.set_xlim(0.0, plan.duration)
            if k == 0:
                legend(axes, 0.1)
        axes.set_xlabel("time [s]")
    return figure
