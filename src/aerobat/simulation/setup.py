"""A flight before it is flown: its loop, the loop's parameters, and where its inputs come from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Any, Protocol

import numpy as np
from pydantic import Field, PlainValidator

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.control import Controller
from aerobat.control.parameters import airframe_parameters, controller_parameters, environment_parameters
from aerobat.declaration import AS_IT_IS, FieldError, declared, shown, validated
from aerobat.engines import CompiledLoop, Engine, choose
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import Tree, tree_map
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import Planned, environment_of, lateral_drag, vehicle_of
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.components import (
    PlantParameters,
    RigidBodyPlant,
    StateObserver,
    TrackingController,
    log_row,
)
from aerobat.simulation.loop import Component, Log, LoopInput, LoopParameters, compose
from aerobat.simulation.noise import NoiseSource, StateNoise, bodies
from aerobat.simulation.reference_source import BLOCK, ReferenceSource
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle, as_vehicle
from aerobat.vehicle.fleet import Fleet

_VEHICLE_TICKS = 160_000  # whose own inputs are made at once, so that they take little memory (50 MB)
_MIN_CHUNK = 16  # ticks


ControlRate = Annotated[float, Field(ge=1, le=1e6, description="number from 1 to 1e6")]
LogRate = Annotated[float, Field(ge=1e-3, le=1e6, description="number from 0.001 to 1e6")]


def _seed(value: Any) -> int | np.random.SeedSequence:
    if isinstance(value, np.random.SeedSequence):
        return value
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise FieldError("", f"must be a whole number, zero or more, or a SeedSequence, got {shown(value)}")
    return value


@declared
class FlightConfig:
    """Settings of a flight, whatever plan is flown."""

    controller: Controller = field(default_factory=Controller)
    rate: ControlRate = 500.0  # [1/s] of the controller
    noise: StateNoise | None = None  # errors of the state that the controller sees
    seed: Annotated[int | np.random.SeedSequence, PlainValidator(_seed)] = 0  # of the noise
    start: Annotated[BodyState, AS_IT_IS] | None = None  # true, by default the trajectory's; or a batch's
    nominal: Vehicle | None = None  # that controller and set-points are made for; by default what flies
    # floats, bytecode, numpy, compiled, jax, jax-float32, or the fastest that is installed
    engine: str = "auto"
    log_rate: LogRate | None = None  # [1/s] of the flight's rows, rate over a whole number; by default rate

    def __post_init__(self) -> None:
        stride = self.rate / (self.log_rate or self.rate)
        if stride < 1.0 or abs(stride - round(stride)) > 1e-6 * stride:
            complaint = f"must be rate ({self.rate:g}) over a whole number, got {self.log_rate}"
            raise FieldError("log_rate", complaint)

    @property
    def log_stride(self) -> int:
        """The ticks from one row of the log to the next."""
        return round(self.rate / (self.log_rate or self.rate))


class Source(Protocol):
    """Where the inputs of one component come from."""

    @property
    def per_vehicle(self) -> bool:
        """True if each vehicle has its own."""

    def chunk(self, begin: int, end: int) -> Tree:
        """The inputs of the ticks from `begin` to before `end`, leaves (ticks,) or (ticks, vehicles)."""


@dataclass(frozen=True, eq=False)
class FlightSetup:
    """Everything that a flight takes; to be compiled, then stepped or scanned at will."""

    components: tuple[Component, ...]
    parameters: LoopParameters
    reference: ReferenceSource
    sources: tuple[Source | None, ...]  # of each component's own inputs
    fleet: Fleet  # that flies
    nominal: Fleet
    environment: Environment
    config: FlightConfig
    is_batch: bool

    @property
    def times(self) -> Array:
        """Of the ticks [s]."""
        return self.reference.times

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
        own = tuple(() if source is None else source.chunk(begin, end) for source in self.sources)
        due = tuple(
            () if component.period == 1 else self.reference.due(component.period, begin, end)
            for component in self.components
        )
        return LoopInput(self.reference.clock(begin, end), due, self.reference.chunk(begin, end), own)

    def chunks(self, log_stride: int = 1, copies: int = 1) -> Iterator[tuple[int, int]]:
        """The flight cut into pieces whose inputs fit into little memory, each of one block.

        A piece that holds rows of the log begins with one. Each of `copies` of a vehicle has its own inputs.
        """
        ticks, size = len(self.times), BLOCK
        if any(source is not None and source.per_vehicle for source in self.sources):
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


@validated
def prepare(
    plan: Planned | Trajectory,
    vehicle: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Any,
) -> FlightSetup:
    """All that a flight takes, to be stepped, cut or branched at will: `loop = prepare(plan).compile()`.

    Then `carry = loop.init(setup.first_tick)` and, for each tick k,
    `carry, row = loop.step(carry, setup.tick(k))`.

    Args:
        plan: what is flown; a bare trajectory needs a vehicle.
        vehicle: what flies it, or its name, by default the plan's.
        environment: where, by default the problem's; for a bare trajectory a calm day on Earth.
        config: how.
        changes: fields of FlightConfig that replace those of `config`, as `seed=3`.

    Raises SpecError for arguments that do not fit together.
    """
    config = replace(config, **changes)
    environment = environment_of(plan, environment)
    flying, nominal = _broadcast_vehicles(_vehicles(plan, vehicle), config)
    is_fleet = isinstance(vehicle, Sequence) and not isinstance(vehicle, str)
    is_batch = is_fleet or _batch_of(config.start) != ()
    reference = ReferenceSource(as_trajectory(plan), nominal[0], environment, config.rate)
    fleet = Fleet.of(flying)
    nominal_fleet = fleet if nominal is flying else Fleet.of(nominal)
    model = controller_parameters(config.controller, nominal_fleet, environment)
    for grounded in np.flatnonzero(~np.isfinite(model.gains.stiffness)):
        nominal[grounded].require_hover(environment.gravity)
    if nominal_fleet is not fleet:  # one for all
        model = tree_map(lambda leaf: np.broadcast_to(leaf, len(fleet)), model)
    plant = PlantParameters(airframe_parameters(fleet), environment_parameters(environment, len(fleet)))
    errors = None
    if config.noise is not None:
        errors = NoiseSource(config.noise, config.seed, len(fleet) if is_batch else None)
    return FlightSetup(
        components=(
            StateObserver(),
            TrackingController(config.controller.feature_flags),
            RigidBodyPlant.for_rate(config.rate),
        ),
        parameters=LoopParameters(_start(config.start, reference, len(fleet)), ((), model, plant)),
        reference=reference,
        sources=(errors, None, None),
        fleet=fleet,
        nominal=nominal_fleet,
        environment=environment,
        config=config,
        is_batch=is_batch,
    )


def _vehicles(
    plan: Planned | Trajectory, vehicle: Vehicle | str | Sequence[Vehicle | str] | None
) -> list[Vehicle]:
    """The vehicles that are named, by default the plan's own."""
    if vehicle is None or isinstance(vehicle, Vehicle | str):
        return [vehicle_of(plan, vehicle)]
    return [as_vehicle(each) for each in vehicle]


