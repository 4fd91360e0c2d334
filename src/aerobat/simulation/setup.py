"""A flight before it is flown: its loop, the loop's parameters, and where its inputs come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Protocol

from aerobat.arrays import Array
from aerobat.engines import CompiledLoop, Engine, choose
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import Tree
from aerobat.environment import Environment
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.components import log_row
from aerobat.simulation.config import FlightConfig
from aerobat.simulation.loop import Component, Log, LoopInput, LoopParameters, compose
from aerobat.simulation.reference_source import BLOCK, ReferenceSource
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.fleet import Fleet

_VEHICLE_TICKS = 512_000  # whose own inputs are made at once, so that they take little memory (30 MB)
_MIN_CHUNK = 16  # ticks


class Source(Protocol):
    """The source of one component's inputs."""

    @property
    def per_vehicle(self) -> bool:
        """True if each vehicle has its own."""

    def chunk(self, begin: int, end: int) -> Tree:
        """The inputs of the ticks from `begin` to before `end`, leaves (ticks,) or (ticks, vehicles)."""


@dataclass(frozen=True, eq=False)
class LoopPart:
    """One component of the loop, its parameters with leaves (vehicles,), and where its inputs come from."""

    component: Component
    parameters: Tree = ()
    source: Source | None = None


@dataclass(frozen=True, eq=False)
class FlightSetup:
    """Everything that a flight takes; to be compiled, then stepped or scanned at will."""

    start: Body  # the true state at first
    parts: tuple[LoopPart, ...]  # in the order of their steps
    reference: ReferenceSource
    fleet: Fleet  # that flies
    nominal: Fleet
    environment: Environment
    config: FlightConfig
    controller: Controller  # whose gains the loop has
    is_batch: bool
    rate: float  # [1/s] of the ticks

    @property
    def components(self) -> tuple[Component, ...]:
        """Of the loop, in the order of their steps."""
        return tuple(part.component for part in self.parts)

    @property
    def parameters(self) -> LoopParameters:
        """Of the loop."""
        return LoopParameters(self.start, tuple(part.parameters for part in self.parts))

    @property
    def times(self) -> Array:
        """Of the ticks [s]."""
        return self.reference.times

    @property
    def log_stride(self) -> int:
        """The ticks from one row of the log to the next."""
        return round(self.rate / self.config.rows_rate)

    def engine(self, copies: int = 1) -> Engine:
        """The engine asked for, or the fastest for so many copies of the vehicles."""
        return choose(self.config.engine, copies * len(self.fleet), len(self.times))

    def compile(self, engine: Engine | None = None, log: Log = log_row) -> CompiledLoop:
        """The loop, ready for `init`, `step` and `scan`; its rows are what `log` takes of the signals."""
        init, step = compose(self.components, log)
        return (engine or self.engine()).compile(init, step, self.parameters, self.first_tick)

    @cached_property
    def first_tick(self) -> LoopInput:
        """The inputs of the first tick."""
        return self.tick(0)

    def tick(self, tick: int) -> LoopInput:
        """The inputs of one tick, for `init` and `step`."""
        inputs: LoopInput = first_row(self.inputs(tick, tick + 1))
        return inputs

    def inputs(self, begin: int, end: int) -> LoopInput:
        """The inputs of the ticks from `begin` to before `end`, all of one block, for `scan`."""
        own = tuple(() if part.source is None else part.source.chunk(begin, end) for part in self.parts)
        periods = (part.component.period for part in self.parts)
        due = tuple(() if period == 1 else self.reference.due(period, begin, end) for period in periods)
        return LoopInput(self.reference.clock(begin, end), due, self.reference.chunk(begin, end), own)

    def chunks(self, log_stride: int = 1, copies: int = 1) -> Iterator[tuple[int, int]]:
        """The flight cut into pieces whose inputs fit into little memory, each of one block.

        A piece that holds rows of the log begins with one. Each of `copies` of a vehicle has its own inputs.
        """
        ticks, size = len(self.times), BLOCK
        if any(part.source is not None and part.source.per_vehicle for part in self.parts):
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
