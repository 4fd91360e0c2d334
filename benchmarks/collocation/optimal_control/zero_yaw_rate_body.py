"""The rigid body that never spins about its thrust axis, in CasADi's symbols.

The state is x = (p, v, q, ω_x, ω_y), the input u = (n, ω'_x, ω'_y): the norm of the specific thrust f [m/s²]
and angular accelerations about the body's x and y [rad/s²]. The velocity relative to the air is w, and the
drag is d + δ along b1, d − δ along b2 and d_z along b3. The equations of motion are

    p' = v    v' = n b3 − g e3 − (d w + δ (b1·w b1 − b2·w b2))/m    q' = ½ q ⊗ (0, ω).

The rotors bear T = m n + (d_z − d) b3·w and the moments that ω_z = 0 needs, M = J ω' + ω × J ω. Flatness and
the controller carry the attitude in the same way, without spin, and count drag in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, has_unequal_drag, lateral_drag
from aerobat.kernels.flatness import collective, moment
from aerobat.kernels.quaternions import axes, quaternion_rate
from aerobat.kernels.vectors import dot
from aerobat.vehicle import Vehicle
from collocation.nonlinear import components, import_casadi

STATES = 12
INPUTS = 3
POSITION, VELOCITY, ATTITUDE, RATES = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 12)


@dataclass(frozen=True, eq=False)
class ZeroYawRateBody:
    """A vehicle's equations of motion with ω_z = 0, as CasADi functions of x, u and the input's slope u'."""

    vehicle: Vehicle
    environment: Environment

    @cached_property
    def derivatives(self) -> Any:
        """(x, u, u') -> x', x'', x''' for a steady u'; rows 3 to 5 are acceleration, jerk and snap."""
        first = self._rate()
        second = self._along(first)
        return self._function("derivatives", [first, second, self._along(second)])

    def driven(self, weights: Array) -> Any:
        """(x, u, u') -> weights (D, 11) times the measures that limits are linear in, (D,)."""
        ca = import_casadi()
        wrench, (*_, b3) = self._wrench(), axes(components(self._x[ATTITUDE]))
        speed = ca.norm_2(ca.vertcat(*self._omega))
        measures = ca.vertcat(wrench, self._along(wrench), self._symbols[1][0], speed, b3[2])
        return self._function("driven", [ca.sparsify(ca.DM(weights)) @ measures])

    @cached_property
    def axes(self) -> Any:
        """x -> the body axes in the world as columns, (3, 3)."""
        ca = import_casadi()
        columns = [ca.vertcat(*axis) for axis in axes(components(self._x[ATTITUDE]))]
        return ca.Function("axes", [self._x], [ca.horzcat(*columns)])

    @cached_property
    def _symbols(self) -> tuple[Any, Any, Any]:
        sx = import_casadi().SX
        return sx.sym("x", STATES), sx.sym("u", INPUTS), sx.sym("slope", INPUTS)

    @property
    def _x(self) -> Any:
        return self._symbols[0]

    @cached_property
    def _omega(self) -> tuple[Any, Any, float]:
        wx, wy = components(self._x[RATES])
        return wx, wy, 0.0

    @cached_property
    def _airspeed(self) -> Any:
        return self._x[VELOCITY] - import_casadi().DM(self.environment.wind)

    def _rate(self) -> Any:
        """x'."""
        ca, u = import_casadi(), self._symbols[1]
        b1, b2, b3 = axes(components(self._x[ATTITUDE]))
        drag = lateral_drag(self.vehicle) * self._airspeed
        if has_unequal_drag(self.vehicle):
            more = float(self.vehicle.drag_body[0]) / self.vehicle.mass - lateral_drag(self.vehicle)
            along = (ca.vertcat(*axis) * dot(axis, components(self._airspeed)) for axis in (b1, b2))
            drag += more * (next(along) - next(along))
        acceleration = u[0] * ca.vertcat(*b3) - ca.DM(self.environment.weight) - drag
        turning = quaternion_rate(components(self._x[ATTITUDE]), self._omega)
        return ca.vertcat(self._x[VELOCITY], acceleration, *turning, u[1:])

    def _wrench(self) -> Any:
        """Collective thrust [N] and moments [N·m], (4,)."""
        n, *turning = components(self._symbols[1])
        *_, b3 = axes(components(self._x[ATTITUDE]))
        airspeed = components(self._airspeed)
        thrust = collective(self.vehicle.mass, axial_drag(self.vehicle), n, b3, airspeed)
        moments = moment(self.vehicle.inertia.tolist(), self._omega, (*turning, 0.0))
        return import_casadi().vertcat(thrust, *moments)

    def _along(self, expression: Any) -> Any:
        """The time derivative of an expression in x and u."""
        x, u, slope = self._symbols
        jtimes = import_casadi().jtimes
        return jtimes(expression, x, self._rate()) + jtimes(expression, u, slope)

    def _function(self, name: str, outputs: list[Any]) -> Any:
        return import_casadi().Function(name, list(self._symbols), outputs)