def _batch_of(start: BodyState | None) -> tuple[int, ...]:
    return () if start is None else np.shape(start.position)[:-1]


def _broadcast_vehicles(flying: list[Vehicle], config: FlightConfig) -> tuple[list[Vehicle], list[Vehicle]]:
    """The vehicles that fly, one for each start, and the nominal ones."""
    starts = _batch_of(config.start)
    if starts and len(flying) == 1:
        flying = flying * starts[0]
    if not flying:
        raise SpecError("vehicle must be at least one vehicle")
    if starts and starts != (len(flying),):
        raise SpecError(f"start must carry one leading axis of {len(flying)} vehicles or none, got {starts}")
    nominal = flying if config.nominal is None else [config.nominal]
    for controlled in nominal:
        controlled.without_dead_rotors()
    if len({len(each.rotors) for each in (*flying, nominal[0])}) > 1:
        raise SpecError(
            "vehicle: all vehicles of one flight, and the nominal one, need as many rotors; fly others apart"
        )
    if config.nominal is None and len({lateral_drag(each) for each in flying}) > 1:
        raise SpecError(
            "vehicle: vehicles that differ in drag per mass need different attitudes; fly them apart, "
            "or give one nominal vehicle for all"
        )
    return flying, nominal


def _start(start: BodyState | None, reference: ReferenceSource, vehicles: int) -> Body:
    if start is None:
        asked = reference.setpoint(0, 1)
        flat = asked.flat
        first = BodyState(flat.position[0], flat.velocity[0], asked.q_world_body[0], asked.omega_body[0])
    else:
        q = frozen(start.q_world_body, "start.q_world_body", (4,))
        if (np.abs(np.linalg.norm(q, axis=-1) - 1.0) > 1e-6).any():
            raise SpecError("start.q_world_body must be unit quaternions; divide by the norm")
        first = BodyState(
            frozen(start.position, "start.position", (3,)),
            frozen(start.velocity, "start.velocity", (3,)),
            so3.normalize(q),
            frozen(start.omega_body, "start.omega_body", (3,)),
        )
    try:
        each = {name: np.broadcast_to(part, (vehicles, part.shape[-1])) for name, part in vars(first).items()}
    except ValueError:
        raise SpecError(f"start must carry the same leading axis of {vehicles} in all its fields") from None
    return bodies(BodyState(**each))
