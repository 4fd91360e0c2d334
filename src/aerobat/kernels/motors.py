"""Rotors that follow clamped commands with a first-order lag, and the body that they move.

Body and rotors are advanced together: apart from each other, RK4 would be of first order.
"""

from __future__ import annotations

from functools import reduce
from operator import add, mul
from typing import NamedTuple

from aerobat.kernels import rigid_body
from aerobat.kernels.ops import Ops, PerRotor, Scalar, clip
from aerobat.kernels.rigid_body import Body, EnvironmentParameters, MassProperties, RotorWrench

LEAST_STEP = 1e-12  # in time constants, of one that divides


class Rotors(NamedTuple):
    """The rotors of one vehicle, one entry a rotor."""

    min_thrust: PerRotor  # [N]
    max_thrust: PerRotor  # [N]
    slack: PerRotor  # [N] by which rounding may push a thrust past a limit
    inverse_time_constant: PerRotor  # [1/s], 1/τ
    allocation: tuple[PerRotor, PerRotor, PerRotor, PerRotor]  # collective, Mx, My, Mz a newton of thrust


def clamp(ops: Ops, rotors: Rotors, thrusts: PerRotor) -> PerRotor:
    """Thrusts [N] held within the limits of each rotor."""
    return tuple(
        clip(ops, f, low, high)
        for f, low, high in zip(thrusts, rotors.min_thrust, rotors.max_thrust, strict=True)
    )


def decay_factors(ops: Ops, rotors: Rotors, dt: Scalar) -> PerRotor:
    """Fraction that is left of each rotor's distance from a held command after `dt` [s], e^(−dt/τ)."""
    return tuple(ops.exp(-dt * rate) for rate in rotors.inverse_time_constant)


def first_order_response(thrusts: PerRotor, commands: PerRotor, decay_factors: PerRotor) -> PerRotor:
    """Thrusts [N] a while later, by f' = (u − f)/τ under held commands u [N].

    The exact solution, stable for any lag, however short.
    """
    return tuple(u + (f - u) * left for f, u, left in zip(thrusts, commands, decay_factors, strict=True))


def collective_thrust(rotors: Rotors, thrusts: PerRotor) -> Scalar:
    """The collective thrust [N] that rotor thrusts [N] make."""
    return _weighted_sum(rotors.allocation[0], thrusts)


def wrench(rotors: Rotors, thrusts: PerRotor) -> RotorWrench:
    """The collective thrust and the moments that rotor thrusts [N] make."""
    collective, mx, my, mz = (_weighted_sum(row, thrusts) for row in rotors.allocation)
    return RotorWrench(collective, (mx, my, mz))


def _weighted_sum(weights: PerRotor, values: PerRotor) -> Scalar:
    return reduce(add, map(mul, weights, values))


class Airframe(NamedTuple):
    """A vehicle as the kernels see it."""

    mass_properties: MassProperties
    rotors: Rotors


class VehicleState(NamedTuple):
    """All that evolves in a flying vehicle."""

    body: Body
    thrusts: PerRotor  # [N]


def advance(
    ops: Ops,
    airframe: Airframe,
    environment: EnvironmentParameters,
    motion: VehicleState,
    commands: PerRotor,
    dt: Scalar,
) -> VehicleState:
    """The motion after `dt` [s] under held rotor commands [N].

    The rotors are solved exactly, so RK4 sees their true load halfway and at the end. At the start it sees
    the load with which Simpson's rule gives the step's impulse exactly. That differs from the true one by
    dt⁴ where rotors lag, so that body and rotors are of order four jointly; without lag it is the command.
    """
    rotors = airframe.rotors
    wanted = clamp(ops, rotors, commands)
    halfway = decay_factors(ops, rotors, 0.5 * dt)
    middle = first_order_response(motion.thrusts, wanted, halfway)
    end = first_order_response(middle, wanted, halfway)
    mean = first_order_response(motion.thrusts, wanted, _mean_factors(ops, rotors, halfway, dt))
    start = tuple(6.0 * m - 4.0 * f - g for m, f, g in zip(mean, middle, end, strict=True))
    loads = wrench(rotors, start), wrench(rotors, middle), wrench(rotors, end)
    body = rigid_body.step(ops, airframe.mass_properties, environment, motion.body, loads, dt)
    return VehicleState(body, end)


def _mean_factors(ops: Ops, rotors: Rotors, halfway: PerRotor, dt: Scalar) -> PerRotor:
    """What is left of each rotor's distance from a held command, the mean over `dt` [s]."""
    return tuple(
        (1.0 - left * left) / ops.maximum(dt * rate, LEAST_STEP)
        for left, rate in zip(halfway, rotors.inverse_time_constant, strict=True)
    )
