"""A battery that rotors empty by their induced power, and thrust ceilings that fall with its voltage."""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Scalar, magnitude


class BatteryParameters(NamedTuple):
    """A battery, by what a vehicle's rotors take from it."""

    start: Scalar  # [-] charge, of a full one
    usage: PerRotor  # [1/(s·N^1.5)] charge used a second, a thrust to the power of 1.5 (momentum theory)
    sag: Scalar  # [-] by which the ceiling falls from full to empty


class BatteryState(NamedTuple):
    """Charge, and what it means."""

    charge: Scalar  # [-] of a full battery
    ceiling: Scalar  # [-] thrust limits, over those with a full battery


def init(parameters: BatteryParameters) -> BatteryState:
    """The battery before the flight."""
    return _shown(parameters, parameters.start)


def step(
    ops: Ops, parameters: BatteryParameters, state: BatteryState, thrusts: PerRotor, dt: Scalar
) -> BatteryState:
    """The battery after `dt` [s] at these rotor thrusts [N]."""
    used = (
        usage * magnitude(ops, f) * ops.sqrt(magnitude(ops, f))
        for usage, f in zip(parameters.usage, thrusts, strict=True)
    )
    return _shown(parameters, ops.maximum(state.charge - dt * reduce(add, used), 0.0))


def _shown(parameters: BatteryParameters, charge: Scalar) -> BatteryState:
    return BatteryState(charge, 1.0 - parameters.sag * (1.0 - charge))
