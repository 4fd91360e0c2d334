"""The closed loop of vehicle and controller: what it is given, what it is told at each tick, and its laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.engines.engine import Init, Step
from aerobat.engines.packing import airframes, bodies, components, controller_models
from aerobat.errors import SpecError
from aerobat.flatness import lateral_drag, reference
from aerobat.flight import DIVERGED
from aerobat.kernels import control, tally
from aerobat.kernels.control import Commands, ControllerState, ControllerModel
from aerobat.kernels.controller import Controller
from aerobat.kernels.integrator import Airframe, Motion
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.position_loop import Lookahead, ReferencePoint
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.tally import Asked, Bounds, Tally
from aerobat.metrics import passage_window
from aerobat.problem.gate import Gate
from aerobat.simulation import StateNoise, plant
from aerobat.simulation.noise import observed
from aerobat.states import BodyState, Setpoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


class Given(NamedTuple):
    """What does not change along a flight."""

    airframe: Airframe  # what flies
    model: ControllerModel  # what the controller believes flies
    start: Body


class Tick(NamedTuple):
    """What the loop is told at each tick."""

    target: ReferencePoint
    elapsed: Scalar  # [s] since the tick before
    period: Scalar  # [s] until the next
    error: Body | tuple[()]  # of what the controller sees


class Judged(NamedTuple):
    """A tick of a flight that is scored."""

    tick: Tick
    asked: Asked


class Row(NamedTuple):
    """What the loop tells of each tick."""

    motion: Motion
    commands: Commands


@dataclass(frozen=True, eq=False)
class Prepared:
    """A flight before it is flown."""

    given: Given
    ticks: Tick
    times: Array  # [s]
    setpoint: Setpoint
    vehicles: tuple[Vehicle, ...]  # that fly
    believed: tuple[Vehicle, ...]  # that their controllers believe in
    batch: bool  # whether one was asked for
    loop: tuple[Init, Step]

    def judged(self, gate: Gate | None) -> tuple[tuple[Given, Bounds], Judged]:
        """Parameters and inputs of the loop that is `added_up`."""
        return (self.given, _bounds(gate, len(self.vehicles))), Judged(self.ticks, self._asked(gate))

    def _asked(self, gate: Gate | None) -> Asked:
        position = self.setpoint.flat.position
        sought = np.zeros(len(self.times))
        if gate is not None:
            sought[passage_window(self.times, position, gate)] = 1.0
        return Asked(self.times, components(position), components(self.setpoint.q_world_body), sought)


def prepare(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    *,
    yaw: float,
    controller: Controller,
    rate: float,
    start: BodyState | None,
    noise: StateNoise | None,
    seed: int | np.random.SeedSequence,
    model: Vehicle | None,
) -> Prepared:
    """All that a flight takes; see `flying.fly`. Raises SpecError for arguments that do not fit together."""
    flown, believed, batch = _crew(vehicle, model, start)
    asked = reference(trajectory, believed[0], rate=rate, yaw=yaw)
    setpoint, times = asked.setpoint, asked.times
    later = np.minimum(times + controller.actuation_delay(1.0 / rate), times[-1])
    ahead = reference(trajectory, believed[0], times=later, yaw=yaw).setpoint
    # all but the last period alike to the last bit, so that an engine may see that they are
    periods = np.append(np.full(len(times) - 2, 1.0 / rate), [times[-1] - times[-2], 0.0])
    ticks = Tick(
        _target(setpoint, ahead, believed[0].gravity),
        np.append(periods[0], periods[:-1]),
        periods,
        () if noise is None else bodies(noise.drawn(_generators(seed, len(flown), batch), len(times))),
    )
    return Prepared(
        given=Given(airframes(flown), controller_models(controller, believed), _started(start, setpoint, len(flown))),
        ticks=ticks,
        times=times,
        setpoint=setpoint,
        vehicles=tuple(flown),
        believed=tuple(believed),
        batch=batch,
        loop=_closed_loop(_switches(controller), plant.substeps(1.0 / rate)),
    )


@lru_cache(maxsize=32)
def added_up(init: Init, step: Step) -> tuple[Init, Step]:
    """The loop with a tally, which is all that it tells."""

    def begin(ops: Ops, parameters: tuple[Given, Bounds], tick: Judged) -> tuple[Any, Tally]:
        return init(ops, parameters[0], tick.tick), tally.init()

    def advance(
        ops: Ops, parameters: tuple[Given, Bounds], carry: tuple[Any, Tally], tick: Judged
    ) -> tuple[tuple[Any, Tally], Tally]:
        given, bounds = parameters
        flight, row = step(ops, given, carry[0], tick.tick)
        actuation = (row.motion.thrusts, row.commands.thrusts)
        judged = tally.step(
            ops, bounds, carry[1], row.motion.body, actuation, row.commands.saturated, tick.asked
        )
        return (flight, judged), judged

    return begin, advance


@lru_cache(maxsize=32)
def _closed_loop(switches: Controller, steps: int) -> tuple[Init, Step]:
    """The loop in scalar components: observe, control, move. The same for the same arguments."""

    def seen(body: Body, tick: Tick) -> Body:
        return observed(body, tick.error) if tick.error else body

    def init(ops: Ops, given: Given, tick: Tick) -> tuple[Motion, ControllerState]:
        memory = control.init(ops, given.model, seen(given.start, tick), tick.target)
        return Motion(given.start, memory.thrusts), memory

    def step(
        ops: Ops, given: Given, carry: tuple[Motion, ControllerState], tick: Tick
    ) -> tuple[tuple[Motion, ControllerState], Row]:
        motion, memory = carry
        body = seen(motion.body, tick)
        memory = control.step(ops, switches, given.model, memory, body, tick.target, tick.elapsed)
        commands = memory.commands
        moved = plant.step(ops, given.airframe, motion, commands.thrusts, tick.period, steps)
        return (moved, memory), Row(motion, commands)

    return init, step


def _switches(controller: Controller) -> Controller:
    """Only what makes the loop another one; its gains are the model's."""
    return Controller(
        moment_feedforward=controller.moment_feedforward,
        motor_lag_compensation=controller.motor_lag_compensation,
        prioritize_tilt=controller.prioritize_tilt,
    )


