"""The geometric controller on SE(3): Lee, Leok and McClamroch, IEEE CDC 2010, arXiv:1003.2005."""

from __future__ import annotations

from typing import Any

from aerobat.control.law import ControlLaw, Seen, controller
from aerobat.control.laws.attitude import attitude_feedback, axes_along, collective, moment_for
from aerobat.declaration import NonNegative
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import thrust_demand
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.quaternions import axes
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import add, add_scaled, clamp_norm, scale, subtract


@controller("lee")
class Lee(ControlLaw):
    """Force along the body's thrust axis, and moment from the attitude error on SO(3) (Lee et al., 2010).

    The force over the mass is f = (−k_x e_x − k_v e_v + g e₃ + a_d) · R e₃. Divided by the inertia, the
    moment is M = −k_R e_R − k_Ω e_Ω + the reference's own moment. The attitude gains are limited to those
    that the vehicle's rotors allow.
    """

    position_gain: NonNegative = 20.0  # [1/s²] k_x divided by the mass
    velocity_gain: NonNegative = 8.0  # [1/s] k_v divided by the mass
    attitude_gain: NonNegative = 625.0  # [1/s²] k_R divided by the inertia
    rate_gain: NonNegative = 42.5  # [1/s] k_Ω divided by the inertia
    max_feedback: NonNegative = 15.0  # [m/s²]

    def step(
        self, ops: Ops, model: ControllerModel, state: Any, seen: Seen, elapsed: Scalar
    ) -> tuple[Any, RotorWrench]:
        """Return the force and the moment."""
        body, reference = seen.body, seen.reference
        body_axes = axes(body.q_world_body)
        e_x = subtract(body.position, reference.position)
        e_v = subtract(body.velocity, reference.velocity)
        feedback = scale(-1.0, add_scaled(scale(self.position_gain, e_x), self.velocity_gain, e_v))
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
        thrust = add(demand.value, clamp_norm(ops, feedback, self.max_feedback))
        desired = axes_along(ops, thrust, reference)
        acceleration = attitude_feedback(ops, model, seen, desired, self.attitude_gain, self.rate_gain)
        moment = moment_for(model, body_axes, reference, acceleration)
        return state, RotorWrench(collective(model, body_axes, thrust), moment)
