"""A vehicle for people: what it is, what it can do, and what looks wrong."""

from __future__ import annotations

from collections.abc import Iterator
from math import tau

import numpy as np
from rich.table import Table
from rich.text import Text

from aerobat.control.parameters import hover_authority, max_bandwidth
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.reporting.tables import Fact, facts_table
from aerobat.simulation.outcome import length
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import Rotor, Vehicle, implausibilities
from aerobat.vehicle.fleet import Fleet

MIN_THRUST_TO_WEIGHT = 1.5  # [-] with less, hardly any maneuver is left beside staying up
MAX_HOVER = 0.7  # [-] of a rotor's thrust in a hover; with more, nothing is left to turn by
MIN_BANDWIDTH = 5.0  # [rad/s] of the attitude loop: slower ones fall in the time in which they turn
_NAMED = 1e-6  # [m] from an axis, where a rotor is neither to one side nor to the other


def vehicle_table(vehicle: Vehicle) -> Table:
    """Return a vehicle's facts, one a row, and then what looks wrong."""
    doubts: list[Fact] = [("", Text(doubt, style="red")) for doubt in vehicle_doubts(vehicle)]
    facts: dict[str, list[Fact]] = {vehicle.name: list(_facts(vehicle))}
    facts["looks wrong"] = doubts or [("", "nothing")]
    return facts_table("", facts)


def vehicle_doubts(vehicle: Vehicle) -> tuple[str, ...]:
    """Return a sentence for each value that is hardly meant, and for each that leaves little to fly by."""
    return (*implausibilities(vehicle), *_weaknesses(vehicle))


def _facts(vehicle: Vehicle) -> Iterator[Fact]:
    if vehicle.description:
        yield "is", " ".join(vehicle.description.split())
    moments = ", ".join(f"{moment:.3g}" for moment in np.diag(vehicle.inertia))
    yield "mass", f"{vehicle.mass:.4g} kg, inertia {moments} kg·m²"
    yield "rotors", f"{len(vehicle.rotors)}: {', '.join(map(_place, vehicle.rotors))}"
    yield (
        "thrust",
        f"{vehicle.thrust_to_weight:.2f} times the weight, up to {vehicle.max_thrusts.max():.4g} N each",
    )
    body = " x ".join(length(2.0 * axis) for axis in vehicle.bounding_ellipsoid.semi_axes.tolist())
    yield "body", f"{body} with its propellers"
    yield "lag", f"{1e3 * float(vehicle.lags.max()):.3g} ms of the slowest rotor"
    if not vehicle.dead_rotors:
        yield "hover", f"at {100 * _hover(vehicle):.0f} % of the most loaded rotor's thrust"
        fleet, environment = Fleet.of([vehicle]), Environment()
        roll, pitch, yaw = hover_authority(fleet, environment)[0]
        yield (
            "turns",
            f"at up to {roll:.3g}, {pitch:.3g} and {yaw:.3g} rad/s² in roll, pitch and yaw from a hover",
        )
        bandwidth = float(max_bandwidth(fleet, environment)[0])
        yield "attitude loop", f"up to {bandwidth:.3g} rad/s, {bandwidth / tau:.2g} Hz"


def _weaknesses(vehicle: Vehicle) -> Iterator[str]:
    """What leaves a vehicle little or nothing to maneuver by."""
    if vehicle.dead_rotors:
        return
    try:
        vehicle.require_hover(STANDARD_GRAVITY)
    except SpecError as error:
        yield str(error)
        return
    if vehicle.thrust_to_weight < MIN_THRUST_TO_WEIGHT:
        yield (
            f"max_thrust adds up to {vehicle.thrust_to_weight:.2f} times the weight: little is left to "
            "maneuver by; is it that of one rotor, in N?"
        )
    if _hover(vehicle) > MAX_HOVER:
        yield f"a hover takes {100 * _hover(vehicle):.0f} % of a rotor's thrust: little is left to turn by"
    bandwidth = float(max_bandwidth(Fleet.of([vehicle]), Environment())[0])
    if not bandwidth >= MIN_BANDWIDTH:
        yield (
            f"the attitude loop has {bandwidth:.2g} rad/s at most: slow for flips; are inertia and "
            "position_body those of this vehicle?"
        )


def _hover(vehicle: Vehicle) -> float:
    """The largest part of a rotor's thrust that a level hover takes [-]."""
    hover = vehicle.mass * STANDARD_GRAVITY * vehicle.mixer[:, 0]
    return float((hover / vehicle.max_thrusts).max())


def _place(rotor: Rotor) -> str:
    """Where a rotor is, as seen by the vehicle, and how it spins."""
    x, y, _ = rotor.position_body.tolist()
    along = "front" if x > _NAMED else "back" if x < -_NAMED else ""
    aside = "left" if y > _NAMED else "right" if y < -_NAMED else ""
    turn = "counter-clockwise" if rotor.spin > 0 else "clockwise"
    return f"{' '.join(filter(None, (along, aside))) or 'middle'} {turn}"
