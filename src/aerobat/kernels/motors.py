"""Rotors: thrusts that follow clamped commands with a first-order lag, and the load they make together."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Ops, PerRotor, Scalar, clip
from aerobat.kernels.rigid_body import Load


class Rotors(NamedTuple):
    """What the rotors of one vehicle are, one entry a rotor."""

    min_thrust: PerRotor  # [N]
    max_thrust: PerRotor  # [N]
    slack: PerRotor  # [N] by which rounding may push a thrust past a limit
    lag_rate: PerRotor  # [1/s], 1/τ
    allocation: tuple[PerRotor, PerRotor, PerRotor, PerRotor]  # collective, Mx, My, Mz a newton of thrust


def clamp(ops: Ops, rotors: Rotors, thrusts: PerRotor) -> PerRotor:
    """Thrusts [N] held within the limits of each rotor."""
    return tuple(
        clip(ops, f, low, high)
        for f, low, high in zip(thrusts, rotors.min_thrust, rotors.max_thrust, strict=True)
    )


def decays(ops: Ops, rotors: Rotors, dt: Scalar) -> PerRotor:
    """What is left of each rotor's distance from a held command after `dt` [s], e^(−dt/τ)."""
    return tuple(ops.exp(-dt * rate) for rate in rotors.lag_rate)


def follow(thrusts: PerRotor, commands: PerRotor, decays: PerRotor) -> PerRotor:
    """Thrusts [N] a while later, by f' = (u − f)/τ under held commands u [N].

    The exact solution, stable for any lag, however short.
    """
    return tuple(u + (f - u) * left for f, u, left in zip(thrusts, commands, decays, strict=True))


def load(rotors: Rotors, thrusts: PerRotor) -> Load:
    """The collective thrust and the moments that rotor thrusts [N] make."""
    collective, mx, my, mz = (weigh(row, thrusts) for row in rotors.allocation)
    return Load(collective, (mx, my, mz))


def weigh(weights: PerRotor, values: PerRotor) -> Scalar:
    """Σ weights·values."""
    total = weights[0] * values[0]
    for weight, value in zip(weights[1:], values[1:], strict=True):
        total = total + weight * value
    return total
