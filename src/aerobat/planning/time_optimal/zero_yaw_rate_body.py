"""The rigid body that never spins about its thrust axis, in CasADi's symbols.

Its state is x = (p, v, q, ω_x, ω_y), its input u = (T, ω'_x, ω'_y): collective thrust [N] and angular
accelerations about the body's x and y [rad/s²]. The moments are those that these and ω_z = 0 need,
M = J ω' + ω × J ω. Flatness and the controller carry the attitude in the same way, without spin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from aerobat.control import Controller
from aerobat.control.parameters import controller_parameters
from aerobat.engines.pytree import tree_map
from aerobat.environment import Environment
from aerobat.flatness import lateral_drag
from aerobat.kernels import rigid_body
from aerobat.kernels.allocation import mix
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.quaternions import axes
from aerobat.kernels.rigid_body import Body, Wrench
from aerobat.kernels.vectors import add, cross, transform
from aerobat.optimization.nonlinear import import_casadi
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

STATES = 12
INPUTS = 3
POSITION, VELOCITY, ATTITUDE, RATES = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 12)


@dataclass(frozen=True, eq=False)
class ZeroYawRateBody:
    """A vehicle's equations of motion with ω_z = 0, as CasADi functions of x, u and the input's slope u'.

    Drag across the thrust axis is the same in all directions, as flatness has it.
    """

    vehicle: Vehicle
    environment: Environment

    @cached_property
    def derivatives(self) -> Any:
        """(x, u, u') -> x', x'', x''' for a steady u'; rows 3 to 5 are acceleration, jerk and snap."""
        first = self._rate()
        second = self._along(first)
        return self._function("derivatives", [first, second, self._along(second)])

    @cached_property
    def rotors(self) -> Any:
        """(x, u, u') -> the rotors' least-norm thrusts [N], and their commands f + τ f' [N], each (n,)."""
        ca = import_casadi()
        thrusts = ca.vertcat(*mix(self._model.mixer, self._load()))
        commands = thrusts + ca.DM(self.vehicle.lags) * self._along(thrusts)
        return self._function("rotors", [thrusts, commands])

    @cached_property
    def thrust_axes(self) -> Any:
        """x -> the body axes in the world as columns, (3, 3)."""
        ca = import_casadi()
        columns = [ca.vertcat(*axis) for axis in axes(_scalars(self._x[ATTITUDE]))]
        return ca.Function("thrust_axes", [self._x], [ca.horzcat(*columns)])

    @cached_property
    def _symbols(self) -> tuple[Any, Any, Any]:
        sx = import_casadi().SX
        return sx.sym("x", STATES), sx.sym("u", INPUTS), sx.sym("slope", INPUTS)

    @property
    def _x(self) -> Any:
        return self._symbols[0]

    @cached_property
    def _model(self) -> ControllerModel:
        """The kernels' view of the vehicle, in plain floats."""
        drag = lateral_drag(self.vehicle) * self.vehicle.mass
        flat = replace(self.vehicle, drag_body=np.array([drag, drag, self.vehicle.drag_body[2]]))
        parameters = controller_parameters(Controller(), Fleet.of([flat]), self.environment)
        model: ControllerModel = tree_map(lambda leaf: leaf[0].item(), parameters)
        return model

    def _body(self) -> Body:
        p, v, q, (wx, wy) = (_scalars(self._x[part]) for part in (POSITION, VELOCITY, ATTITUDE, RATES))
        return Body(p, v, q, (wx, wy, 0.0))

    def _load(self) -> Wrench:
        inertia, omega = self._model.airframe.mass_properties.inertia, self._body().omega_body
        thrust, ax, ay = _scalars(self._symbols[1])
        return Wrench(thrust, add(transform(inertia, (ax, ay, 0.0)), cross(omega, transform(inertia, omega))))

    def _rate(self) -> Any:
        """x' by the kernel that the simulation runs (paper, eqs. (3) and (4))."""
        rate = rigid_body.derivative(
            self._model.airframe.mass_properties, self._model.environment, self._body(), self._load()
        )
        wx, wy, _ = rate.omega_body
        return import_casadi().vertcat(*rate.position, *rate.velocity, *rate.q_world_body, wx, wy)

    def _along(self, expression: Any) -> Any:
        """The time derivative of an expression in x and u."""
        x, u, slope = self._symbols
        jtimes = import_casadi().jtimes
        return jtimes(expression, x, self._rate()) + jtimes(expression, u, slope)

    def _function(self, name: str, outputs: list[Any]) -> Any:
        return import_casadi().Function(name, list(self._symbols), outputs)


def _scalars(column: Any) -> tuple[Any, ...]:
    return tuple(column[i] for i in range(column.numel()))
