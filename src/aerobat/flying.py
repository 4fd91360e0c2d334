"""fly(): one or many vehicles along a trajectory, in simulation; reference → control → plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat import engines, so3
from aerobat.arrays import Array, frozen
from aerobat.engines.engine import Init, Step
from aerobat.engines.packing import airframes, bodies, body_states, components, joined, models
from aerobat.errors import SpecError
from aerobat.flatness import lateral_drag, reference
from aerobat.flight import COMPLETE, Flight, first_rows
from aerobat.kernels import control
from aerobat.kernels.control import Commands, Memory, Model
from aerobat.kernels.controller import Controller
from aerobat.kernels.integrator import Airframe, Motion
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.position_loop import Ahead, Target
from aerobat.kernels.rigid_body import Body
from aerobat.simulation import StateNoise, plant
from aerobat.simulation.noise import observed
from aerobat.states import BodyState, Setpoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

DIVERGED = 5.0  # [m] of position error: no controller is expected back from there


class _Given(NamedTuple):
    """What does not change along a flight."""

    airframe: Airframe  # what flies
    model: Model  # what the controller believes flies
    start: Body


class _Tick(NamedTuple):
    """What the loop is told at each tick."""

    target: Target
    elapsed: Scalar  # [s] since the tick before
    period: Scalar  # [s] until the next
    error: Body | tuple[()]  # of what the controller sees


class _Row(NamedTuple):
    """What the loop tells of each tick."""

    motion: Motion
    commands: Commands


def fly(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    *,
    yaw: float = 0.0,
    controller: Controller = Controller(),  # noqa: B008 - frozen
    rate: float = 500.0,
    start: BodyState | None = None,
    noise: StateNoise | None = None,
    seed: int | np.random.SeedSequence = 0,
    engine: str = "auto",
    model: Vehicle | None = None,
) -> Flight:
    """Fly a trajectory in the nonlinear simulation (paper, Sections III and IV-A).

    One vehicle, or a batch: a sequence of vehicles with as many rotors each, or a `start` with a leading
    axis. Vehicle k of a batch flies as it would alone with the seed `SeedSequence(seed, spawn_key=(k,))`.
    Divergence (5 m off, or no longer a number) ends a flight and is its outcome, not an error.

    `yaw` [rad] turns the attitude about the thrust axis. `rate` [1/s] is the controller's. `start` is the
    true state at first, by default what the trajectory asks. `noise` is the error of the state that the
    controller sees. `engine` is "floats", "numpy", or "auto" for the faster of them. `model` is the
    vehicle that controller and set-points take to be flying, by default the one that is.
    Raises SpecError for arguments that do not fit together.
    """
    flown, believed, batch = _crew(vehicle, model, start)
    asked = reference(trajectory, believed[0], rate=rate, yaw=yaw)
    setpoint, times = asked.setpoint, asked.times
    later = np.minimum(times + controller.effect_delay(1.0 / rate), times[-1])
    ahead = reference(trajectory, believed[0], times=later, yaw=yaw).setpoint
    periods = np.diff(times, append=times[-1])
    given = _Given(airframes(flown), models(controller, believed), _started(start, setpoint, len(flown)))
    ticks = _Tick(
        _target(setpoint, ahead, believed[0].gravity),
        np.append(periods[0], periods[:-1]),
        periods,
        () if noise is None else bodies(noise.drawn(_generators(seed, len(flown), batch), len(times))),
    )
    chosen = engines.choose(engine, len(flown))
    rows = chosen.scan(*_closed_loop(controller, plant.substeps(1.0 / rate)), given, ticks)
    return _flight(rows, times, setpoint, flown, batch, chosen.name)


def _closed_loop(controller: Controller, steps: int) -> tuple[Init, Step]:
    """The loop in scalar components: observe, control, move."""

    def seen(body: Body, tick: _Tick) -> Body:
        return observed(body, tick.error) if tick.error else body

    def init(ops: Ops, given: _Given, tick: _Tick) -> tuple[Motion, Memory]:
        memory = control.init(ops, given.model, seen(given.start, tick), tick.target)
        return Motion(given.start, memory.thrusts), memory

    def step(
        ops: Ops, given: _Given, carry: tuple[Motion, Memory], tick: _Tick
    ) -> tuple[tuple[Motion, Memory], _Row]:
        motion, memory = carry
        body = seen(motion.body, tick)
        memory = control.step(ops, controller, given.model, memory, body, tick.target, tick.elapsed)
        commands = memory.commands
        moved = plant.step(ops, given.airframe, motion, commands.thrusts, tick.period, steps)
        return (moved, memory), _Row(motion, commands)

    return init, step


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


def _target(setpoint: Setpoint, ahead: Setpoint, gravity: float) -> Target:
    now, then = _specific_thrust(setpoint, gravity), _specific_thrust(ahead, gravity)
    change = np.linalg.norm(then, axis=-1) - np.linalg.norm(now, axis=-1)
    return Target(
        components(setpoint.flat.position),
        components(setpoint.flat.velocity),
        components(now),
        components(setpoint.flat.jerk),
        components(setpoint.q_world_body),
        components(so3.rotate(setpoint.q_world_body, setpoint.omega_body)),
        Ahead(
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


def _flight(
    rows: _Row, times: Array, setpoint: Setpoint, flown: list[Vehicle], batch: bool, engine: str
) -> Flight:
    states = body_states(rows.motion.body)
    thrusts, commands = joined(rows.motion.thrusts), joined(rows.commands.thrusts)
    ends, outcomes = _endings(states, (thrusts, commands), setpoint.flat.position, times)
    # a diverged vehicle repeats its last row for as long as another one flies
    shown = np.minimum(np.arange(ends.max() + 1), ends[:, None])

    def each(values: Array) -> Array:
        return values if batch else values[0]

    def kept(values: Any) -> Any:
        if (ends == ends.max()).all():
            return each(values[:, : ends.max() + 1])
        index = shown.reshape(*shown.shape, *(1,) * (values.ndim - 2))
        return each(np.take_along_axis(values, index, axis=1))

    return Flight(
        times=times[: ends.max() + 1],
        states=BodyState(**{name: kept(values) for name, values in vars(states).items()}),
        setpoint=first_rows(setpoint, ends.max() + 1),
        commands=kept(commands),
        thrusts=kept(thrusts),
        saturated=kept(rows.commands.saturated),
        min_thrusts=each(np.array([vehicle.min_thrusts for vehicle in flown])),
        max_thrusts=each(np.array([vehicle.max_thrusts for vehicle in flown])),
        ends=each(times[ends]),
        outcomes=outcomes,
        vehicles=tuple(vehicle.name for vehicle in flown),
        engine=engine,
    )


def _endings(
    states: BodyState, actuation: tuple[Array, Array], asked: Array, times: Array
) -> tuple[NDArray[np.intp], tuple[str, ...]]:
    """The last row of each vehicle, and its outcome."""
    series = (*vars(states).values(), *actuation)
    sound = np.logical_and.reduce([np.isfinite(values).all(axis=-1) for values in series])
    with np.errstate(over="ignore", invalid="ignore"):
        near = np.linalg.norm(states.position - asked, axis=-1) <= DIVERGED
    ends, outcomes = [], []
    for fine, close in zip(sound, near, strict=True):
        k = int(np.argmin(fine & close))  # the first row that is not, if there is one
        if fine[k] and close[k]:
            ends.append(len(times) - 1)
            outcomes.append(COMPLETE)
        else:
            reason = f"position error above {DIVERGED:g} m" if fine[k] else "its state is no longer a number"
            ends.append(k if fine[k] else k - 1)
            outcomes.append(f"diverged at {times[k]:.2f} s: {reason}")
    return np.array(ends), tuple(outcomes)
