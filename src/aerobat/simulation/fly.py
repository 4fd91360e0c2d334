"""prepare() and fly(): the setup of a flight along a plan, and the flight in the nonlinear simulation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.declaration import validated
from aerobat.engines import logged_ticks
from aerobat.engines.pytree import from_components, tree_map
from aerobat.environment import Environment, dispersion_names
from aerobat.errors import SpecError
from aerobat.flatness import Planned, environment_of, vehicle_of
from aerobat.kernels.rigid_body import Body
from aerobat.problem.gate import Gate
from aerobat.simulation.bodies import bodies, body_states
from aerobat.simulation.components import LogRow, log_row
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.flight import SERIES, Flight, setpoint_series
from aerobat.simulation.outcome import DIVERGENCE_RADIUS, Outcome, length
from aerobat.simulation.plants.outside import fly_outside
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.simulation.setup import FlightSetup, Realization, controller_model
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle, as_vehicle, vehicle_names
from aerobat.vehicle.fleet import Fleet


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
    setup = _setup_of(plan, vehicle, environment, config.changed(changes))
    outside = [each.kind for each in (setup.config.autopilot, setup.config.plant) if each is not None]
    if outside:
        return _flown_outside(setup, _gates(plan), " on ".join(outside))
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


@validated
def prepare(
    plan: Planned | Trajectory,
    vehicle: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Unpack[FlightChanges],
) -> FlightSetup:
    """Return the setup of a flight, to be stepped, cut or branched at will: `loop = prepare(plan).compile()`.

    Then `carry = loop.init(setup.first_tick)` and, for each tick k,
    `carry, row = loop.step(carry, setup.tick(k))`.

    Args:
        plan: the plan or trajectory to fly; a bare trajectory needs a vehicle.
        vehicle: the vehicle or vehicles that fly, or their names, by default the plan's.
        environment: the surroundings, by default the problem's; for a bare trajectory a calm day on Earth.
        config: the settings of the flight.
        changes: fields of FlightConfig that replace those of `config`, as `seed=3`.

    Raises SpecError for arguments that do not fit together, and for a `plant` or an `autopilot`, which cannot
    be stepped.
    """
    config = config.changed(changes)
    for name, outside in (("plant", config.plant), ("autopilot", config.autopilot)):
        if outside is not None:
            raise SpecError(f"{name}: '{outside.kind}' is not stepped; give it to fly(), or leave it out")
    return _setup_of(plan, vehicle, environment, config)


def _setup_of(
    plan: Planned | Trajectory,
    vehicle: Vehicle | str | Sequence[Vehicle | str] | None,
    environment: Environment | None,
    config: FlightConfig,
) -> FlightSetup:
    """Return the setup of a flight from `prepare`'s arguments; an external plant or autopilot is allowed."""
    if isinstance(vehicle, str) and vehicle in dispersion_names() and vehicle not in vehicle_names():
        raise SpecError(f"{vehicle!r} are conditions, not a vehicle; give conditions={vehicle!r}")
    environment = environment_of(plan, environment)
    if vehicle is None or isinstance(vehicle, Vehicle | str):
        vehicles, is_fleet = [vehicle_of(plan, vehicle)], False
    elif config.conditions is None:
        vehicles, is_fleet = [as_vehicle(each) for each in vehicle], True
    else:
        raise SpecError(
            "vehicle must be one where there are conditions, which draw what really flies from it"
        )
    flying, nominal = _broadcast_vehicles(vehicles, config)
    fleet = Fleet.of(flying)
    known = fleet if nominal is flying else Fleet.of(nominal)
    controller = config.controller_of(nominal)
    model = controller_model(controller, nominal, known, environment)
    reference = ReferenceSource(as_trajectory(plan), nominal[0], environment, config.rate)
    if config.conditions is None:
        real = Realization(reference, fleet, _start(config.start, reference, len(fleet)))
        is_batch = is_fleet or _batch_of(config.start) != ()
    else:
        from aerobat.simulation.conditions.realization import realization  # sensors, wind, a filter

        real = realization(config.conditions, reference, _gates(plan), config, model)
        is_batch = config.flights is not None
    return FlightSetup(
        start=real.start,
        parts=real.parts(config.law, controller, model),
        reference=real.reference,
        fleet=real.fleet,
        nominal=known,
        environment=environment,
        config=config,
        controller=controller,
        is_batch=is_batch,
    )


def _gates(plan: Planned | Trajectory) -> tuple[Gate, ...]:
    return () if isinstance(plan, Trajectory) else plan.problem.gates


def _batch_of(start: BodyState | None) -> tuple[int, ...]:
    return () if start is None else np.shape(start.position)[:-1]


def _broadcast_vehicles(flying: list[Vehicle], config: FlightConfig) -> tuple[list[Vehicle], list[Vehicle]]:
    """Return the vehicles that fly, one for each start, and the nominal ones."""
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
    drags = {tuple((each.drag_body[:2] / each.mass).tolist()) for each in flying}
    if config.nominal is None and len(drags) > 1:
        raise SpecError(
            "vehicle: vehicles that differ in drag per mass need different attitudes; fly them apart, "
            "or give one nominal vehicle for all"
        )
    return flying, nominal


def _start(start: BodyState | None, reference: ReferenceSource, vehicles: int) -> Body:
    if start is None:
        first = reference.start
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
