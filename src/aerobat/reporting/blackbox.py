"""A flight controller's own log beside its plan: planned, commanded and measured rates, and the motors."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

from aerobat.declaration import validated
from aerobat.flatness import reference
from aerobat.interchange.blackbox import Blackbox
from aerobat.planning import Plan
from aerobat.reporting.page import blank_page, column, heading, house_style, legend
from aerobat.reporting.style import BLUE, INK, MUTED, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@validated
def blackbox_figure(log: Blackbox, plan: Plan) -> Figure:
    """Draw the planned body rates, those that the sticks commanded and the gyro measured, and the motors.

    The log's clock is aligned with the plan's where the measured rates fit best. Raises SpecError for a log
    that is shorter than the plan.
    """
    planned = reference(plan, rate=500.0)
    begin = log.begin(planned.times, planned.setpoint.omega_body)
    rows = (log.times >= begin) & (log.times <= begin + plan.duration)
    times = log.times[rows] - begin
    with house_style():
        about = f"the plan begins at {begin:.3f} s of the log's clock"
        height = 9.9  # [in]
        figure = blank_page(height, f"{plan.problem.name} by the flight controller's log", [about])
        *rates, motors = column(figure, height, [1.0] * 4)
        for k, (name, axes) in enumerate(zip(("Roll", "Pitch", "Yaw"), rates, strict=True)):
            heading(axes, name, "[rad/s]")
            axes.plot(planned.times, planned.setpoint.omega_body[:, k], color=INK, label="plan")
            axes.plot(times, log.rate_setpoint[rows, k], color=BLUE, linewidth=0.8, label="asked")
            axes.plot(times, log.omega_body[rows, k], color=RED, linewidth=0.8, label="measured")
        heading(motors, "Motors", "[%] of their range")
        for motor, colour in zip(log.motors[rows].T, cycle((INK, BLUE, RED, MUTED)), strict=False):
            motors.plot(times, 100.0 * motor, color=colour, linewidth=0.8)
        for axes in figure.axes:
            axes.set_xlim(0.0, plan.duration)
        legend(rates[0], 0.1)
        motors.set_xlabel("time [s]")
    return figure
