"""A battery that rotors discharge by their induced power; its voltage lowers their maximum thrust."""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Scalar, magnitude


class BatteryParameters(NamedTuple):
    """A battery and the discharge by a vehicle's rotors."""

    start: Scalar  # [-] initial charge, as a fraction of a full one
    usage: PerRotor  # [1/(s·N^1.5)] discharge rate per thrust to the power of 1.5 (momentum theory)
    sag: Scalar  # [-] fall of the maximum thrust from full to empty, as a fraction


class BatteryState(NamedTuple):
    """The charge, and the thrust limits at this charge."""

    charge: Scalar  # [-] of a full battery
    ceiling: Scalar  # [-] thrust limits as a fraction of those with a full battery


def init(parameters: BatteryParameters) -> BatteryState:
    """Return the battery before the flight."""
    return _shown(parameters, parameters.start)


def step(
    ops: Ops, parameters: BatteryParameters, state: BatteryState, thrusts: PerRotor, dt: Scalar
) -> BatteryState:
    """Return the battery after `dt` [s] at these rotor thrusts [N]."""
    used = (
        usage * magnitude(ops, f) * ops.sqrt(magnitude(ops, f))
        for usage, f in zip(parameters.usage, thrusts, strict=True)
    )
    return _shown(parameters, ops.maximum(state.charge - dt * reduce(add, used), 0.0))


def _shown(parameters: BatteryParameters, charge: Scalar) -> BatteryState:
    return BatteryState(charge, 1.0 - parameters.sag * (1.0 - charge))
