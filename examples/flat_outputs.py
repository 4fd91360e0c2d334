"""A plan as the trajectory object that other simulators ask, tick by tick, for what is wanted next."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.planning import Plan


class FlatOutputs:
    """A plan's flat outputs over time; before its start and after its end it rests at either.

    `update(t)` answers as a trajectory of RotorPy does, so that an object of this class stands where one of
    RotorPy's is expected; `target(t)` gives what gym-pybullet-drones' controllers take. Both know a vehicle's
    attitude by its heading alone, and so lose the rest: the yaw of either end is told throughout.
    """

    @validated
    def __init__(self, plan: Plan) -> None:
        """Prepare to answer of a plan."""
        self._trajectory = plan.trajectory

    @property
    def duration(self) -> float:
        """Of the plan [s]."""
        return self._trajectory.duration

    def update(self, t: float) -> dict[str, Array | float]:
        """Position [m] and its derivatives up to snap, world frame, (3,) each, and the yaw [rad]."""
        names = ("x", "x_dot", "x_ddot", "x_dddot", "x_ddddot")
        outputs: dict[str, Array | float] = {name: self._derivative(t, k) for k, name in enumerate(names)}
        return outputs | {"yaw": self._trajectory.heading, "yaw_dot": 0.0, "yaw_ddot": 0.0}

    def target(self, t: float) -> dict[str, Array]:
        """Position [m], velocity [m/s], roll, pitch and yaw [rad], and their rates, (3,) each."""
        return {
            "target_pos": self._derivative(t, 0),
            "target_vel": self._derivative(t, 1),
            "target_rpy": np.array([0.0, 0.0, self._trajectory.heading]),
            "target_rpy_rates": np.zeros(3),
        }

    def _derivative(self, t: float, order: int) -> Array:
        inside = min(max(t, 0.0), self.duration)
        return self._trajectory.evaluate(inside, order) if order == 0 or inside == t else np.zeros(3)
