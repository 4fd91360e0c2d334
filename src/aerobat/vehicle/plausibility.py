"""Warnings about values that a vehicle could have but hardly has, most often because of a wrong unit.

Nothing is rejected here. Each threshold is beyond what is built, for the reason in its comment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import hypot, inf, log, radians, sqrt

import numpy as np

from aerobat.declaration import validated
from aerobat.errors import SpecError
from aerobat.vehicle.files import as_vehicle
from aerobat.vehicle.rotor import Rotor
from aerobat.vehicle.vehicle import Vehicle

MAX_GYRATION = 1.0  # [-] radius of gyration over the reach of arm and propeller: 1 if all mass is at the tips
MIN_GYRATION = 0.03  # [-] over the arm: motors alone, a fifth of the mass at the arms' ends, give 0.3
MAX_BODY_RATE = 100.0  # [rad/s] gyros read up to 70, as 4000°/s
MAX_THRUST_TO_WEIGHT = 40.0  # [-] record racers reach 25
MIN_THRUST_TO_WEIGHT = 0.1  # [-] on Earth: too little even for the Moon
TYPICAL_GYRATION = 0.35  # [-] over the reach, to choose between units that are all plausible
TYPICAL_BODY_RATE = 15.0  # [rad/s]

LENGTHS = (("mm", 1e-3), ("cm", 1e-2), ("inches", 0.0254))
TIMES = (("ms", 1e-3), ("µs", 1e-6))
INERTIAS = (("g·m²", 1e-3), ("kg·cm²", 1e-4), ("kg·mm²", 1e-6), ("g·cm²", 1e-7), ("g·mm²", 1e-9))
RATES = (("°/s", radians(1.0)), ("rpm", radians(6.0)))
Units = Sequence[tuple[str, float]]  # names of units, each with its size in the SI unit


@dataclass(frozen=True)
class _Check:
    """A length or a time of a rotor, its largest plausible value, and a typical one to choose units by."""

    field: str
    value: float
    most: float
    typical: float
    unit: str
    units: Units


@validated
def implausibilities(vehicle: Vehicle | str) -> tuple[str, ...]:
    """Return a sentence for each kind of implausible value, with the unit that was probably meant."""
    vehicle = as_vehicle(vehicle)
    found = (*_of_dead_rotors(vehicle), *_of_rotors(vehicle.rotors), *_of_inertia(vehicle))
    return (*found, *_of_thrust(vehicle), *_of_body_rate(vehicle.max_body_rate))


def _of_dead_rotors(vehicle: Vehicle) -> Iterator[str]:
    """Yield a sentence on the dead rotors and the control that remains."""
    if not vehicle.dead_rotors:
        return
    try:
        flying = vehicle.without_dead_rotors()
    except SpecError as error:
        yield str(error).removeprefix(f"vehicle '{vehicle.name}': ")
        return
    names = ", ".join(f"rotors[{i}]" for i in vehicle.dead_rotors)
    yield (
        f"max_thrust of {names} is 0: {len(flying.rotors)} others still give thrust, roll, pitch and yaw; "
        "plans and reports count them by themselves"
    )


def _of_rotors(rotors: Sequence[Rotor]) -> Iterator[str]:
    """Yield one sentence for each kind of implausible value, about the first rotor that has one."""
    for checks in zip(*map(_checks, rotors), strict=True):
        for i, check in enumerate(checks):
            if check.value > check.most:
                remedy = _remedy(check.value, (0.0, check.most), check.typical, check.units)
                yield (
                    f"rotors[{i}].{check.field} is {check.value:.4g} {check.unit}, where {check.most:.3g} "
                    f"would be a lot; {remedy}"
                )
                break


def _checks(rotor: Rotor) -> tuple[_Check, ...]:
    """Return all checks of one rotor."""
    arm, radius, torque = _arm(rotor), rotor.radius, rotor.torque_coefficient
    return (
        # the largest passenger multirotors have rotors 5 m from their centre
        _Check("position_body", arm, 10.0, 0.2, "m from the centre", LENGTHS),
        # propellers of a metre and more take 0.3 s; with more lag no vehicle hovers stably
        _Check("lag", rotor.lag, 1.0, 0.03, "s", TIMES),
        # neighbours on a cross touch at 0.7 of the arm; at 2 all propellers overlap
        _Check("radius", radius, 2.0 * arm, 0.6 * arm, "m", LENGTHS),
        # c/R is the ratio C_Q/C_T, often 0.05 to 0.3; Section V of the paper has 8
        _Check("torque_coefficient", torque, 10.0 * radius, 0.1 * radius, "m", LENGTHS),
    )


def _of_inertia(vehicle: Vehicle) -> Iterator[str]:
    mass, largest = vehicle.mass, float(np.linalg.eigvalsh(vehicle.inertia)[-1])
    arm = max(map(_arm, vehicle.rotors))
    reach = arm + max(rotor.radius for rotor in vehicle.rotors)
    low, high = mass * (MIN_GYRATION * arm) ** 2, mass * (MAX_GYRATION * reach) ** 2
    if not low <= largest <= high:
        remedy = _remedy(largest, (low, high), mass * (TYPICAL_GYRATION * reach) ** 2, INERTIAS)
        yield (
            f"inertia of {largest:.3g} kg·m² is that of {mass:g} kg at {sqrt(largest / mass):.3g} m from the "
            f"centre, where the rotors reach {reach:.3g} m; {remedy}"
        )


def _of_thrust(vehicle: Vehicle) -> Iterator[str]:
    if vehicle.thrust_to_weight > MAX_THRUST_TO_WEIGHT:
        yield (
            f"max_thrust adds up to {vehicle.thrust_to_weight:.3g} times the weight of mass, "
            f"{vehicle.mass:g} kg; is mass in kg, and max_thrust in N, not in grams of force?"
        )
    elif vehicle.thrust_to_weight < MIN_THRUST_TO_WEIGHT:
        yield (
            f"max_thrust adds up to {vehicle.thrust_to_weight:.2g} of the weight of mass, {vehicle.mass:g} "
            "kg; is mass in kg, max_thrust in N, k_f in N/(rad/s)², not N/rpm², max_rpm in rpm, not rad/s?"
        )


def _of_body_rate(most: float) -> Iterator[str]:
    if MAX_BODY_RATE < most < inf:
        remedy = _remedy(most, (0.0, MAX_BODY_RATE), TYPICAL_BODY_RATE, RATES)
        yield f"max_body_rate is {most:.4g} rad/s, where {MAX_BODY_RATE:.3g} would be a lot; {remedy}"


def _remedy(value: float, limits: tuple[float, float], typical: float, units: Units) -> str:
    """Return a question whether the value was typed in another unit, the one nearest to typical values."""
    low, high = limits
    plausible = {name: value * size for name, size in units if low < value * size <= high}
    if not plausible:
        return "check its unit"
    likely = min(plausible, key=lambda name: abs(log(plausible[name] / typical)))
    return f"was it typed in {likely}?"


def _arm(rotor: Rotor) -> float:
    """The distance [m] of a rotor from the centre of mass."""
    return hypot(*rotor.position_body.tolist())
