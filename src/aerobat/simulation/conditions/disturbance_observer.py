"""The loop's component that tells the controller of forces beyond its model: drag, lost thrust, gusts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from aerobat.kernels import motors, rigid_body
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.ops import Ops, Scalar, Vector
from aerobat.kernels.quaternions import axes, to_world
from aerobat.kernels.vectors import ZERO, add_scaled, subtract
from aerobat.simulation.loop import Signals


class DisturbanceParameters(NamedTuple):
    """A nominal model, and how slowly it is found wrong."""

    model: ControllerModel
    time_constant: Scalar  # [s] of the filter
    delay: Scalar  # [s] from the controller's step to its commands' effect


class Disturbance(NamedTuple):
    """Force over mass [m/s²], world frame, that an accelerometer feels beyond the model's."""

    force: Vector


@dataclass(frozen=True)
class DisturbanceObserver:
    """The low-passed difference between the specific force that is measured and that of the nominal model.

    The model's is that of the rotors as the controller takes them to be, and of drag at the estimated state.
    """

    period: int = 1
    name: str = "disturbance"
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: DisturbanceParameters, inputs: tuple[()], signals: Signals
    ) -> Disturbance:
        """See `Component.init`."""
        return Disturbance(ZERO)

    def step(
        self,
        ops: Ops,
        parameters: DisturbanceParameters,
        state: Disturbance,
        inputs: tuple[()],
        signals: Signals,
    ) -> Disturbance:
        """See `Component.step`."""
        model, elapsed = parameters.model, signals["clock"].elapsed
        observer, controller = signals["observer"], signals["controller"]
        airframe = model.airframe
        left = motors.decay_factors(ops, airframe.rotors, ops.maximum(elapsed - parameters.delay, 0.0))
        now = motors.first_order_response(controller.thrusts, controller.commands.thrusts, left)
        thrust = motors.collective_thrust(airframe.rotors, now)
        expected = rigid_body.specific_force(
            airframe.mass_properties, model.environment, observer.body, thrust
        )
        nominal = observer.filter.nominal
        felt = subtract(signals["imu"].sample.specific_force, nominal.accelerometer_bias)
        beyond = to_world(axes(nominal.q_world_body), subtract(felt, expected))
        fraction = elapsed / (parameters.time_constant + elapsed)
        return Disturbance(add_scaled(state.force, fraction, subtract(beyond, state.force)))
