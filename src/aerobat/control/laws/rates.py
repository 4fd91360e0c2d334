"""Collective thrust and body rates (CTBR): the outer loop for a flight controller with a rate loop."""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from aerobat.control.law import ControlLaw, Seen, controller
from aerobat.declaration import NonNegative, Positive
from aerobat.kernels.control import ControllerModel, collective
from aerobat.kernels.control_loops import (
    PositionLoopState,
    ReferencePoint,
    attitude_command,
    attitude_error,
    init_position_loop,
    moment_and_change,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.ops import Ops, Scalar, Vector
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.rate_loop import RateSetpoint, rate_gains, times
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import ZERO, add, add_scaled, clip_components, norm, scale, subtract, transform

_MAX_YAW_RATIO = 1.0 / 3.0  # [-] largest yaw gain over that of the inner loop; a faster one is underdamped
_MAX_TILT_RATIO = 0.215  # [-] largest tilt gain over the frequency of the inner loop's poles, likewise
# [m/s²] below this specific thrust corrections are reduced, because small errors swing its direction
_FULL_THRUST = 9.8


class RatesState(NamedTuple):
    """State of the outer loop from tick to tick, including its set-point."""

    outer: PositionLoopState
    integral: Vector  # [rad] integral that feed-forward has left in the inner loop
    setpoint: RateSetpoint


@controller("rates")
class Rates(ControlLaw):
    """Body rates and collective thrust (CTBR) for the inner loop of a flight controller.

    Position and attitude are controlled as by the tracking controller, with the vehicle's position gains. The
    reference's moment, with compensated rotor lag, is fed forward through the inverse of the inner loop's
    PID. The inner loop is `kernels.rate_loop`, or that of a real flight controller.
    """

    GIVES_RATES: ClassVar[bool] = True

    tilt_gain: NonNegative = 16.0  # [1/s] rate per angle of roll and pitch, less where the inner loop is slow
    yaw_gain: NonNegative = 6.0  # [1/s] rate per angle of yaw, at most a third of the inner loop's gain
    max_correction: Positive = 3.0  # [rad/s] limit of each axis of the correction to the reference's rates
    max_rate: Positive = 34.0  # [rad/s] limit of each axis; gyros measure up to 35, which is 2000°/s

    def init(self, ops: Ops, model: ControllerModel, seen: Seen) -> RatesState:
        """Return the state before the first tick, with the reference's rates and thrust as set-point."""
        outer = init_position_loop(ops, model.gains, seen.body, seen.reference)
        omega = to_body(axes(seen.body.q_world_body), seen.reference.omega)
        demand = thrust_demand(model.airframe.mass_properties, model.environment, seen.reference)
        attitude = attitude_command(ops, outer, demand, seen.reference)
        mass, b3 = model.airframe.mass_properties.mass, axes(seen.body.q_world_body)[2]
        return RatesState(outer, ZERO, RateSetpoint(omega, collective(ops, mass, b3, attitude)))

    def step(
        self, ops: Ops, model: ControllerModel, state: Any, seen: Seen, elapsed: Scalar
    ) -> tuple[Any, RotorWrench]:
        """Return the state, and the wrench that the inner loop is expected to give for its set-point."""
        mass_properties, rotors = model.airframe
        body, reference = seen.body, seen.reference
        body_axes = axes(body.q_world_body)
        outer = step_position_loop(ops, model.gains, state.outer, body, reference, elapsed)
        demand = thrust_demand(mass_properties, model.environment, reference)
        attitude = attitude_command(ops, outer, demand, reference)
        error = attitude_error(ops, body, body_axes, attitude)
        gains = rate_gains(ops, model.airframe)
        lag = 1.0 / rotors.inverse_time_constant[0]
        feedforward = self._feedforward(model, body_axes, reference, lag / elapsed)
        turning = add(feedforward, times(gains.derivative, to_body(body_axes, reference.omega_dot)))
        remaining = subtract(turning, times(gains.integral, state.integral))
        p, q, r = gains.proportional
        lead = remaining[0] / p, remaining[1] / q, remaining[2] / r
        tilt_gain = ops.minimum(self.tilt_gain, _MAX_TILT_RATIO * gains.frequency)
        yaw_gain = ops.minimum(self.yaw_gain, _MAX_YAW_RATIO * gains.proportional[2])
        feedback = times(scale(2.0, error.rotation), (tilt_gain, tilt_gain, yaw_gain))
        reference_rate = to_body(body_axes, reference.omega)
        correction = add(subtract(to_body(body_axes, attitude.omega), reference_rate), feedback)
        correction = clip_components(ops, correction, self.max_correction)
        thrust_fraction = ops.minimum(1.0, norm(ops, attitude.specific_thrust) / _FULL_THRUST)
        correction = scale(thrust_fraction * thrust_fraction, correction)
        omega = add(add(reference_rate, lead), correction)
        thrust = collective(ops, mass_properties.mass, body_axes[2], attitude)
        thrust = thrust + mass_properties.mass * reference.ahead.thrust_change * lag / elapsed
        setpoint = RateSetpoint(clip_components(ops, omega, self.max_rate), thrust)
        rate_error = subtract(setpoint.omega, body.omega_body)
        angular = add(times(gains.proportional, subtract(rate_error, lead)), feedforward)
        load = RotorWrench(thrust, transform(mass_properties.inertia, angular))
        integral = add_scaled(state.integral, elapsed, lead)
        return RatesState(outer, integral, setpoint), load

    def _feedforward(
        self, model: ControllerModel, body_axes: Any, reference: ReferencePoint, steps: Scalar
    ) -> Vector:
        """Return the reference's moment divided by the inertia [rad/s²], `steps` controller steps ahead."""
        properties = model.airframe.mass_properties
        now, change = moment_and_change(properties.inertia, body_axes, reference)
        return transform(properties.inverse_inertia, add_scaled(now, steps, change))
