"""inspect_flight(): the causes of a recorded flight's error, by what its log shows."""

from __future__ import annotations

from types import MappingProxyType

from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.flatness import vehicle_of
from aerobat.planning import Plan
from aerobat.simulation import Flight
from aerobat.studies.inspection.alignment import aligned
from aerobat.studies.inspection.disturbances import PositionLoop, command_delay, disturbances
from aerobat.studies.inspection.inner_loop import inner_loop_fault
from aerobat.studies.inspection.responses import responses
from aerobat.studies.inspection.result import Inspection
from aerobat.vehicle import Vehicle
from aerobat.vehicle.controller import Controller

FEWEST = 10  # rows of a log in which anything can be seen
NOTICED = 0.002  # [s] of delay that is more than the rotors' lags leave uncertain


@validated
def inspect_flight(
    flight: Flight,
    plan: Plan,
    vehicle: Vehicle | str | None = None,
    controller: Controller | None = None,
) -> Inspection:
    """Tell apart by its causes the position error of a flight.

    The flight's acceleration differs from what its controller would have had it do by what the observer saw
    wrongly, what rotors and attitude did not deliver, and what the vehicle's model leaves out. Each, and the
    start's offset, is carried through the closed position loop; the errors that come of it add up to the
    flight's own. Where an inner loop held the rates, its commands are compared with those of its model.

    Raises SpecError for a batch, for a log too short, and for one that is not of the plan.

    Args:
        flight: The log of one flight.
        plan: What was flown; the log's clock and axes may be others than the plan's.
        vehicle: The vehicle that it was flown for, or its name, by default the plan's.
        controller: Of the flight, by default the vehicle's.
    """
    if flight.is_batch:
        raise SpecError("flight: inspect takes one flight at a time; of a batch, inspect flight[k]")
    if len(flight.times) < FEWEST:
        raise SpecError(
            f"flight: it has {len(flight.times)} rows; a log needs at least {FEWEST} to be inspected"
        )
    nominal = vehicle_of(plan, vehicle)
    if len(nominal.rotors) != flight.thrusts.shape[-1]:
        raise SpecError(
            f"vehicle: {nominal.name} has {len(nominal.rotors)} rotors and the flight "
            f"{flight.thrusts.shape[-1]}; name the vehicle that was flown"
        )
    alignment = aligned(flight, plan.trajectory)
    loop = PositionLoop.of(controller or nominal.controller, nominal, flight)
    delay = command_delay(flight, nominal)
    causes = disturbances(flight, nominal, loop)
    error = flight.position - flight.setpoint_position
    rate = flight.velocity - flight.setpoint_velocity
    unsaturated = "delay" if delay > NOTICED else "gains"
    fault = inner_loop_fault(flight, nominal)
    named = None if fault is None else fault.cause
    errors = responses(flight.times, (error[0], rate[0]), causes, loop, unsaturated, named)
    return Inspection(
        times=flight.times,
        error=error,
        errors=MappingProxyType(errors),
        delay=delay,
        saturated=float(flight.saturated.mean()),
        observed=flight.is_observed,
        alignment=alignment,
        fault=fault,
    )
