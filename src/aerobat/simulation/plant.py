"""The vehicle that flies: rigid body and rotors over one control period."""

from __future__ import annotations

import math

from aerobat.kernels.integrator import Airframe, Motion, advance
from aerobat.kernels.ops import Ops, PerRotor, Scalar

LONGEST_STEP = 0.002  # [s] of RK4: enough for 1e-8 m in the fastest flips


def substeps(period: float) -> int:
    """How many steps of RK4 a control period [s] takes."""
    return max(1, math.ceil(period / LONGEST_STEP - 1e-9))


def step(
    ops: Ops, airframe: Airframe, motion: Motion, commands: PerRotor, period: Scalar, steps: int
) -> Motion:
    """The motion after a control period [s] under held rotor commands [N]."""
    for _ in range(steps):
        motion = advance(ops, airframe, motion, commands, period / steps)
    return motion
