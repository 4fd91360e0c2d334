"""Rotor thrusts that fit within limits, at every tick."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

from aerobat.kernels.motors import Rotors, clamp
from aerobat.kernels.ops import Ops, PerRotor, Scalar, clip, magnitude
from aerobat.kernels.rigid_body import RotorWrench

_BEARING = 1e-9  # [-] a rotor with a smaller fraction of the collective thrust bears nothing


class Mixer(NamedTuple):
    """The least-norm inverse of the allocation: what each rotor adds for a unit of each part of a load."""

    collective: PerRotor
    roll: PerRotor  # [1/m]
    pitch: PerRotor  # [1/m]
    yaw: PerRotor  # [1/m]
    min_collective: Scalar  # [N] of collective thrust that the rotors can hold without any moment
    max_collective: Scalar  # [N]


def mix(mixer: Mixer, load: RotorWrench) -> PerRotor:
    """The least-norm rotor thrusts [N] that make a load, limits ignored."""
    mx, my, mz = load.moment_body
    columns = zip(mixer.collective, mixer.roll, mixer.pitch, mixer.yaw, strict=True)
    return tuple(c * load.thrust + a * mx + b * my + d * mz for c, a, b, d in columns)


def within_limits(rotors: Rotors, thrusts: PerRotor) -> Scalar:
    """True where thrusts [N] are within all limits."""
    inside: Scalar = True
    for f, low, high, slack in zip(thrusts, rotors.min_thrust, rotors.max_thrust, rotors.slack, strict=True):
        inside = inside & (f >= low - slack) & (f <= high + slack)
    return inside


def desaturate(ops: Ops, rotors: Rotors, mixer: Mixer, load: RotorWrench) -> PerRotor:
    """Thrusts within limits [N] that make, of a load that does not fit, what can be had; yaw is shed first.

    Next, collective thrust is lowered until roll and pitch fit: a vehicle that cannot tilt is lost, one that
    sinks recovers. It is never raised for them. What of roll and pitch still does not fit is scaled down,
    and of yaw what then fits is given.
    """
    mx, my, mz = load.moment_body
    tilting = tuple(a * mx + b * my for a, b in zip(mixer.roll, mixer.pitch, strict=True))
    thrust = clip(
        ops, _lowered(ops, rotors, mixer, load.thrust, tilting), mixer.min_collective, mixer.max_collective
    )
    level = tuple(c * thrust for c in mixer.collective)
    tilted = _as_far_as_fits(ops, rotors, level, tilting)
    return clamp(ops, rotors, _as_far_as_fits(ops, rotors, tilted, tuple(d * mz for d in mixer.yaw)))


def _lowered(ops: Ops, rotors: Rotors, mixer: Mixer, thrust: Scalar, tilting: PerRotor) -> Scalar:
    """The collective thrust, low enough for no rotor to exceed its upper limit while tilting.

    Tilting counts as far as it fits about some collective thrust; for more it would be lowered in vain.
    """
    slopes, ceilings = [], []
    for c, df, high in zip(mixer.collective, tilting, rotors.max_thrust, strict=True):
        bears, fraction = c > _BEARING, ops.maximum(c, _BEARING)
        slopes.append(ops.select(bears, df / fraction, 0.0))
        ceilings.append(ops.select(bears, high / fraction, mixer.max_collective))
    spread = reduce(ops.maximum, slopes) - reduce(ops.minimum, slopes)
    room = mixer.max_collective - mixer.min_collective
    part = room / ops.maximum(ops.maximum(spread, room), _BEARING)
    bounds = (ceiling - part * slope for ceiling, slope in zip(ceilings, slopes, strict=True))
    return reduce(ops.minimum, bounds, thrust)


def _as_far_as_fits(ops: Ops, rotors: Rotors, base: PerRotor, change: PerRotor) -> PerRotor:
    """base + s·change with the largest s in [0, 1] within limits, for a base within them."""
    limits = zip(rotors.min_thrust, rotors.max_thrust, rotors.slack, strict=True)
    fraction: Scalar = 1.0
    for f, df, (low, high, slack) in zip(base, change, limits, strict=True):
        room = ops.maximum(ops.select(df > 0.0, high - f, f - low), 0.0)
        size = magnitude(ops, df)
        fraction = ops.minimum(fraction, ops.select(size > slack, room / ops.maximum(size, slack), 1.0))
    return tuple(f + fraction * df for f, df in zip(base, change, strict=True))
