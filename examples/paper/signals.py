"""One quantity over time, reference against actual, with the limits that it should keep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array, Mask
from aerobat.flatness import Reference
from aerobat.reporting.panels.timelines import LIMIT, draw_limits, fit_to_limits
from aerobat.reporting.style import BAND, INK, RED
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle, wrench

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LimitPair = tuple[float, float]

STILL = 0.01  # what changes by less than this fraction of its scale stands still
REFERENCE_WIDTH, ACTUAL_WIDTH = 4.0, 1.2  # [pt]
LEGEND = ("reference", "actual", "limits", "saturated")
SATURATED = (RED, 0.13)
NEAR = 0.01  # of a rotor's range: a saturated command this near to a limit is at it, or soon will be


@dataclass(frozen=True, eq=False)
class Signal:
    """The reference of one quantity (T,), and what a flight gave (T',) for as long as it lasted."""

    label: str  # quantity and unit
    reference: Array
    actual: Array
    limits: LimitPair | None = None
    saturated: Mask | None = None  # where rotors could give no more, (T',)

    @property
    def moves(self) -> bool:
        """True where a quantity with limits changes enough to show beside them."""
        low, high = self.limits or (0.0, 0.0)
        return bool(max(np.ptp(self.reference), np.ptp(self.actual)) > STILL * (high - low))


def motion_signals(reference: Reference, flight: Flight) -> tuple[list[Signal], list[Signal]]:
    """Positions and velocities along those of the world's axes on which anything moves; all at a hover."""
    planned, actual = reference.setpoint.flat, flight.states
    extents = np.ptp(planned.position, axis=0)
    moves = np.maximum(extents, np.ptp(actual.position, axis=0)) > STILL * max(float(extents.max()), STILL)
    positions, velocities = [], []
    for i in [i for i in range(3) if moves[i] or not moves.any()]:
        position = planned.position[:, i], actual.position[:, i]
        velocity = planned.velocity[:, i], actual.velocity[:, i]
        positions.append(Signal(f"{'xyz'[i]} [m]", *position, saturated=flight.saturated))
        velocities.append(Signal(f"$v_{'xyz'[i]}$ [m/s]", *velocity, saturated=flight.saturated))
    return positions, velocities


def effort_signals(reference: Reference, flight: Flight, vehicle: Vehicle) -> list[Signal]:
    """Collective thrust, and the moments about the body's axes that are used; all of them where none is."""
    low, high = wrench_limits(vehicle)
    planned = reference.setpoint.wrench
    actual = wrench(vehicle, flight.thrusts)
    thrust = Signal("thrust [N]", planned.thrust, actual.thrust, (low[0], high[0]), flight.saturated)
    moments = [
        Signal(
            f"$M_{'xyz'[i]}$ [N·m]", planned.moment_body[:, i], actual.moment_body[:, i],
            (low[i + 1], high[i + 1]), flight.saturated,
        )
        for i in range(3)
    ]  # fmt: skip
    return [thrust, *([signal for signal in moments if signal.moves] or moments)]


def rotor_signals(reference: Reference, flight: Flight, vehicle: Vehicle) -> list[Signal]:
    """The thrust of every rotor."""
    saturated = at_limit(flight)
    limits = zip(vehicle.min_thrusts.tolist(), vehicle.max_thrusts.tolist(), strict=True)
    return [
        Signal("thrust [N]", reference.rotor_thrusts[:, i], flight.thrusts[:, i], limit, saturated[:, i])
        for i, limit in enumerate(limits)
    ]


def wrench_limits(vehicle: Vehicle) -> tuple[Array, Array]:
    """The minimum and the maximum of thrust and moments (T [N], Mx, My, Mz [N·m]), each for itself, (4,).

    What rotors anywhere within their limits give of it, whatever becomes of the others.
    """
    ends = vehicle.allocation * np.stack([vehicle.min_thrusts, vehicle.max_thrusts])[:, None]
    return ends.min(axis=0).sum(axis=-1), ends.max(axis=0).sum(axis=-1)


def at_limit(flight: Flight) -> Mask:
    """True where rotors are sent to a limit while limits change the commands, (T, n)."""
    near = NEAR * (flight.max_thrusts - flight.min_thrusts)
    low, high = flight.min_thrusts + near, flight.max_thrusts - near
    beyond = (flight.commands <= low) | (flight.commands >= high)
    return np.asarray(beyond & flight.saturated[..., None])


def draw_signal(axes: Axes, signal: Signal, reference_times: Array, actual_times: Array, named: bool) -> None:
    """Draw reference as a band, actual as a line, limits dashed and saturation shaded.

    Args:
        axes: Where to draw.
        signal: What to draw.
        reference_times: Of the reference's samples [s], (T,).
        actual_times: Of the flight's [s], (T',).
        named: Whether to name, for a legend, all that a page of signals shows.
    """
    reference, actual, limits, saturated = LEGEND if named else ("",) * len(LEGEND)
    axes.plot(reference_times, signal.reference, color=BAND, linewidth=REFERENCE_WIDTH, label=reference)
    axes.plot(actual_times, signal.actual, color=INK, linewidth=ACTUAL_WIDTH, label=actual)
    axes.set_ylabel(signal.label)
    if actual_times[-1] < reference_times[-1]:  # the flight went astray
        axes.plot(actual_times[-1:], signal.actual[-1:], "x", color=INK, markersize=5.0, mew=1.4)
    if signal.limits is not None:
        draw_limits(axes, signal.limits)
        fit_to_limits(axes, signal.limits, np.concatenate([signal.reference, signal.actual]))
    if named:
        axes.plot([], [], label=limits, **LIMIT)
    if signal.saturated is not None:
        shade(axes, actual_times, signal.saturated, saturated)


def shade(axes: Axes, times: Array, where: Mask, label: str = "") -> None:
    """Draw a pale shade over the control periods that begin `where` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where[:-1], [False]])))
    spans = [(times[a], times[b] - times[a]) for a, b in edges.reshape(-1, 2)]
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor=SATURATED, linewidth=0.0,
            zorder=0.3, label=label,
        )  # fmt: skip
