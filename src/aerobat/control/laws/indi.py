"""Incremental nonlinear dynamic inversion: Smeur, Chu and de Croon, JGCD 39 (2016), 450-461."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from aerobat.control.law import ControlLaw, Seen, controller
from aerobat.control.laws.attitude import attitude_feedback, axes_along, collective
from aerobat.declaration import NonNegative, Positive
from aerobat.kernels import motors
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import thrust_demand
from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import ZERO, add, add_scaled, clamp_norm, low_passed, scale, subtract, transform


class Increments(NamedTuple):
    """Measured quantities with the same low-pass filter, so that they refer to the same instant."""

    omega: Vector  # [rad/s] body, at the last tick
    angular_acceleration: Vector  # [rad/s²] body
    moment: Vector  # [N·m] of the rotors, body
    integral: Vector  # [m·s] of the position error, world
    has_omega: Scalar  # 1, or 0 before the first tick


@controller("indi")
class Indi(ControlLaw):
    """Incremental inversion: the rotors' moment is changed by the missing angular acceleration.

    M = M_f + J (α − α_f), where f marks filtered measurements. Other moments on the body need no model.
    Attitude and position are controlled as in Lee et al. (2010), with an integral of the position error.
    """

    # moments are rejected by the law itself, forces by the integral
    TAKES_DISTURBANCES: ClassVar[bool] = False

    position_gain: NonNegative = 25.0  # [1/s²]
    velocity_gain: NonNegative = 9.0  # [1/s]
    integral_gain: NonNegative = 10.0  # [1/s³]
    max_integral: NonNegative = 0.5  # [m·s]
    max_feedback: NonNegative = 15.0  # [m/s²]
    attitude_gain: NonNegative = 625.0  # [1/s²]
    rate_gain: NonNegative = 42.5  # [1/s]
    filter_time: Positive = 0.02  # [s] time constant of the low-pass filter of measurements

    def init(self, ops: Ops, model: ControllerModel, seen: Seen) -> Increments:
        """Return the measurements before the first tick."""
        acceleration = to_body(axes(seen.body.q_world_body), seen.reference.omega_dot)
        moment = motors.wrench(model.airframe.rotors, seen.thrusts).moment_body
        return Increments(seen.body.omega_body, acceleration, moment, ZERO, 0.0)

    def step(
        self, ops: Ops, model: ControllerModel, state: Any, seen: Seen, elapsed: Scalar
    ) -> tuple[Any, RotorWrench]:
        """Return the force and the moment."""
        body, reference = seen.body, seen.reference
        body_axes = axes(body.q_world_body)
        measured = self._measured(ops, model, state, seen, elapsed)
        e_v = subtract(reference.velocity, body.velocity)
        e_x = subtract(reference.position, body.position)
        feedback = add_scaled(
            add_scaled(scale(self.position_gain, e_x), self.velocity_gain, e_v),
            self.integral_gain,
            measured.integral,
        )
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
        thrust = add(demand.value, clamp_norm(ops, feedback, self.max_feedback))
        desired = axes_along(ops, thrust, reference)
        feedback = attitude_feedback(ops, model, seen, desired, self.attitude_gain, self.rate_gain)
        wanted = add(to_body(body_axes, reference.omega_dot), feedback)
        missing = subtract(wanted, measured.angular_acceleration)
        increment = transform(model.airframe.mass_properties.inertia, missing)
        load = RotorWrench(collective(model, body_axes, thrust), add(measured.moment, increment))
        return measured, load

    def _measured(
        self, ops: Ops, model: ControllerModel, state: Increments, seen: Seen, elapsed: Scalar
    ) -> Increments:
        """Return the measurements a tick later."""
        acceleration = scale(1.0 / elapsed, subtract(seen.body.omega_body, state.omega))
        acceleration = select_tree(ops, state.has_omega > 0.5, acceleration, state.angular_acceleration)
        moment = motors.wrench(model.airframe.rotors, seen.thrusts).moment_body
        error = subtract(seen.reference.position, seen.body.position)
        return Increments(
            seen.body.omega_body,
            low_passed(state.angular_acceleration, acceleration, self.filter_time, elapsed),
            low_passed(state.moment, moment, self.filter_time, elapsed),
            clamp_norm(ops, add_scaled(state.integral, elapsed, error), self.max_integral),
            1.0,
        )
