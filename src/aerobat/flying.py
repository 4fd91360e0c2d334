"""fly(): one or many vehicles along a trajectory, in simulation; reference → control → plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from aerobat import engines
from aerobat.arrays import Array
from aerobat.closed_loop import Prepared, Row, added_up, prepare
from aerobat.engines import Engine
from aerobat.engines.packing import body_states, joined
from aerobat.engines.trees import rows
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flight import COMPLETE, DIVERGED, Flight, divergence, rows_of
from aerobat.kernels.controller import Controller
from aerobat.metrics import Score, tally_score
from aerobat.problem.problem import Problem
from aerobat.simulation import StateNoise
from aerobat.states import BodyState, Setpoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@overload
def fly(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    *,
    environment: Environment | None = ...,
    controller: Controller = ...,
    rate: float = ...,
    start: BodyState | None = ...,
    noise: StateNoise | None = ...,
    seed: int | np.random.SeedSequence = ...,
    engine: str = ...,
    model: Vehicle | None = ...,
    log_rate: float | None = ...,
    scored: None = ...,
) -> Flight: ...


@overload
def fly(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    *,
    environment: Environment | None = ...,
    controller: Controller = ...,
    rate: float = ...,
    start: BodyState | None = ...,
    noise: StateNoise | None = ...,
    seed: int | np.random.SeedSequence = ...,
    engine: str = ...,
    model: Vehicle | None = ...,
    log_rate: None = ...,
    scored: Problem,
) -> tuple[Score, ...]: ...


def fly(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    *,
    environment: Environment | None = None,
    controller: Controller = Controller(),  # noqa: B008 - frozen
    rate: float = 500.0,
    start: BodyState | None = None,
    noise: StateNoise | None = None,
    seed: int | np.random.SeedSequence = 0,
    engine: str = "auto",
    model: Vehicle | None = None,
    log_rate: float | None = None,
    scored: Problem | None = None,
) -> Flight | tuple[Score, ...]:
    """Fly a trajectory in the nonlinear simulation (paper, Sections III and IV-A).

    One vehicle, or a batch: a sequence of vehicles with as many rotors each, or a `start` with a leading
    axis. Vehicle k of a batch flies as it would alone with the seed `SeedSequence(seed, spawn_key=(k,))`.
    Divergence (5 m off, or no longer a number) ends a flight and is its outcome, not an error.

    `environment` is by default a calm day on Earth. `rate` [1/s] is the controller's. `start` is the
    true state at first, by default what the trajectory asks. `noise` is the error of the state that the
    controller sees. `engine` is "floats", "numpy", "compiled", "jax", or "auto" for the fastest that is
    installed. `model` is the vehicle that controller and set-points take to be flying, by default the one
    that is. `log_rate` [1/s] is that of the flight's rows, a whole fraction of `rate` and by default all of
    it. With a problem in `scored` no rows are kept, however many vehicles fly: the answer is each flight's
    score, added up as it is flown. Raises SpecError for arguments that do not fit together, BackendMissing
    for an engine that is not installed.
    """
    flight = prepare(
        trajectory,
        vehicle,
        environment=environment or Environment(),
        controller=controller,
        rate=rate,
        start=start,
        noise=noise,
        seed=seed,
        model=model,
    )
    chosen = engines.choose(engine, len(flight.vehicles), len(flight.times))
    if scored is not None:
        if log_rate is not None:
            raise SpecError("log_rate: a scored flight keeps no rows; leave log_rate or scored out")
        return _scores(flight, scored, chosen)
    every = _every(rate, log_rate)
    logged = engines.told(len(flight.times), every)
    series = chosen.scan(*flight.loop, flight.given, flight.ticks, every)
    setpoint = rows_of(flight.setpoint, logged)
    return _flight(series, flight.times[logged], setpoint, flight.vehicles, flight.batch, chosen.name)


def _scores(flight: Prepared, problem: Problem, engine: Engine) -> tuple[Score, ...]:
    """Of each vehicle, from its last tally."""
    tallies = engine.scan(
        *added_up(*flight.loop),
        *flight.judged(problem.gates[0] if problem.gates else None),
        len(flight.times),
    )
    last = rows(tallies, lambda leaf: iter(leaf[:, -1].tolist()))
    return tuple(tally_score(tally, problem, each) for tally, each in zip(last, flight.vehicles, strict=True))


def _every(rate: float, log_rate: float | None) -> int:
    """How many ticks there are from one row of the log to the next."""
    if log_rate is None:
        return 1
    every = rate / log_rate if log_rate > 0.0 else 0.0
    if not (every >= 1.0 and abs(every - round(every)) < 1e-6 * every):
        raise SpecError(f"log_rate must be rate ({rate:g}) over a whole number, got {log_rate}")
    return round(every)


def _flight(
    series: Row, times: Array, setpoint: Setpoint, flown: Sequence[Vehicle], batch: bool, engine: str
) -> Flight:
    states = body_states(series.motion.body)
    thrusts, commands = joined(series.motion.thrusts), joined(series.commands.thrusts)
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
        setpoint=rows_of(setpoint, slice(ends.max() + 1)),
        commands=kept(commands),
        thrusts=kept(thrusts),
        saturated=kept(series.commands.saturated),
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
            ends.append(k if fine[k] else k - 1)
            outcomes.append(divergence(float(times[k]), bool(fine[k])))
    return np.array(ends), tuple(outcomes)
