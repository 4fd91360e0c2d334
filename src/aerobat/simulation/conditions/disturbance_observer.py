"""The loop's component that tells the controller of what its model lacks: drag, gusts, rotors' mismatch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import motors, rigid_body
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.imu import ImuState
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.vectors import ZERO, add_scaled, scale, subtract
from aerobat.simulation.components import Disturbance
from aerobat.simulation.loop import Signals


class DisturbanceParameters(NamedTuple):
    """A nominal model, and how slowly it is found wrong."""

    model: ControllerModel
    time_constant: Scalar  # [s] of the filter
    delay: Scalar  # [s] from the controller's step to its commands' effect


@dataclass(frozen=True)
class DisturbanceObserver:
    """The low-passed difference between what is measured and the nominal model, of force and of moment.

    The model's is that of the rotors as the controller takes them to be, of drag at the estimated state, and
    of the gyroscopic moment; the angular acceleration that is measured is the change of the gyro's rates.
    """

    period: int = 1
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: DisturbanceParameters, inputs: tuple[()], signals: Signals
    ) -> Disturbance:
        """See `Component.init`."""
        return Disturbance(ZERO, ZERO, ZERO, 0.0)

    def step(
        self,
        ops: Ops,
        parameters: DisturbanceParameters,
        state: Disturbance,
        inputs: tuple[()],
        signals: Signals,
    ) -> Disturbance:
        """See `Component.step`."""
        model, elapsed = parameters.model, signals.clock.elapsed
        mass_properties, rotors = model.airframe
        observer, controller = signals.observer, signals.controller
        left = motors.decay_factors(ops, rotors, ops.maximum(elapsed - parameters.delay, 0.0))
        thrusts = motors.first_order_response(controller.thrusts, controller.commands.thrusts, left)
        load = motors.wrench(rotors, thrusts)
        nominal = rigid_body.derivative(mass_properties, model.environment, observer.body, load)
        specific_force = rigid_body.specific_force(
            mass_properties, model.environment, observer.body, load.thrust
        )
        bias = observer.own.filter.nominal.accelerometer_bias
        felt = subtract(signals.of(ImuState).sample.specific_force, bias)
        omega = observer.body.omega_body
        turned = scale(1.0 / elapsed, subtract(omega, state.omega_body))
        fraction = elapsed / (parameters.time_constant + elapsed)
        force = subtract(subtract(felt, specific_force), state.force)
        angular = subtract(subtract(turned, nominal.omega_body), state.angular_acceleration)
        return Disturbance(
            add_scaled(state.force, fraction, force),
            add_scaled(state.angular_acceleration, state.has_omega * fraction, angular),
            omega,
            1.0,
        )
