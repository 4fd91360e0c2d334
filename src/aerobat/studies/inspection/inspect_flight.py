"""inspect_flight(): the causes of a recorded flight's error, by what its log shows."""

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
from aerobat.studies.inspection.balance import balance_fault
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

_DIGITS = 9  # of a row's duration [s], so that rows alike are stepped alike
_ANSWERED = 1e-3  # [m/s²] of feedback, below which it answers nothing but rounding
NAMES = ("start", "hand-off", "vehicle", "saturation", "delay", "gains")  # of every flight
FEWEST = 10  # rows of a log in which anything can be seen
NOTICED = 0.002  # [s] of delay that is more than the rotors' lags leave uncertain


def responses(
    times: Array,
    start: tuple[Array, Array],
    found: Disturbances,
    loop: PositionLoop,
    unsaturated: str,
    fault: str | None = None,
) -> dict[str, Array]:
    """Errors [m] by their causes, (T, 3) each.

    What is missing in a saturation that the plan did not ask for goes to the cause whose error was the
    largest when it began: that error is what the controller was answering. Where the inner loop has a fault,
    all that is missing goes to it, but for what the plan asked too much.

    Args:
        times: Of the rows [s], (T,).
        start: The error of position [m] and of velocity [m/s] in the first row, (3,) each.
        found: Accelerations held between rows.
        loop: The position loop.
        unsaturated: The cause of what is missing without a saturation, of NAMES.
        fault: The cause that is the inner loop's, if it has a fault.
    """
    names = NAMES if fault is None else (*NAMES, fault)
    state = np.zeros((3, len(names), 3))  # position, velocity, integral
    state[0, 0], state[1, 0] = start
    errors = [state[0]]
    durations = np.round(np.diff(times), _DIGITS)
    steps = {float(h): _step(float(h), loop) for h in np.unique(durations)}
    usual = names.index(fault or unsaturated)
    answered, before = usual, ShortfallCause.UNSATURATED
    for row, h in enumerate(durations):
        kind = ShortfallCause(found.kinds[row])
        if kind is not before:
            is_faults = fault is not None and kind is ShortfallCause.LED_TO
            answered = usual if is_faults else _cause(kind, state, loop, usual)
        before = kind
        push = np.zeros((len(names), 3))
        push[names.index("hand-off")] = found.observer[row]
        push[names.index("vehicle")] = found.vehicle[row]
        push[answered] += found.missing[row]
        forward, gain = steps[float(h)]
        state = np.einsum("ij,jck->ick", forward, state) + gain[:, None, None] * push
        errors.append(state[0])
    series = np.stack(errors)
    return {name: series[:, k] for k, name in enumerate(names)}


def _cause(kind: ShortfallCause, state: Array, loop: PositionLoop, unsaturated: int) -> int:
    """The number of the cause of what is missing from now on."""
    if kind is ShortfallCause.ASKED_BY_PLAN:
        return NAMES.index("saturation")
    if kind is ShortfallCause.UNSATURATED:
        return unsaturated
    off, rate = np.linalg.norm(state[:2], axis=-1)
    sizes = loop.position * off + loop.velocity * rate
    return int(np.argmax(sizes)) if sizes.max() > _ANSWERED else unsaturated


def _step(h: float, loop: PositionLoop) -> tuple[Array, Array]:
    """The closed loop over one row: x → A x + b d."""
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
    unsaturated = "delay" if delay.time > NOTICED else "gains"
    fault = (
        inner_loop_fault(flight, nominal)
        or rotor_fault(flight, nominal, delay)
        or balance_fault(flight, nominal)
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
