"""The controller component for control laws: the law's inputs and the rotor commands from its output."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from inspect import getfile
from math import pi
from traceback import extract_tb
from typing import Any, NamedTuple

from aerobat.control import ControlLaw, Controller, Seen
from aerobat.declaration import shown
from aerobat.engines.floats import FloatOps
from aerobat.engines.pytree import tree_leaves
from aerobat.errors import SpecError
from aerobat.kernels import control, motors
from aerobat.kernels.control import Commands, ControllerModel
from aerobat.kernels.control_loops import FeatureFlags, moment_and_change
from aerobat.kernels.ops import Ops, PerRotor
from aerobat.kernels.quaternions import axes
from aerobat.kernels.rate_loop import RateLoopModel
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.registry import placed
from aerobat.simulation.components import (
    ControllerParameters,
    RateLoop,
    TrackingController,
    controller_inputs,
)
from aerobat.simulation.loop import Component, LoopPart, Signals

GYRO, DERIVATIVE = 0.5 / (pi * 250.0), 0.5 / (pi * 150.0)  # [s] of an inner loop's filters: 250 Hz, 150 Hz
# rate commands already lead the rotors' lag, so the inner loop's output is not lag-compensated again
_RATE_LAW_FLAGS = FeatureFlags(moment_feedforward=True, motor_lag_compensation=False, prioritize_tilt=True)


class LawState(NamedTuple):
    """State of a law from tick to tick, with its commands."""

    own: Any
    thrusts: PerRotor  # [N] rotor thrusts by the nominal model
    commands: Commands  # the last ones


@dataclass(frozen=True)
class LawController(Component):
    """A control law on the observer's state; its inputs are those of the tracking controller."""

    law: ControlLaw
    flags: FeatureFlags  # for the control allocation, from the law's force and moment to rotor commands

    def init(self, parameters: ControllerParameters, signals: Signals) -> LawState:
        """See `Component.init`."""
        reference = signals.inputs or signals.reference
        ops, body = signals.ops, signals.observer.body
        first = control.init(ops, parameters.model, body, reference)
        with _compiled(ops, self.law.init):
            own = self.law.init(ops, parameters.model, Seen(body, first.thrusts, reference))
        if any(isinstance(leaf, str) for leaf in tree_leaves(own)):
            raise _law_error(self.law.init, f"returned {shown(own)}, not a tree of tuples of numbers")
        return LawState(own, first.thrusts, first.commands)

    def step(self, parameters: ControllerParameters, state: LawState, signals: Signals) -> LawState:
        """See `Component.step`."""
        ops, model, elapsed = signals.ops, parameters.model, signals.clock.elapsed
        takes = self.law.TAKES_DISTURBANCES, not self.law.GIVES_RATES
        body, reference = controller_inputs(parameters, state, signals, *takes)
        rotors = model.airframe.rotors
        decay_factors = motors.decay_factors(ops, rotors, elapsed)
        thrusts = motors.first_order_response(state.thrusts, state.commands.thrusts, decay_factors)
        with _compiled(ops, self.law.step):
            answer: Any = self.law.step(ops, model, state.own, Seen(body, thrusts, reference), elapsed)
        own, load = self._checked(answer)
        if len(tree_leaves(own)) != len(tree_leaves(state.own)):
            raise _law_error(self.law.step, f"returned the state {shown(own)}, of another shape than before")
        mass_properties = model.airframe.mass_properties
        _, change = moment_and_change(mass_properties.inertia, axes(body.q_world_body), reference)
        loads = load, RotorWrench(mass_properties.mass * reference.ahead.thrust_change, change)
        commands = control.rotor_commands(ops, self.flags, model, loads, thrusts, decay_factors, elapsed)
        return LawState(own, thrusts, commands)

    def _checked(self, answer: Any) -> tuple[Any, RotorWrench]:
        """Return the state and the wrench from a law's answer. Raises SpecError for any other answer."""
        match answer:
            case (own, (thrust, (x, y, z))) if all(
                hasattr(each, "__truediv__") for each in (thrust, x, y, z)
            ):
                return own, RotorWrench(thrust, (x, y, z))
        raise _law_error(
            self.law.step, f"returned {shown(answer)}, not the state and a RotorWrench of four numbers"
        )


@contextmanager
def _compiled(ops: Ops, method: Any) -> Iterator[None]:
    """Raise SpecError for a line of a law's method that compiles in no engine but floats."""
    try:
        yield
    except TypeError as error:
        lines = [frame for frame in extract_tb(error.__traceback__) if frame.filename == getfile(method)]
        if ops is FloatOps or not lines:
            raise
        complaint = _law_message(
            method,
            f"cannot be compiled for `{lines[-1].line}`; write this line in + - * /, comparisons and ops "
            "(ops.select for if, ops.maximum(x, -x) for abs), or fly the law by the engine floats "
            '(engine="floats")',
        )
        raise SpecError(f"{lines[-1].filename}:{lines[-1].lineno}: {complaint}") from error


def _law_error(method: Any, complaint: str) -> SpecError:
    """Return the error of a law's method, with its file and line."""
    return placed(SpecError(_law_message(method, complaint)), method)


def _law_message(method: Any, complaint: str) -> str:
    return f"controller '{method.__self__.kind}': {method.__name__}() {complaint}"


def controller_component(law: ControlLaw | None, settings: Controller) -> Component:
    """Return the controller's component: of a control law, or else the tracking controller."""
    if law is None:
        return TrackingController(settings.feature_flags)
    return LawController(law, _RATE_LAW_FLAGS if law.GIVES_RATES else settings.feature_flags)


def inner_loop(law: ControlLaw | None, model: ControllerModel) -> tuple[LoopPart, ...]:
    """Return the inner loop behind a law that gives body rates, one part; nothing for other controllers."""
    if law is None or not law.GIVES_RATES:
        return ()
    return (LoopPart(RateLoop(), RateLoopModel(model.airframe, model.mixer, GYRO, DERIVATIVE)),)
