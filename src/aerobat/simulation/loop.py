"""The simulation loop over time, a tuple of components: sensors, controller, plant, monitors.

At each tick the components step in order. A component with direct feedthrough (a sensor, a controller) shows
its new state to the components after it and to the log at this tick. A component without (the plant) shows
its present state at this tick and the new one at the next. A component whose period is k ticks steps at the
first tick and at every k-th tick after it, and holds its state between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, Protocol, TypeAlias, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree
from aerobat.kernels.control import Controlling
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.ops import Ops, Scalar, select_tree
from aerobat.kernels.rigid_body import Body

State = TypeVar("State")


class StepClock(NamedTuple):
    """The times since a component's last step and until its next, which change at few steps."""

    elapsed: Scalar  # [s] since its last step
    period: Scalar  # [s] until its next

    @property
    def piecewise_constant(self) -> bool:
        """True: see `engines.engine.Compile`."""
        return True


class Estimate(NamedTuple):
    """The state of an observer, of which the controller uses the body."""

    body: Body
    own: Tree = ()  # the observer's internal state; () where it sees the true state


@dataclass(frozen=True)
class Signals:
    """All that a component sees at a tick: time, inputs, and the states of the others, found by type."""

    ops: Ops  # the arithmetic of the engine
    clock: StepClock
    reference: ReferencePoint
    start: Body  # the true initial state
    inputs: Tree  # of the component itself; () where it has none
    states: list[Tree]  # of the components in order; in `init`, of the components initialized so far

    def find(self, kind: type[State]) -> State | None:
        """Return the state of that type, or None where no component has one."""
        return next((state for state in self.states if isinstance(state, kind)), None)

    def of(self, kind: type[State]) -> State:
        """Return the state of that type, which must exist. Raises LookupError where no component has one."""
        found = self.find(kind)
        if found is None:
            raise LookupError(f"no component of the loop has a state of the type {kind.__name__}")
        return found

    @property
    def plant(self) -> VehicleState:
        """The true state of body and rotors."""
        return self.of(VehicleState)

    @property
    def observer(self) -> Estimate:
        """The observer's estimate of the state."""
        return self.of(Estimate)

    @property
    def controller(self) -> Controlling:
        """The controller's state, of whatever controller the loop has."""
        return next(state for state in self.states if isinstance(state, Controlling))


Log: TypeAlias = Callable[[Signals], Tree]
# inputs of a component at the ticks from `begin` to before `end`, leaves (ticks,) or (ticks, vehicles)
Source: TypeAlias = Callable[[int, int], Tree]


class LoopParameters(NamedTuple):
    """Parameters that do not change during a flight."""

    start: Body  # the true initial state
    own: tuple[Tree, ...]  # of each component


class Due(NamedTuple):
    """The steps of a component with a period of more than one tick."""

    now: Scalar  # 1 at a tick at which the component steps, else 0
    clock: StepClock  # about the latest of these ticks: since the one before, until the next


def due_ticks(period: int, begin: int, end: int, delay: int = 0) -> Array:
    """Return 1 for each tick from `begin` to before `end` that follows a step by `delay` ticks, else 0.

    The steps are at tick 0 and at every `period` ticks after it.
    """
    since = np.arange(begin, end) - delay
    return np.asarray((since >= 0) & (since % period == 0), dtype=np.float64)


class LoopInput(NamedTuple):
    """The external inputs of the loop at a tick."""

    clock: StepClock
    due: tuple[Due | tuple[()], ...]  # of each component; () where it steps at every tick
    reference: ReferencePoint
    own: tuple[Tree, ...]  # of each component


class Component(Protocol):
    """One part of the loop: a frozen, hashable value without numerical parameters."""

    @property
    def feedthrough(self) -> bool:
        """True if the new state is seen at the tick of its step, false if at the next tick."""
        return True

    def init(self, parameters: Tree, signals: Signals) -> Tree:
        """Return the state before the first tick; `signals` holds the states of earlier components."""

    def step(self, parameters: Tree, state: Tree, signals: Signals) -> Tree:
        """Return the next state, from the component's parameters and its signals."""


@dataclass(frozen=True, eq=False)
class LoopPart:
    """One component of the loop with its parameters, the source of its inputs, and its period."""

    component: Component
    parameters: Tree = ()  # leaves (vehicles,), or one number for all vehicles
    source: Source | None = None  # None for a component without inputs
    period: int = 1  # ticks from one step to the next


@lru_cache(maxsize=64)
def compose(components: tuple[Component, ...], log: Log) -> tuple[Init, Step]:
    """Return the loop of some components as two functions for an engine, the same for the same arguments.

    The carry is a tuple of the components' states; `log` makes a row of the signals.
    """

    def init(ops: Ops, parameters: LoopParameters, inputs: LoopInput) -> tuple[Tree, ...]:
        signals = Signals(ops, inputs.clock, inputs.reference, parameters.start, (), [])
        for component, own, given in zip(components, parameters.own, inputs.own, strict=True):
            signals.states.append(component.init(own, replace(signals, inputs=given)))
        return tuple(signals.states)

    def step(
        ops: Ops, parameters: LoopParameters, carry: tuple[Tree, ...], inputs: LoopInput
    ) -> tuple[tuple[Tree, ...], Tree]:
        signals = Signals(ops, inputs.clock, inputs.reference, parameters.start, (), list(carry))
        following = []
        each = zip(components, parameters.own, carry, inputs.due, inputs.own, strict=True)
        for k, (component, own, before, due, given) in enumerate(each):
            seen = replace(signals, clock=due.clock if due else signals.clock, inputs=given)
            state = component.step(own, before, seen)
            if due:
                state = select_tree(ops, due.now > 0.5, state, before)
            following.append(state)
            if component.feedthrough:
                signals.states[k] = state
        return tuple(following), log(signals)

    return init, step
