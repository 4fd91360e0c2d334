"""Flights before they are flown: the loop, its parameters, and the sources of its inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from aerobat.arrays import Array
from aerobat.control import ControlLaw
from aerobat.control.parameters import airframe_parameters, controller_parameters, environment_parameters
from aerobat.engines import CompiledLoop, Engine, choose, logged_ticks
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import Tree, tree_leaves, tree_map, tree_stack
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.components import (
    ComputationDelay,
    ControllerParameters,
    PlantParameters,
    RigidBodyPlant,
    StateObserver,
    log_row,
    rigid_body_steps,
)
from aerobat.simulation.config import FlightConfig
from aerobat.simulation.law_controller import controller_component, inner_loop
from aerobat.simulation.loop import (
    Component,
    Log,
    LoopInput,
    LoopParameters,
    LoopPart,
    compose,
    due_ticks,
)
from aerobat.simulation.reference_source import BLOCK, ReferenceSource
from aerobat.vehicle import Vehicle
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.fleet import Fleet

_VEHICLE_TICKS = 512_000  # vehicles times ticks whose own inputs are made at once, in 30 MB
_MIN_CHUNK = 16  # smallest number of ticks made at once


@dataclass(frozen=True, eq=False)
class LoopSetup:
    """A loop before it runs: its parts, which can be compiled and then stepped or scanned."""

    start: Body  # the true initial state
    parts: tuple[LoopPart, ...]  # in the order of their steps

    @property
    def components(self) -> tuple[Component, ...]:
        """The components of the loop, in the order of their steps."""
        return tuple(part.component for part in self.parts)

    @property
    def parameters(self) -> LoopParameters:
        """The parameters of the loop, leaves (vehicles,)."""
        vehicles = len(self.start.position[0])
        own = tuple(part.parameters for part in self.parts)
        return LoopParameters(self.start, tree_map(lambda leaf: np.broadcast_to(leaf, vehicles), own))

    def compile_for(self, engine: Engine, first_tick: LoopInput, log: Log) -> CompiledLoop:
        """Return the compiled loop with `init`, `step` and `scan`; `log` makes a row of the signals."""
        return engine.compile(*compose(self.components, log), self.parameters, first_tick)


def plant_part(
    fleet: Fleet, environment: Environment, rate: float, effectiveness: Array | None = None
) -> LoopPart:
    """Return the part of the loop for the rigid bodies of a fleet.

    Args:
        fleet: the vehicles.
        environment: gravity and wind.
        rate: of the ticks [1/s].
        effectiveness: of the rotors [-], (vehicles, n); left out, 1.
    """
    airframe = airframe_parameters(fleet, effectiveness)
    return LoopPart(
        RigidBodyPlant(rigid_body_steps(1.0 / rate)),
        PlantParameters(airframe, environment_parameters(environment, len(fleet))),
    )


def controller_model(
    controller: Controller, nominal: Sequence[Vehicle], known: Fleet, environment: Environment
) -> ControllerModel:
    """Return a controller's model of its nominal vehicles, leaves (vehicles,).

    Args:
        controller: its settings.
        nominal: the nominal vehicles, one for each flight or one for all.
        known: the fleet of the nominal vehicles.
        environment: gravity and wind.

    Raises SpecError for a vehicle that cannot hover.
    """
    model = controller_parameters(controller, known, environment)
    for grounded in np.flatnonzero(~np.isfinite(model.gains.stiffness)).tolist():
        nominal[grounded].require_hover(environment.gravity)
    return model


@dataclass(frozen=True, eq=False)
class Realization:
    """Vehicles that really fly, of which the controller knows a model: as given, or drawn from conditions."""

    reference: ReferenceSource
    fleet: Fleet  # the vehicles that really fly
    start: Body
    effectiveness: Array | None = None  # of the rotors [-], (vehicles, n); None for 1
    disturbances: tuple[LoopPart, ...] = ()  # parts before the observer: wind, battery, sensors
    observers: tuple[LoopPart, ...] = (LoopPart(StateObserver()),)
    period: int = 1  # of the controller, in ticks
    delay: int = 0  # ticks from a controller's step until its commands take effect

    def parts(
        self, law: ControlLaw | None, settings: Controller, model: ControllerModel
    ) -> tuple[LoopPart, ...]:
        """Return the parts of the loop, in the order of their steps.

        The controller's reference is that of the time when its commands take effect.

        Args:
            law: the control law; None for the tracking controller.
            settings: of the controller.
            model: of the nominal vehicles, that the controller has.
        """
        late = self.delay / self.reference.rate
        source = None
        if self.period > 1 or self.delay > 0:
            source = replace(self.reference, every=self.period, delay=late).chunk
        parameters = ControllerParameters(model, late if self.delay else ())
        takes_effect = partial(due_ticks, self.period, delay=self.delay)
        waiting = (LoopPart(ComputationDelay(), (), takes_effect),) if self.delay else ()
        return (
            *self.disturbances,
            *self.observers,
            LoopPart(controller_component(law, settings), parameters, source, self.period),
            *waiting,
            *inner_loop(law, model),
            plant_part(self.fleet, self.reference.environment, self.reference.rate, self.effectiveness),
        )


@dataclass(frozen=True, eq=False)
class FlightSetup(LoopSetup):
    """Everything that is needed to simulate a flight."""

    reference: ReferenceSource
    fleet: Fleet  # the vehicles that really fly
    nominal: Fleet
    environment: Environment
    config: FlightConfig
    controller: Controller  # whose gains the loop has
    is_batch: bool

    @property
    def times(self) -> Array:
        """The times of the ticks [s]."""
        return self.reference.times

    @property
    def log_stride(self) -> int:
        """The number of ticks from one row of the log to the next."""
        return round(self.reference.rate / self.config.rows_rate)

    def engine(self, copies: int = 1) -> Engine:
        """Return the requested engine, or the fastest for so many copies of the vehicles."""
        return choose(self.config.engine, copies * len(self.fleet), len(self.times))

    def compile(self, log: Log = log_row) -> CompiledLoop:
        """Return the compiled loop with `init`, `step` and `scan`; `log` makes a row of the signals."""
        return self.compile_for(self.engine(), self.first_tick, log)

    @cached_property
    def first_tick(self) -> LoopInput:
        """The inputs of the first tick."""
        return self.tick(0)

    def tick(self, tick: int) -> LoopInput:
        """Return the inputs of one tick, for `init` and `step`. Raises SpecError outside of the flight."""
        if not 0 <= tick < len(self.times):
            raise SpecError(f"tick must be from 0 to {len(self.times) - 1}, the flight's last, got {tick}")
        inputs: LoopInput = first_row(self.inputs(tick, tick + 1))
        return inputs

    def inputs(self, begin: int, end: int) -> LoopInput:
        """Return the inputs of the ticks from `begin` to before `end`, within one block, for `scan`."""
        own = tuple(() if part.source is None else part.source(begin, end) for part in self.parts)
        periods = (part.period for part in self.parts)
        due = tuple(() if period == 1 else self.reference.due(period, begin, end) for period in periods)
        return LoopInput(self.reference.clock(begin, end), due, self.reference.chunk(begin, end), own)

    def scan(self, log: Log, stride: int) -> tuple[Tree, tuple[Tree, ...]]:
        """Run the whole flight.

        Args:
            log: The function that makes a row of the signals.
            stride: The ticks from one row to the next.

        Returns the rows at multiples of the stride and at the last tick, leaves (vehicles, rows), and the
        final states of the loop's components.
        """
        loop = self.compile(log)
        carry = loop.init(self.first_tick)
        logged = logged_ticks(len(self.times), stride)
        parts = []
        for begin, end in self.chunks(stride):
            chunk_stride = end if begin % stride else stride
            carry, rows = loop.scan(carry, self.inputs(begin, end), chunk_stride)
            kept = np.isin(begin + logged_ticks(end - begin, chunk_stride), logged)
            parts.append(rows if kept.all() else tree_map(partial(np.compress, kept, axis=1), rows))
        whole = parts[0] if len(parts) == 1 else tree_stack(parts, partial(np.concatenate, axis=-1))
        return whole, carry

    def chunks(self, log_stride: int = 1, copies: int = 1) -> Iterator[tuple[int, int]]:
        """Yield the flight in pieces (begin, end) whose inputs fit into little memory, each within one block.

        A piece that contains rows of the log begins with one. Memory is counted for `copies` of each vehicle.
        """
        ticks, size = len(self.times), BLOCK
        if any(np.ndim(leaf) for leaf in tree_leaves(self.first_tick.own)):  # each vehicle has its own
            size = min(max(_VEHICLE_TICKS // (copies * len(self.fleet)), _MIN_CHUNK), BLOCK)
        cuts = {ticks, *range(0, ticks, BLOCK)}
        if log_stride > size:
            cuts.update(range(0, ticks, size), range(0, ticks, log_stride))
        else:
            size -= size % log_stride
            for first in range(0, ticks, BLOCK):
                aligned = -(-first // log_stride) * log_stride
                cuts.update(range(aligned, min(first + BLOCK, ticks), size))
        return pairwise(sorted(cuts))
