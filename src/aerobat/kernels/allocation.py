"""Control allocation at every tick: rotor thrusts within limits."""

from __future__ import annotations

from functools import reduce
from typing import NamedTuple

from aerobat.kernels.motors import Rotors, clamp
from aerobat.kernels.ops import Ops, PerRotor, Scalar, clip, magnitude
from aerobat.kernels.rigid_body import RotorWrench

_MIN_FRACTION = 1e-9  # [-] a rotor with a smaller fraction of the collective thrust counts as carrying none


class Mixer(NamedTuple):
    """The least-norm inverse of the allocation: each rotor's thrust per unit of each component of a load."""

    collective: PerRotor
    roll: PerRotor  # [1/m]
    pitch: PerRotor  # [1/m]
    yaw: PerRotor  # [1/m]
    min_collective: Scalar  # [N] collective thrusts that the rotors can hold without any moment
    max_collective: Scalar  # [N]


def mix(mixer: Mixer, load: RotorWrench) -> PerRotor:
    """Return the least-norm rotor thrusts [N] for a load, without limits."""
    mx, my, mz = load.moment_body
    columns = zip(mixer.collective, mixer.roll, mixer.pitch, mixer.yaw, strict=True)
    return tuple(c * load.thrust + a * mx + b * my + d * mz for c, a, b, d in columns)


def within_limits(rotors: Rotors, thrusts: PerRotor) -> Scalar:
    """Return True where thrusts [N] are within all limits."""
    inside: Scalar = True
    for f, low, high, slack in zip(thrusts, rotors.min_thrust, rotors.max_thrust, rotors.slack, strict=True):
        inside = inside & (f >= low - slack) & (f <= high + slack)
    return inside


def desaturate(ops: Ops, rotors: Rotors, mixer: Mixer, load: RotorWrench) -> PerRotor:
    """Return thrusts [N] within limits for a load that exceeds them; yaw is reduced first.

    Then the collective thrust is lowered until roll and pitch fit: a vehicle that cannot tilt is lost, one
    that sinks recovers. The thrust is never raised for them. Roll and pitch are then scaled down to fit, and
    yaw gets the remaining range.
    """
    mx, my, mz = load.moment_body
    tilting = tuple(a * mx + b * my for a, b in zip(mixer.roll, mixer.pitch, strict=True))
    thrust = clip(
        ops, _lowered(ops, rotors, mixer, load.thrust, tilting), mixer.min_collective, mixer.max_collective
    )
    level = tuple(c * thrust for c in mixer.collective)
    tilted = _scaled_to_limits(ops, rotors, level, tilting)
    return clamp(ops, rotors, _scaled_to_limits(ops, rotors, tilted, tuple(d * mz for d in mixer.yaw)))


def _lowered(ops: Ops, rotors: Rotors, mixer: Mixer, thrust: Scalar, tilting: PerRotor) -> Scalar:
    """Return the collective thrust, low enough that tilting exceeds no rotor's upper limit.

    Tilting is first scaled to the part that fits at some collective thrust; lowering the thrust for more is
    useless.
    """
    slopes, ceilings = [], []
    for c, df, high in zip(mixer.collective, tilting, rotors.max_thrust, strict=True):
        carries, fraction = c > _MIN_FRACTION, ops.maximum(c, _MIN_FRACTION)
        slopes.append(ops.select(carries, df / fraction, 0.0))
        ceilings.append(ops.select(carries, high / fraction, mixer.max_collective))
    spread = reduce(ops.maximum, slopes) - reduce(ops.minimum, slopes)
    room = mixer.max_collective - mixer.min_collective
    scaling = room / ops.maximum(ops.maximum(spread, room), _MIN_FRACTION)
    bounds = (ceiling - scaling * slope for ceiling, slope in zip(ceilings, slopes, strict=True))
    return reduce(ops.minimum, bounds, thrust)


def _scaled_to_limits(ops: Ops, rotors: Rotors, base: PerRotor, change: PerRotor) -> PerRotor:
    """Return base + s·change with the largest s in [0, 1] within limits, for a base within them."""
    limits = zip(rotors.min_thrust, rotors.max_thrust, rotors.slack, strict=True)
    fraction: Scalar = 1.0
    for f, df, (low, high, slack) in zip(base, change, limits, strict=True):
        room = ops.maximum(ops.select(df > 0.0, high - f, f - low), 0.0)
        size = magnitude(ops, df)
        fraction = ops.minimum(fraction, ops.select(size > slack, room / ops.maximum(size, slack), 1.0))
    return tuple(f + fraction * df for f, df in zip(base, change, strict=True))
