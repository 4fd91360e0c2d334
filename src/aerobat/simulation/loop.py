"""The loop over time, a tuple of components, each with its own period: sensors, controller, plant, monitors.

At each tick the components step in order. One with direct feedthrough (a sensor, a controller) is seen in its
new state by those after it and by the log; one without (the plant) leads to the next tick, and is seen as it
is at this one. A component of period k steps at the first tick and at every k-th after it, and holds its
state between.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, NamedTuple, Protocol, TypeAlias

from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree, tree_leaves, tree_unflatten
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.rigid_body import Body

Signals: TypeAlias = Mapping[str, Any]  # "clock", "reference", "start", and by name the components' states
Log: TypeAlias = Callable[[Signals], Tree]


class Clock(NamedTuple):
    """Time about a tick, which at few ticks differs from the tick before."""

    elapsed: Scalar  # [s] since the component stepped last
    period: Scalar  # [s] until the next tick

    @property
    def piecewise_constant(self) -> bool:
        """True: see `engines.engine.Compile`."""
        return True


class LoopParameters(NamedTuple):
    """Parameters that do not change along a flight."""

    start: Body  # the true state at first
    own: tuple[Tree, ...]  # of each component


class LoopInput(NamedTuple):
    """Inputs from outside at a tick."""

    clock: Clock
    reference: ReferencePoint
    own: tuple[Tree, ...]  # of each component


class Component(Protocol):
    """One part of the loop: a frozen, hashable value that holds no numbers of a flight."""

    @property
    def name(self) -> str:
        """Its key among the signals."""

    @property
    def period(self) -> int:
        """The ticks from one step to the next."""

    @property
    def feedthrough(self) -> bool:
        """True if its new state is seen at the tick of its step, false if at the next."""

    def init(self, ops: Ops, parameters: Tree, inputs: Tree, signals: Signals) -> Tree:
        """The state before the first tick; of the components, signals hold those before it in order."""

    def step(self, ops: Ops, parameters: Tree, state: Tree, inputs: Tree, signals: Signals) -> Tree:
        """The next state, from its own parameters and inputs and what others show."""


class _Scheduled(NamedTuple):
    """A component that does not step at every tick."""

    state: Tree
    countdown: Scalar  # ticks until its next step
    waited: Scalar  # [s] since its last one


@lru_cache(maxsize=64)
def compose(components: tuple[Component, ...], log: Log) -> tuple[Init, Step]:
    """The loop of some components as two functions for an engine, the same for the same arguments.

    Their carry is a tuple with the state of each; a row is what `log` takes of the signals.
    """

    def init(ops: Ops, parameters: LoopParameters, inputs: LoopInput) -> tuple[Tree, ...]:
        signals = {"start": parameters.start, "clock": inputs.clock, "reference": inputs.reference}
        carry = []
        for component, own, given in zip(components, parameters.own, inputs.own, strict=True):
            state = component.init(ops, own, given, signals)
            signals[component.name] = state
            waited = inputs.clock.elapsed * (component.period - 1)
            carry.append(state if component.period == 1 else _Scheduled(state, 0.0, waited))
        return tuple(carry)

    def step(
        ops: Ops, parameters: LoopParameters, carry: tuple[Tree, ...], inputs: LoopInput
    ) -> tuple[tuple[Tree, ...], Tree]:
        signals = {"start": parameters.start, "clock": inputs.clock, "reference": inputs.reference}
        for component, state in zip(components, carry, strict=True):
            signals[component.name] = state if component.period == 1 else state.state
        following = []
        for i, component in enumerate(components):
            if component.period == 1:
                state = component.step(ops, parameters.own[i], carry[i], inputs.own[i], signals)
                following.append(state)
            else:
                scheduled = _scheduled_step(
                    ops, component, parameters.own[i], carry[i], inputs.own[i], signals
                )
                following.append(scheduled)
                state = scheduled.state
            if component.feedthrough:
                signals[component.name] = state
        return tuple(following), log(signals)

    return init, step


def _scheduled_step(
    ops: Ops, component: Component, parameters: Tree, scheduled: _Scheduled, inputs: Tree, signals: Signals
) -> _Scheduled:
    """The component a tick later, stepped if it is due; both ways are computed, as kernels do not branch."""
    due = scheduled.countdown < 0.5
    elapsed = scheduled.waited + signals["clock"].elapsed
    own_signals = {**signals, "clock": signals["clock"]._replace(elapsed=elapsed)}
    stepped = component.step(ops, parameters, scheduled.state, inputs, own_signals)
    pairs = zip(tree_leaves(stepped), tree_leaves(scheduled.state), strict=True)
    return _Scheduled(
        tree_unflatten(stepped, [ops.select(due, new, old) for new, old in pairs]),
        ops.select(due, component.period - 1.0, scheduled.countdown - 1.0),
        ops.select(due, 0.0, elapsed),
    )