def _bounds(gate: Gate | None, vehicles: int) -> Bounds:
    centre = np.zeros(3) if gate is None else gate.position
    return Bounds(np.full(vehicles, DIVERGED**2), components(np.broadcast_to(centre, (vehicles, 3))))


def _crew(
    vehicle: Vehicle | Sequence[Vehicle], model: Vehicle | None, start: BodyState | None
) -> tuple[list[Vehicle], list[Vehicle], bool]:
    """The vehicles that fly, those that their controllers believe in, and whether they are a batch."""
    flown = [vehicle] if isinstance(vehicle, Vehicle) else list(vehicle)
    starts = np.shape(start.position)[:-1] if start is not None else ()
    if starts and len(flown) == 1:
        flown = flown * starts[0]
    if not flown or (starts and starts != (len(flown),)):
        raise SpecError(
            f"start must carry one leading axis of {len(flown)} vehicles or none, got {starts}"
            if flown
            else "vehicle must be at least one vehicle"
        )
    believed = flown if model is None else [model] * len(flown)
    if len({len(each.rotors) for each in (*flown, *believed)}) > 1:
        raise SpecError(
            "vehicle: all vehicles of one flight, and their model, need as many rotors; fly others apart"
        )
    if len({each.gravity for each in believed}) > 1:
        raise SpecError("vehicle: all vehicles of one flight need the same gravity; fly others apart")
    if len({lateral_drag(each) for each in believed}) > 1:
        raise SpecError(
            "vehicle: vehicles that differ in drag per mass need different attitudes; fly them apart, "
            "or give one model for all"
        )
    return flown, believed, bool(starts) or not isinstance(vehicle, Vehicle)


def _started(start: BodyState | None, setpoint: Setpoint, vehicles: int) -> Body:
    flat = setpoint.flat
    if start is None:
        first = BodyState(
            flat.position[0], flat.velocity[0], setpoint.q_world_body[0], setpoint.omega_body[0]
        )
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
        return bodies(
            BodyState(**{k: np.broadcast_to(v, (vehicles, v.shape[-1])) for k, v in vars(first).items()})
        )
    except ValueError:
        raise SpecError(f"start must carry the same leading axis of {vehicles} in all its fields") from None


def _target(setpoint: Setpoint, ahead: Setpoint, gravity: float) -> ReferencePoint:
    now, then = _specific_thrust(setpoint, gravity), _specific_thrust(ahead, gravity)
    change = np.linalg.norm(then, axis=-1) - np.linalg.norm(now, axis=-1)
    return ReferencePoint(
        components(setpoint.flat.position),
        components(setpoint.flat.velocity),
        components(now),
        components(setpoint.flat.jerk),
        components(setpoint.q_world_body),
        components(so3.rotate(setpoint.q_world_body, setpoint.omega_body)),
        Lookahead(
            change,
            components(so3.rotate(ahead.q_world_body, ahead.omega_body)),
            components(so3.rotate(ahead.q_world_body, ahead.omega_dot_body)),
        ),
    )


def _specific_thrust(setpoint: Setpoint, gravity: float) -> Array:
    return np.asarray(setpoint.flat.acceleration + np.array([0.0, 0.0, gravity]))


def _generators(seed: int | np.random.SeedSequence, vehicles: int, batch: bool) -> list[np.random.Generator]:
    try:
        root = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    except (TypeError, ValueError):
        raise SpecError(f"seed must be a whole number, zero or more, got {seed!r}") from None
    if not batch:
        return [np.random.default_rng(root)]
    keys = [(*root.spawn_key, k) for k in range(vehicles)]
    return [np.random.default_rng(np.random.SeedSequence(root.entropy, spawn_key=key)) for key in keys]
