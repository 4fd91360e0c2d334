"""The tracking controller (paper, Section III and Fig. 4): outer loop, inner loop, rotor commands."""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels import attitude_loop, motors, position_loop
from aerobat.kernels.allocation import Mixer, demand, fits, nearest
from aerobat.kernels.attitude_loop import Attitude, reference_moment
from aerobat.kernels.controller import Controller, Gains
from aerobat.kernels.integrator import Airframe
from aerobat.kernels.ops import Ops, PerRotor, Scalar, Vector
from aerobat.kernels.position_loop import Outer, Target
from aerobat.kernels.rigid_body import Body, Load
from aerobat.kernels.vectors import ZERO, add, axes, dot, length

_LEAST_PART = 0.3  # [-] of the commanded specific thrust, kept where the vehicle points away from it


class Model(NamedTuple):
    """The vehicle as the controller believes it to be."""

    airframe: Airframe
    mixer: Mixer
    gains: Gains


class Commands(NamedTuple):
    """The answer of one tick."""

    thrusts: PerRotor  # [N] within limits
    saturated: Scalar  # whether the limits changed them


class Memory(NamedTuple):
    """What the controller remembers from tick to tick."""

    outer: Outer
    attitude_integral: Vector  # [rad·s]
    thrusts: PerRotor  # [N] where the rotors are believed to be
    commands: Commands  # the last ones


def init(ops: Ops, model: Model, body: Body, target: Target) -> Memory:
    """The memory before the first tick, with the rotors at what the trajectory asks there."""
    inertial, rotors = model.airframe
    moment = reference_moment(inertial.inertia, axes(body.q_world_body), target.ahead)
    asked = Load(inertial.mass * length(ops, target.specific_thrust), moment)
    thrusts = motors.clamp(ops, rotors, demand(model.mixer, asked))
    outer = position_loop.init(ops, model.gains, inertial, body, target)
    return Memory(outer, ZERO, thrusts, Commands(thrusts, False))


def step(
    ops: Ops,
    controller: Controller,
    model: Model,
    memory: Memory,
    body: Body,
    target: Target,
    elapsed: Scalar,
) -> Memory:
    """The memory, new commands included, `elapsed` [s] after the last tick.

    Of `controller` only the switches count; the gains are the model's.
    """
    inertial, rotors = model.airframe
    outer = position_loop.step(ops, model.gains, inertial, memory.outer, body, target, elapsed)
    attitude = attitude_loop.desired(ops, outer, target)
    body_axes = axes(body.q_world_body)
    error = attitude_loop.error(ops, body, body_axes, attitude)
    # while rotors saturate, the attitude error says nothing about a lasting moment
    counted = ops.select(memory.commands.saturated, 0.0, elapsed)
    integral = attitude_loop.accumulate(ops, model.gains, memory.attitude_integral, error, counted)
    moment = attitude_loop.moment(model.gains, inertial.inertia, error, integral)
    if controller.moment_feedforward:
        moment = add(moment, reference_moment(inertial.inertia, body_axes, target.ahead))
    load = Load(_collective(ops, inertial.mass, body_axes[2], attitude, target), moment)
    decays = motors.decays(ops, rotors, elapsed)
    thrusts = motors.follow(memory.thrusts, memory.commands.thrusts, decays)
    commands = _commands(ops, controller, model, load, thrusts, decays, elapsed)
    return Memory(outer, integral, thrusts, commands)


def _collective(ops: Ops, mass: Scalar, b3: Vector, attitude: Attitude, target: Target) -> Scalar:
    """The collective thrust [N]: the commanded specific thrust along b3, whichever way the vehicle points.

    Pointing away it would vanish, and with it the means to turn back: a part of |f| is kept.
    """
    f = attitude.specific_thrust
    along = ops.maximum(dot(f, b3), _LEAST_PART * length(ops, f))
    return mass * (along + target.ahead.thrust_change)


def _commands(
    ops: Ops,
    controller: Controller,
    model: Model,
    load: Load,
    thrusts: PerRotor,
    decays: PerRotor,
    period: Scalar,
) -> Commands:
    """Commands for a load, with the rotors now at `thrusts` [N].

    The load is brought within limits first, and the lead then clipped rotor by rotor: it exceeds them for
    moments only, in which each rotor does best to hurry.
    """
    rotors = model.airframe.rotors
    wished = demand(model.mixer, load)
    whole = fits(rotors, wished)
    if controller.yaw_shed_first:
        shed = nearest(ops, rotors, model.mixer, load)
        wished = tuple(ops.select(whole, f, g) for f, g in zip(wished, shed, strict=True))
    if controller.motor_lag_lead:
        share = 1.0 - ops.exp(-period / model.gains.lead_filter)
        wished = _leading(thrusts, wished, decays, share)
    changed = ops.select(whole & fits(rotors, wished), False, True)
    return Commands(motors.clamp(ops, rotors, wished), changed)


def _leading(thrusts: PerRotor, wished: PerRotor, decays: PerRotor, share: Scalar) -> PerRotor:
    """Commands [N] that bring the rotors, in one period, by `share` of the way from `thrusts` to `wished`.

    With share = 1 − e^(−period/T) it is u = f + τ f' behind a low-pass of time constant T. Written about
    where the rotors are believed to be, it goes on pushing after a saturation until they have got there.
    """
    return tuple(
        f + (w - f) * share / (1.0 - left) for f, w, left in zip(thrusts, wished, decays, strict=True)
    )
