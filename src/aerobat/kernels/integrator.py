"""Body and rotors advanced together; rotors integrated apart from the body would make RK4 first order."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels import motors, rigid_body
from aerobat.kernels.motors import Rotors
from aerobat.kernels.ops import Ops, PerRotor, Scalar
from aerobat.kernels.rigid_body import Body, Inertial


class Airframe(NamedTuple):
    """A vehicle as the kernels see it."""

    inertial: Inertial
    rotors: Rotors


class Motion(NamedTuple):
    """All that evolves in a flying vehicle."""

    body: Body
    thrusts: PerRotor  # [N]


def advance(ops: Ops, airframe: Airframe, motion: Motion, commands: PerRotor, dt: Scalar) -> Motion:
    """The motion after `dt` [s] under held rotor commands [N].

    The rotors are solved exactly, so RK4 sees their true load at each of its stages: order four jointly.
    """
    wanted = motors.clamp(ops, airframe.rotors, commands)
    halfway = motors.decays(ops, airframe.rotors, 0.5 * dt)
    middle = motors.follow(motion.thrusts, wanted, halfway)
    end = motors.follow(middle, wanted, halfway)
    at_start, at_middle, at_end = (
        motors.load(airframe.rotors, thrusts) for thrusts in (motion.thrusts, middle, end)
    )
    body = rigid_body.step(ops, airframe.inertial, motion.body, (at_start, at_middle, at_end), dt)
    return Motion(body, end)
