"""What the controller tracks, made in blocks of ticks as they are asked for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.components import components
from aerobat.engines.pytree import tree_map
from aerobat.environment import Environment
from aerobat.flatness import reference
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.simulation.flight import setpoint_rows
from aerobat.simulation.loop import Clock
from aerobat.states import Setpoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

BLOCK = 4096  # ticks; blocks begin at its multiples, so that no chunk's size changes a bit of a reference


class ReferenceSource:
    """Set-points of a trajectory for a nominal vehicle, at the ticks of a controller."""

    def __init__(
        self,
        trajectory: Trajectory,
        vehicle: Vehicle,
        environment: Environment,
        rate: float,
        actuation_delay: float,
    ) -> None:
        """Prepare to make set-points.

        Args:
            trajectory: the path.
            vehicle: the nominal one.
            environment: where it flies.
            rate: of the ticks [1/s].
            actuation_delay: the time [s] that commands take to become thrust.
        """
        self.times = trajectory.sample(rate)
        self._trajectory = trajectory
        self._vehicle = vehicle
        self._environment = environment
        self._delay = actuation_delay
        self._period = 1.0 / rate
        self._block = -1

    def __len__(self) -> int:
        return len(self.times)

    def setpoint(self, begin: int, end: int) -> Setpoint:
        """Set-points of the ticks from `begin` to before `end`, all of one block."""
        self._make(begin)
        first = self._block * BLOCK
        return setpoint_rows(self._setpoint, slice(begin - first, end - first))

    def chunk(self, begin: int, end: int) -> ReferencePoint:
        """References of the controller at the ticks from `begin` to before `end`, all of one block."""
        self._make(begin)
        first = self._block * BLOCK
        points: ReferencePoint = tree_map(lambda leaf: leaf[begin - first : end - first], self._points)
        return points

    def clock(self, begin: int, end: int) -> Clock:
        """Time about the ticks from `begin` to before `end`.

        All periods but the last are alike to the last bit, so that an engine may see that they are.
        """
        ticks = np.arange(begin, end)
        return Clock(self._period_after(np.maximum(ticks - 1, 0)), self._period_after(ticks))

    def _period_after(self, ticks: NDArray[np.intp]) -> Array:
        """The period [s] that begins with each tick; the last begins none."""
        last = len(self.times) - 1
        periods = np.where(ticks == last, 0.0, self._period)
        return np.where(ticks == last - 1, self.times[last] - self.times[max(last - 1, 0)], periods)

    def _make(self, tick: int) -> None:
        block = tick // BLOCK
        if block == self._block:
            return
        times = self.times[block * BLOCK : (block + 1) * BLOCK]
        later = np.minimum(times + self._delay, self.times[-1])
        now, ahead = (
            reference(self._trajectory, self._vehicle, times=t, environment=self._environment).setpoint
            for t in (times, later)
        )
        self._block = block
        self._setpoint = now
        self._points = reference_points(now, ahead, self._environment)


def reference_points(setpoint: Setpoint, ahead: Setpoint, environment: Environment) -> ReferencePoint:
    """Set-points now, and those at the time when commands will have taken effect, as kernels read them."""
    now = setpoint.flat.acceleration + environment.weight
    then = ahead.flat.acceleration + environment.weight
    return ReferencePoint(
        components(setpoint.flat.position),
        components(setpoint.flat.velocity),
        components(now),
        components(setpoint.flat.jerk),
        components(setpoint.q_world_body),
        components(so3.rotate(setpoint.q_world_body, setpoint.omega_body)),
        Lookahead(
            np.linalg.norm(then, axis=-1) - np.linalg.norm(now, axis=-1),
            components(so3.rotate(ahead.q_world_body, ahead.omega_body)),
            components(so3.rotate(ahead.q_world_body, ahead.omega_dot_body)),
        ),
    )
