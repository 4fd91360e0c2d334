"""inspect_flight(): the causes of a recorded flight's position error, identified from its log."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from scipy.linalg import expm

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.flatness import vehicle_of
from aerobat.planning import Plan
from aerobat.simulation import Flight
from aerobat.studies.inspection.alignment import aligned
from aerobat.studies.inspection.body import body_fault
from aerobat.studies.inspection.disturbances import (
    Disturbances,
    PositionLoop,
    ShortfallCause,
    command_delay,
    disturbances,
)
from aerobat.studies.inspection.inner_loop import inner_loop_fault
from aerobat.studies.inspection.result import Inspection
from aerobat.studies.inspection.rotors import rotor_fault
from aerobat.vehicle import Vehicle
from aerobat.vehicle.controller import Controller

_MIN_FEEDBACK = 1e-3  # [m/s²] feedback below this is rounding
NAMES = ("start", "hand-off", "vehicle", "saturation", "delay", "gains")  # causes in every flight
MIN_ROWS = 10  # fewest rows of a log that can be inspected
MIN_DELAY = 0.002  # [s] smallest delay beyond the uncertainty of the rotors' lags


def responses(
    times: Array,
    start: tuple[Array, Array],
    found: Disturbances,
    loop: PositionLoop,
    unsaturated: str,
    fault: str | None,
) -> dict[str, Array]:
    """Return the errors [m] by cause, (T, 3) each.

    Acceleration missing in a saturation that the plan did not cause is assigned to the cause with the largest
    error when the saturation began, since the controller responded to that error. If the inner loop has a
    fault, all missing acceleration is assigned to the fault, except where the plan exceeded the limits.

    Args:
        times: Of the rows [s], (T,).
        start: The error of position [m] and of velocity [m/s] in the first row, (3,) each.
        found: Accelerations held between rows.
        loop: The position loop.
        unsaturated: The cause, of NAMES, of acceleration missing without a saturation.
        fault: The cause that is the inner loop's fault, if it has one.
    """
    names = NAMES if fault is None else (*NAMES, fault)
    state = np.zeros((3, len(names), 3))  # position, velocity, integral
    state[0, 0], state[1, 0] = start
    errors = [state[0]]
    durations = np.round(np.diff(times), 9)  # so that equal rows share a step
    steps = {float(h): _step(float(h), loop) for h in np.unique(durations)}
    usual = names.index(fault or unsaturated)
    responsible, before = usual, ShortfallCause.UNSATURATED
    for row, h in enumerate(durations):
        kind = ShortfallCause(found.kinds[row])
        if kind is not before:
            is_faults = fault is not None and kind is ShortfallCause.BY_FEEDBACK
            responsible = usual if is_faults else _cause(kind, state, loop, usual)
        before = kind
        push = np.zeros((len(names), 3))
        push[names.index("hand-off")] = found.observer[row]
        push[names.index("vehicle")] = found.vehicle[row]
        push[responsible] += found.missing[row]
        forward, gain = steps[float(h)]
        state = np.einsum("ij,jck->ick", forward, state) + gain[:, None, None] * push
        errors.append(state[0])
    series = np.stack(errors)
    return {name: series[:, k] for k, name in enumerate(names)}


def _cause(kind: ShortfallCause, state: Array, loop: PositionLoop, unsaturated: int) -> int:
    """Return the index of the cause of the acceleration missing from now on."""
    if kind is ShortfallCause.BY_PLAN:
        return NAMES.index("saturation")
    if kind is ShortfallCause.UNSATURATED:
        return unsaturated
    off, rate = np.linalg.norm(state[:2], axis=-1)
    sizes = loop.position * off + loop.velocity * rate
    return int(np.argmax(sizes)) if sizes.max() > _MIN_FEEDBACK else unsaturated


def _step(h: float, loop: PositionLoop) -> tuple[Array, Array]:
    """Return A and b of the closed loop over one row: x → A x + b d."""
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[1, 3] = rates[2, 0] = 1.0
    rates[1, :3] = -loop.position, -loop.velocity, -loop.integral
    whole = expm(h * rates)
    return whole[:3, :3], whole[:3, 3]


@validated
def inspect_flight(
    flight: Flight,
    plan: Plan,
    vehicle: Vehicle | str | None = None,
    controller: Controller | None = None,
) -> Inspection:
    """Split the position error of a flight into its causes.

    The flight's acceleration differs from the controller's command for three reasons: estimation errors,
    acceleration that rotors and attitude did not deliver, and errors of the vehicle's model. Each of these,
    and the initial error, is propagated through the closed position loop; the resulting errors add up to the
    flight's error. With an inner loop, its commands are compared with those of its model.

    Raises SpecError for a batch, for a log that is too short, and for a log of another plan.

    Args:
        flight: The log of one flight.
        plan: The plan that was flown; the log may have another clock and other axes.
        vehicle: The vehicle that the flight was configured for, or its name, by default the plan's.
        controller: The controller settings of the flight, by default the vehicle's.
    """
    if flight.is_batch:
        raise SpecError("flight: inspect takes one flight at a time; of a batch, inspect flight[k]")
    if len(flight.times) < MIN_ROWS:
        raise SpecError(
            f"flight: it has {len(flight.times)} rows; a log needs at least {MIN_ROWS} to be inspected"
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
    unsaturated = "delay" if delay.time > MIN_DELAY else "gains"
    fault = (
        inner_loop_fault(flight, nominal)
        or rotor_fault(flight, nominal, delay)
        or body_fault(flight, nominal, causes.vehicle)
    )
    named = None if fault is None else fault.cause
    errors = responses(flight.times, (error[0], rate[0]), causes, loop, unsaturated, named)
    return Inspection(
        times=flight.times,
        error=error,
        errors=MappingProxyType(errors),
        delay=delay.time,
        saturated=float(flight.saturated.mean()),
        observed=flight.is_observed,
        alignment=alignment,
        fault=fault,
    )
