"""fly(): one or many vehicles along a plan's trajectory, in simulation; reference → control → plant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.engines import logged_ticks
from aerobat.engines.pytree import from_components, tree_map
from aerobat.environment import Environment
from aerobat.flatness import Planned
from aerobat.problem.gate import Gate
from aerobat.simulation.bodies import body_states
from aerobat.simulation.components import LogRow, log_row
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.flight import SERIES, Flight, setpoint_series
from aerobat.simulation.outcome import DIVERGENCE_RADIUS, Outcome, length
from aerobat.simulation.plants.outside import fly_outside
from aerobat.simulation.prepare import setup_of
from aerobat.simulation.setup import FlightSetup
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@validated
def fly(
    plan: Planned | Trajectory,
    vehicle: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Unpack[FlightChanges],
) -> Flight:
    """Fly a plan in the nonlinear simulation (paper, Sections III and IV-A).

    One vehicle, or a batch: a sequence of vehicles with as many rotors each, a `start` with a leading axis,
    or `flights` under `conditions`. Each vehicle flies as it would alone: flight k of a seed is the same in
    batch. A flight ends when it diverges (5 m position error, or a state that is not finite); this is its
    outcome, not an error.

    Args:
        plan: the plan or trajectory to fly; a bare trajectory needs a vehicle.
        vehicle: the vehicle or vehicles that fly, or their names, by default the plan's.
        environment: the surroundings, by default the problem's; for a bare trajectory a calm day on Earth.
        config: the settings of the flight.
        changes: fields of FlightConfig that replace those of `config`, as `seed=3`.

    Raises SpecError for arguments that do not fit together, BackendMissing for an engine that is not
    installed.
    """
    setup = setup_of(plan, vehicle, environment, config.changed(changes))
    outside = [each.kind for each in (setup.config.autopilot, setup.config.plant) if each is not None]
    if outside:
        gates = () if isinstance(plan, Trajectory) else plan.problem.gates
        return _flown_outside(setup, gates, " on ".join(outside))
    log, _ = setup.scan(log_row, setup.log_stride)
    return _flight(setup, log, setup.engine().name)


def _flown_outside(setup: FlightSetup, gates: tuple[Gate, ...], name: str) -> Flight:
    rows, contact = fly_outside(setup, gates)
    logged = logged_ticks(len(setup.times), setup.log_stride)
    log = tree_map(lambda leaf: leaf[..., logged], rows)
    touched = None
    if setup.config.plant is not None:
        touched = np.maximum.reduceat(contact, logged).astype(np.float64)[None]
    return _flight(setup, log, name, touched)


def _flight(setup: FlightSetup, log: LogRow, engine: str, contact: Array | None = None) -> Flight:
    logged = logged_ticks(len(setup.times), setup.log_stride)
    times = setup.times[logged]
    series: dict[str, Any] = {
        **setpoint_series(setup.reference.setpoint(logged)),
        **vars(body_states(log.motion.body)),
        "thrusts": from_components(log.motion.thrusts),
        "commands": from_components(log.commands.thrusts),
        "saturated": log.commands.saturated,
    }
    if log.observed:
        body = body_states(log.observed.body)
        series |= {
            "observed_position": body.position,
            "observed_velocity": body.velocity,
            "observed_q_world_body": body.q_world_body,
            "since_pose": log.observed.since_pose,
        }
    if log.rate_setpoint:
        series["rate_setpoint"] = from_components(log.rate_setpoint.omega)
        series["thrust_setpoint"] = log.rate_setpoint.thrust
    if contact is not None:
        series["contact"] = contact
    ends, outcomes, sentences = _endings(series, times)
    rows = ends.max() + 1
    # a diverged vehicle repeats its last row for as long as another one flies
    shown = np.minimum(np.arange(rows), ends[:, None])
    series |= {
        "min_thrusts": setup.fleet.min_thrusts,
        "max_thrusts": setup.fleet.max_thrusts,
        "ends": times[ends],
    }
    for one in SERIES:
        if one.name not in series:
            continue
        values = series[one.name]
        if one.per_vehicle and one.over_time:
            values = values[:, :rows] if (ends == ends.max()).all() else _taken(values, shown)
        elif one.over_time:
            values = values[:rows]
        series[one.name] = values[0] if one.per_vehicle and not setup.is_batch else values
    return Flight(
        times=times[:rows],
        series=series,
        vehicles=setup.fleet.names,
        outcomes=outcomes,
        sentences=sentences,
        engine=engine,
        environment=setup.environment,
    )


def _taken(values: Array, shown: NDArray[np.intp]) -> Array:
    index = shown.reshape(*shown.shape, *(1,) * (values.ndim - 2))
    return np.take_along_axis(values, index, axis=1)


def _endings(
    series: dict[str, Array], times: Array
) -> tuple[NDArray[np.intp], tuple[Outcome, ...], tuple[str, ...]]:
    """Return the last row of each vehicle, its outcome, and the outcome as a sentence."""
    finite: Any = np.logical_and.reduce(
        [
            np.isfinite(series[name]).all(axis=-1)
            for name in ("position", "velocity", "q_world_body", "omega_body", "thrusts", "commands")
        ]
    )
    with np.errstate(over="ignore", invalid="ignore"):
        distance = np.linalg.norm(series["position"] - series["setpoint_position"], axis=-1)
    fine = finite & (distance <= DIVERGENCE_RADIUS)
    ends, outcomes, sentences = [], [], []
    for vehicle in range(len(fine)):
        k = int(np.argmin(fine[vehicle]))  # the first bad row, if there is one
        outcome = Outcome.COMPLETE
        if not fine[vehicle, k]:
            outcome = Outcome.DIVERGED if finite[vehicle, k] else Outcome.STATE_NOT_FINITE
        last = {Outcome.COMPLETE: len(times) - 1, Outcome.DIVERGED: k, Outcome.STATE_NOT_FINITE: k - 1}
        ends.append(max(last[outcome], 0))
        outcomes.append(outcome)
        worst = float(distance[vehicle, : ends[-1] + 1].max())
        sentences.append(outcome.sentence(time=float(times[ends[-1]]), error=length(worst)))
    return np.array(ends), tuple(outcomes), tuple(sentences)
