"""One quantity over time, asked against flown, with the limits that it should keep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.flatness import Reference
from aerobat.flight import Flight
from aerobat.reporting.page import size_of
from aerobat.reporting.style import BAND, INK, MUTED, RED, SMALL
from aerobat.vehicle import Vehicle, wrench

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Mask = NDArray[np.bool_]
Limits = tuple[float, float]

STILL = 0.01  # what changes by less than this share of its scale stands still
REACH = 1.0  # by how many times the limits' distance an axis extends beyond them, at most
ASKED_WIDTH, FLOWN_WIDTH = 4.0, 1.2  # [pt]
SATURATED = (RED, 0.13)
LIMIT: dict[str, Any] = {"color": INK, "linewidth": 0.9, "linestyle": (0, (4, 2))}
NEAR = 0.01  # of a rotor's range: a saturated command this near to a limit is at it, or soon will be


@dataclass(frozen=True, eq=False)
class Signal:
    """What was asked of one quantity (T,), and what a flight gave (T',) for as long as it lasted."""

    label: str  # quantity and unit
    asked: Array
    flown: Array
    limits: Limits | None = None
    saturated: Mask | None = None  # where rotors could give no more, (T',)

    @property
    def moves(self) -> bool:
        """Whether a quantity with limits changes enough to show beside them."""
        low, high = self.limits or (0.0, 0.0)
        return bool(max(np.ptp(self.asked), np.ptp(self.flown)) > STILL * (high - low))


def motion_signals(asked: Reference, flight: Flight) -> tuple[list[Signal], list[Signal]]:
    """Positions and velocities along those of the world's axes on which anything moves; all at a hover."""
    wanted, flown = asked.setpoint.flat, flight.states
    extents = np.ptp(wanted.position, axis=0)
    moves = np.maximum(extents, np.ptp(flown.position, axis=0)) > STILL * max(float(extents.max()), STILL)
    axes = [i for i in range(3) if moves[i] or not moves.any()]
    positions = _along(axes, ("x [m]", "y [m]", "z [m]"), wanted.position, flown.position, flight)
    names = ("$v_x$ [m/s]", "$v_y$ [m/s]", "$v_z$ [m/s]")
    return positions, _along(axes, names, wanted.velocity, flown.velocity, flight)


def _along(
    axes: Sequence[int], names: Sequence[str], asked: Array, flown: Array, flight: Flight
) -> list[Signal]:
    return [Signal(names[i], asked[:, i], flown[:, i], saturated=flight.saturated) for i in axes]


def effort_signals(asked: Reference, flight: Flight, vehicle: Vehicle) -> list[Signal]:
    """Collective thrust, and the moments about the body's axes that are used; all of them where none is."""
    flown, (low, high) = wrench(vehicle, flight.thrusts), wrench_limits(vehicle)
    wanted, saturated = asked.setpoint.wrench, flight.saturated
    thrust = Signal("thrust [N]", wanted.thrust, flown.thrust, (low[0], high[0]), saturated)
    moments = [
        Signal(
            f"{name} [N·m]", wanted.moment_body[:, i], flown.moment_body[:, i], (low[i + 1], high[i + 1]),
            saturated,
        )
        for i, name in enumerate(("$M_x$", "$M_y$", "$M_z$"))
    ]  # fmt: skip
    return [thrust, *([signal for signal in moments if signal.moves] or moments)]


def rotor_signals(asked: Reference, flight: Flight, vehicle: Vehicle) -> list[Signal]:
    """The thrust of every rotor."""
    saturated = at_limit(flight)
    limits = zip(vehicle.min_thrusts.tolist(), vehicle.max_thrusts.tolist(), strict=True)
    return [
        Signal("thrust [N]", asked.rotor_thrusts[:, i], flight.thrusts[:, i], limit, saturated[:, i])
        for i, limit in enumerate(limits)
    ]


def wrench_limits(vehicle: Vehicle) -> tuple[Array, Array]:
    """The least and the most of thrust and moments (T [N], Mx, My, Mz [N·m]), each for itself, (4,).

    What rotors anywhere within their limits give of it, whatever becomes of the others.
    """
    ends = vehicle.allocation * np.stack([vehicle.min_thrusts, vehicle.max_thrusts])[:, None]
    return ends.min(axis=0).sum(axis=-1), ends.max(axis=0).sum(axis=-1)


def at_limit(flight: Flight) -> Mask:
    """Which rotors are sent to a limit while limits change the commands, (T, n)."""
    near = NEAR * (flight.max_thrusts - flight.min_thrusts)
    low, high = flight.min_thrusts + near, flight.max_thrusts - near
    beyond = (flight.commands <= low) | (flight.commands >= high)
    return np.asarray(beyond & flight.saturated[..., None])


def draw_signal(axes: Axes, signal: Signal, asked_at: Array, flown_at: Array, named: bool) -> None:
    """Asked as a band, flown as a line, limits dashed and saturation shaded; with names for a legend.

    The names are those of all that a page of signals shows.
    """
    axes.plot(asked_at, signal.asked, color=BAND, linewidth=ASKED_WIDTH, label="asked" if named else "")
    axes.plot(flown_at, signal.flown, color=INK, linewidth=FLOWN_WIDTH, label="flown" if named else "")
    axes.set_ylabel(signal.label)
    if flown_at[-1] < asked_at[-1]:  # the flight went astray
        axes.plot(flown_at[-1:], signal.flown[-1:], "x", color=INK, markersize=5.0, mew=1.4)
    if signal.limits is not None:
        draw_limits(axes, signal.limits)
        fit_to_limits(axes, signal.limits, np.concatenate([signal.asked, signal.flown]))
    if named:
        axes.plot([], [], label="limits", **LIMIT)
    if signal.saturated is not None:
        shade(axes, flown_at, signal.saturated, "saturated" if named else "")


def draw_limits(axes: Axes, limits: Sequence[float]) -> None:
    """Dashed lines across axes."""
    for limit in limits:
        axes.axhline(limit, **LIMIT)


def fit_to_limits(axes: Axes, limits: Sequence[float], values: Array) -> None:
    """An upright axis that shows the limits and the values (...), cut off, and saying so, far beyond them."""
    low, high = min(limits), max(limits)
    least, most = min(float(values.min()), low), max(float(values.max()), high)
    bottom, top = max(least, low - REACH * (high - low)), min(most, high + REACH * (high - low))
    pad = 0.08 * (top - bottom)
    axes.set_ylim(bottom - pad, top + pad)
    if least < bottom or most > top:
        x, y = 1.0 - 0.06 / size_of(axes)
        axes.text(
            x, y, f"cut off: {_signed(least)} to {_signed(most)}", size=SMALL, color=MUTED, ha="right",
            va="top", transform=axes.transAxes, bbox={"fc": "white", "ec": "none", "pad": 1.5}, zorder=4.0,
        )  # fmt: skip


def shade(axes: Axes, times: Array, where: Mask, label: str = "") -> None:
    """A pale shade over the control periods that begin `where` (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where[:-1], [False]])))
    spans = [(times[a], times[b] - times[a]) for a, b in edges.reshape(-1, 2)]
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor=SATURATED, linewidth=0.0,
            zorder=0.3, label=label,
        )  # fmt: skip


def _signed(value: float) -> str:
    return f"{value:.4g}".replace("-", "−")
