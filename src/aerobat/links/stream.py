"""Set-points of a plan at any time, which live links stream by their own clocks."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.pytree import tree_leaves, tree_unflatten
from aerobat.environment import Environment
from aerobat.flatness import reference
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.links.goals import PathGoal
from aerobat.simulation.nested import rows_of
from aerobat.simulation.reference_source import reference_points
from aerobat.states import FlatState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

_RATE = 1000.0  # [1/s] of rows; linear interpolation errs by 0.1 mm and 0.01° in the fastest flips


class SetpointStream:
    """Set-points of a trajectory with an offset, at any time; constant before its start and after its end."""

    def __init__(
        self, trajectory: Trajectory, vehicle: Vehicle, environment: Environment, offset: Array
    ) -> None:
        """Prepare the set-points.

        Args:
            trajectory: the path.
            vehicle: the nominal vehicle.
            environment: of the flight.
            offset: position of the path's origin [m], world, (3,).
        """
        self.trajectory = trajectory
        self.offset = np.asarray(offset, dtype=float)  # [m] position of the path's origin, world, (3,)
        rows = reference(trajectory, vehicle, rate=_RATE, environment=environment).setpoint
        ticks = len(rows.q_world_body)
        following = rows_of(rows, np.minimum(np.arange(1, ticks + 1), ticks - 1))
        points = reference_points(rows, following, environment, vehicle)
        self._tree = points
        self._rows = np.column_stack(tree_leaves(points))

    @property
    def duration(self) -> float:
        """The duration of the trajectory [s]."""
        return self.trajectory.duration

    def flat(self, time: float) -> FlatState:
        """Return position to snap [m/s^k] at a time [s] since the start, (3,) each."""
        flat = self.trajectory.flat(min(max(time, 0.0), self.duration))
        return FlatState(flat.position + self.offset, flat.velocity, flat.acceleration, flat.jerk, flat.snap)

    def goal(self, time: float) -> PathGoal:
        """Return the path's point at a time [s] since the start, for a vehicle that tracks it by itself."""
        point, flat = self.at(time), self.flat(time)
        turning = (np.array(part) for part in (point.q_world_body, point.omega, point.omega_dot))
        return PathGoal(flat.position, flat.velocity, flat.acceleration, flat.jerk, *turning)

    def at(self, time: float) -> ReferencePoint:
        """Return the controller's reference at a time [s] since the start, in plain numbers."""
        place = min(max(time, 0.0), self.duration) * _RATE
        row = min(int(place), len(self._rows) - 2)
        # the last row is at the end, which may be less than a period after the row before
        length = 1.0 if row < len(self._rows) - 2 else self.duration * _RATE - row
        fraction = min((place - row) / length, 1.0)
        values = self._rows[row] + fraction * (self._rows[row + 1] - self._rows[row])
        point: ReferencePoint = tree_unflatten(self._tree, values.tolist())
        x, y, z = point.position
        dx, dy, dz = self.offset.tolist()
        return point._replace(position=(x + dx, y + dy, z + dz))
