"""Rotors that follow clamped commands with a first-order lag, and the body that they move.

Body and rotors are integrated together: integrated separately, the order of RK4 would fall to one.
"""

from __future__ import annotations

from functools import reduce
from operator import add, mul
from typing import NamedTuple

from aerobat.kernels import rigid_body
from aerobat.kernels.ops import Ops, PerRotor, Scalar, clip
from aerobat.kernels.rigid_body import Body, EnvironmentParameters, MassProperties, RotorWrench

MIN_STEP = 1e-12  # smallest step as a divisor, in time constants


class Rotors(NamedTuple):
    """The rotors of one vehicle, one entry a rotor."""

    min_thrust: PerRotor  # [N]
    max_thrust: PerRotor  # [N]
    slack: PerRotor  # [N] tolerance for rounding at the limits
    inverse_time_constant: PerRotor  # [1/s], 1/τ
    allocation: tuple[PerRotor, PerRotor, PerRotor, PerRotor]  # collective, Mx, My, Mz per newton of thrust


def clamp(ops: Ops, rotors: Rotors, thrusts: PerRotor) -> PerRotor:
    """Return thrusts [N] clipped to the limits of each rotor."""
    return tuple(
        clip(ops, f, low, high)
        for f, low, high in zip(thrusts, rotors.min_thrust, rotors.max_thrust, strict=True)
    )


def decay_factors(ops: Ops, rotors: Rotors, dt: Scalar) -> PerRotor:
    """Return the factor e^(−dt/τ) by which each rotor's distance from a held command decays in `dt` [s]."""
    return tuple(ops.exp(-dt * rate) for rate in rotors.inverse_time_constant)


def first_order_response(thrusts: PerRotor, commands: PerRotor, decay_factors: PerRotor) -> PerRotor:
    """Return thrusts [N] after an interval, by f' = (u − f)/τ with held commands u [N].

    This is the exact solution, stable for any lag.
    """
    return tuple(u + (f - u) * decay for f, u, decay in zip(thrusts, commands, decay_factors, strict=True))


def collective_thrust(rotors: Rotors, thrusts: PerRotor) -> Scalar:
    """Return the collective thrust [N] of rotor thrusts [N]."""
    return _weighted_sum(rotors.allocation[0], thrusts)


def wrench(rotors: Rotors, thrusts: PerRotor) -> RotorWrench:
    """Return the collective thrust and the moments of rotor thrusts [N]."""
    collective, mx, my, mz = (_weighted_sum(row, thrusts) for row in rotors.allocation)
    return RotorWrench(collective, (mx, my, mz))


def _weighted_sum(weights: PerRotor, values: PerRotor) -> Scalar:
    return reduce(add, map(mul, weights, values))


class Airframe(NamedTuple):
    """The parameters of a vehicle for the kernels."""

    mass_properties: MassProperties
    rotors: Rotors


class VehicleState(NamedTuple):
    """The complete state of a flying vehicle."""

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
    """Return the motion after `dt` [s] with held rotor commands [N].

    The rotors are solved exactly, so RK4 uses their true load in the middle and at the end. At the start it
    uses the load for which Simpson's rule gives the exact impulse of the step. With lag, this load differs
    from the true one by dt⁴, so body and rotors together are of order four. Without lag, it equals the
    command.
    """
    rotors = airframe.rotors
    clamped = clamp(ops, rotors, commands)
    halfway = decay_factors(ops, rotors, 0.5 * dt)
    middle = first_order_response(motion.thrusts, clamped, halfway)
    end = first_order_response(middle, clamped, halfway)
    mean = first_order_response(motion.thrusts, clamped, _mean_factors(ops, rotors, halfway, dt))
    start = tuple(6.0 * m - 4.0 * f - g for m, f, g in zip(mean, middle, end, strict=True))
    loads = wrench(rotors, start), wrench(rotors, middle), wrench(rotors, end)
    body = rigid_body.step(ops, airframe.mass_properties, environment, motion.body, loads, dt)
    return VehicleState(body, end)


def _mean_factors(ops: Ops, rotors: Rotors, halfway: PerRotor, dt: Scalar) -> PerRotor:
    """Return the mean of each rotor's decay factor over `dt` [s]."""
    return tuple(
        (1.0 - decay * decay) / ops.maximum(dt * rate, MIN_STEP)
        for decay, rate in zip(halfway, rotors.inverse_time_constant, strict=True)
    )
