"""The alignment of a log's clock and axes with those of its plan."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.errors import SpecError
from aerobat.simulation import Flight
from aerobat.trajectory import Trajectory

MAX_MISFIT = 0.01  # [m] RMS distance of set-points from the plan's path above which the plan is another one
_ROWS = 60  # rows of the log that are compared in the search for the time shift
_SHIFTS = 201  # time shifts of the initial grid


@by_value
class Alignment:
    """The transformation of a plan onto a log: a turn about the vertical, a translation and a time shift."""

    time_shift: float  # [s] time on the log's clock when the plan begins
    yaw: float  # [rad] of the plan's axes in the log's axes
    translation: Array  # [m] of the plan's origin in the log's axes, (3,)
    misfit: float  # [m] remaining RMS distance of set-points from the plan's path

    @property
    def moved(self) -> float:
        """The length of the translation [m]."""
        return float(np.linalg.norm(self.translation))

    @property
    def is_none(self) -> bool:
        """True where log and plan share clock and axes."""
        return max(abs(self.time_shift), abs(self.yaw), self.moved) < 1e-4


def aligned(flight: Flight, trajectory: Trajectory) -> Alignment:
    """Align a plan's path with a log's set-points. Raises SpecError where the log is of another plan."""
    rows = np.unique(np.linspace(0, len(flight.times) - 1, _ROWS).astype(int))
    times, setpoints = flight.times[rows], flight.setpoint_position[rows]

    def at(shift: float) -> Alignment:
        return _fit_at_shift(shift, times, setpoints, trajectory)

    first, last = times[0] - trajectory.duration, times[-1]
    shifts = [0.0, times[0], *np.linspace(first, last, _SHIFTS)]
    best = min(shifts, key=lambda shift: at(shift).misfit)
    step = (last - first) / (_SHIFTS - 1)
    found = minimize_scalar(
        lambda shift: at(shift).misfit,
        bounds=(best - step, best + step),
        method="bounded",
        options={"xatol": 1e-7},
    )
    alignment = min(at(best), at(float(found.x)), key=lambda one: one.misfit)
    if alignment.misfit > MAX_MISFIT:
        off = f"{100 * alignment.misfit:.1f} cm"
        raise SpecError(
            f"plan: its path lies {off} from the flight's set-points at best; give the flight's own plan"
        )
    return alignment


def _fit_at_shift(shift: float, times: Array, setpoints: Array, trajectory: Trajectory) -> Alignment:
    path = trajectory.evaluate(np.clip(times - shift, 0.0, trajectory.duration), 0)
    middle, goal = path.mean(axis=0), setpoints.mean(axis=0)
    (x, y, _), (u, v, _) = (path - middle).T, (setpoints - goal).T
    yaw = float(np.arctan2(np.sum(x * v - y * u), np.sum(x * u + y * v)))
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    translation = goal - turn @ middle
    rest = path @ turn.T + translation - setpoints
    return Alignment(shift, yaw, translation, float(np.sqrt(np.mean(np.sum(rest**2, axis=1)))))
