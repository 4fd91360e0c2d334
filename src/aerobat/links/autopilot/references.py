"""The references that an autopilot follows, from a client's points, pieces of a path or attitudes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.pytree import components
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.links.goals import AttitudeGoal, PathPiece, PositionGoal
from aerobat.simulation.autopilot.braking import point_reference
from aerobat.simulation.autopilot.loop import COMMAND_HOLD_TIME

_REST_THRESHOLD = 0.5  # [m/s] and [m/s²]: a piece that ends with less motion ends almost at rest
_SMOOTHING = 0.002  # [s] time constant of the low-pass filter on the change of commanded rates and thrust


class PointReference(NamedTuple):
    """A position goal, extrapolated by its velocity."""

    goal: PositionGoal
    arrived: float  # [s]

    def reference(self, times: Array, gravity: float) -> ReferencePoint:
        """Return references at times [s], leaves (T,)."""
        goal = self.goal
        age = np.clip(times - self.arrived, 0.0, COMMAND_HOLD_TIME)[:, None]
        position = goal.position + age * goal.velocity
        velocity = np.broadcast_to(goal.velocity, position.shape)
        acceleration = np.broadcast_to(goal.acceleration, position.shape)
        return point_reference(position, velocity, acceleration, np.zeros_like(position), goal.yaw, gravity)


class PathReference(NamedTuple):
    """A short piece of a path, extrapolated beyond its end by its snap and angular jerk."""

    piece: PathPiece

    @property
    def ends_in_motion(self) -> bool:
        """True unless the piece ends almost at rest."""
        end = self.piece.end
        return (
            float(np.linalg.norm(end.velocity)) > _REST_THRESHOLD
            or float(np.linalg.norm(end.acceleration)) > _REST_THRESHOLD
        )

    def reference(self, times: Array, period: float, gravity: float) -> ReferencePoint:
        """Return references at times [s], leaves (T,), for a controller that steps every `period` [s]."""
        begin, end, stamp, duration = self.piece
        age = np.clip(times - stamp, 0.0, duration + COMMAND_HOLD_TIME)[:, None]
        snap = (end.jerk - begin.jerk) / duration
        position, velocity, acceleration, jerk, _ = _extrapolated(age, (*begin[:4], snap))
        (omega_body, omega_dot_body), (_, final) = (
            [so3.unrotate(goal.q_world_body, rate) for rate in (goal.omega, goal.omega_dot)]
            for goal in (begin, end)
        )
        turning = omega_body, omega_dot_body, (final - omega_dot_body) / duration
        rotation, *now = _extrapolated(age, (np.zeros(3), *turning))
        q = so3.multiply(begin.q_world_body, so3.exp(rotation))
        omega, omega_dot, ahead, ahead_dot = (
            components(so3.rotate(q, rate)) for rate in (*now[:2], *_extrapolated(age + period, turning)[:2])
        )
        thrust = acceleration + gravity * so3.UP
        coming = np.linalg.norm(thrust + period * (jerk + 0.5 * period * snap), axis=-1)
        return ReferencePoint(
            components(position),
            components(velocity),
            components(thrust),
            components(jerk),
            components(q),
            omega,
            omega_dot,
            Lookahead(coming - np.linalg.norm(thrust, axis=-1), ahead, ahead_dot),
        )


def _extrapolated(age: Array, derivatives: Sequence[Array]) -> list[Array]:
    """Return a quantity and its derivatives at ages [s] (T, 1) by Taylor series; the last is constant."""
    last = len(derivatives) - 1
    parts = [np.broadcast_to(derivatives[last], (len(age), 3))] * (last + 1)
    for lower in range(last):
        for upper in range(last - 1, lower - 1, -1):  # by Horner's rule
            parts[lower] = derivatives[upper] + age / (upper - lower + 1) * parts[lower]
    return parts


class AttitudeReference(NamedTuple):
    """An attitude goal, extrapolated by its rates and by the changes of rates and thrust in the last goals.

    Goals carry the time at which they were sent, so that a varying delay of the link has little effect.
    """

    goal: AttitudeGoal
    sent: float  # [s] by the sender's clock
    since: float  # [s] by our clock, from when it holds
    omega_dot: Array = np.zeros(3)  # [rad/s²] body axes, (3,)
    thrust_rate: float = 0.0  # [N/s]

    def followed_by(self, goal: AttitudeGoal, sent: float, arrived: float) -> AttitudeReference:
        """Return the reference of the next goal, or this one where the next goal is older (reordered)."""
        elapsed = sent - self.sent
        if abs(elapsed) > 10.0 * COMMAND_HOLD_TIME:
            return AttitudeReference(goal, sent, arrived)
        if elapsed <= 0.0:
            return self
        fraction = elapsed / (elapsed + _SMOOTHING)
        change = (np.array(goal.omega_body) - self.goal.omega_body) / elapsed
        rate = (goal.thrust - self.goal.thrust) / elapsed
        return AttitudeReference(
            goal,
            sent,
            min(arrived, self.since + elapsed + 0.1 * max(arrived - self.since - elapsed, 0.0)),
            self.omega_dot + fraction * (change - self.omega_dot),
            self.thrust_rate + fraction * (rate - self.thrust_rate),
        )

    def reference(self, times: Array, period: float, mass: float) -> ReferencePoint:
        """Return references at times [s], leaves (T,), for a controller's period [s] and a mass [kg]."""
        age = np.clip(times - self.since, 0.0, COMMAND_HOLD_TIME)[:, None]
        omega_body = self.goal.omega_body + age * self.omega_dot
        mean_rate = self.goal.omega_body + 0.5 * age * self.omega_dot
        q = so3.multiply(so3.normalize(np.array(self.goal.q_world_body)), so3.exp(age * mean_rate))
        thrust = (self.goal.thrust + age * self.thrust_rate) / mass
        zero = components(np.zeros((len(times), 3)))
        omega, omega_dot, ahead = (
            components(so3.rotate(q, rate))
            for rate in (
                omega_body,
                np.broadcast_to(self.omega_dot, omega_body.shape),
                omega_body + period * self.omega_dot,
            )
        )
        return ReferencePoint(
            zero,
            zero,
            components(thrust * so3.thrust_axis(q)),
            zero,
            components(q),
            omega,
            omega_dot,
            Lookahead(np.full(len(times), period * self.thrust_rate / mass), ahead, omega_dot),
        )
