"""prepare(): the setup of a flight, with its vehicles, start and controller, before it is flown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np

from aerobat import so3
from aerobat.arrays import frozen
from aerobat.declaration import validated
from aerobat.environment import Environment, dispersion_names
from aerobat.errors import SpecError
from aerobat.flatness import Planned, environment_of, vehicle_of
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.bodies import bodies
from aerobat.simulation.components import ControllerParameters, StateObserver
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.law_controller import controller_component, inner_loop
from aerobat.simulation.loop import LoopPart
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.simulation.setup import FlightSetup, controller_model, plant_part
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle, as_vehicle, vehicle_names
from aerobat.vehicle.fleet import Fleet


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
    return setup_of(plan, vehicle, environment, config)


def setup_of(
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
    if config.conditions is not None:
        from aerobat.simulation.conditions.setup import dispersed_setup  # sensors, wind, a filter

        return dispersed_setup(plan, vehicles[0], environment, config, config.conditions)
    flying, nominal = _broadcast_vehicles(vehicles, config)
    is_batch = is_fleet or _batch_of(config.start) != ()
    reference = ReferenceSource(as_trajectory(plan), nominal[0], environment, config.rate)
    fleet = Fleet.of(flying)
    nominal_fleet = fleet if nominal is flying else Fleet.of(nominal)
    controller = config.controller_of(nominal)
    model = controller_model(controller, nominal, nominal_fleet, environment)
    return FlightSetup(
        start=_start(config.start, reference, len(fleet)),
        parts=(
            LoopPart(StateObserver()),
            LoopPart(controller_component(config.law, controller), ControllerParameters(model, ())),
            *inner_loop(config.law, model),
            plant_part(fleet, environment, config.rate),
        ),
        reference=reference,
        fleet=fleet,
        nominal=nominal_fleet,
        environment=environment,
        config=config,
        controller=controller,
        is_batch=is_batch,
    )


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
