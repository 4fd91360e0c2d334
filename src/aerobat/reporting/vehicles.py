"""Facts of vehicles, with doubts about their numbers, and facts of problems."""

from __future__ import annotations

from collections.abc import Iterator
from math import tau

import numpy as np

from aerobat.control.parameters import hover_authority, max_bandwidth
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem import Problem
from aerobat.reporting.facts import Fact, Facts, facts, line
from aerobat.simulation.outcome import length
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import Rotor, Vehicle, implausibilities
from aerobat.vehicle.fleet import Fleet

MIN_THRUST_TO_WEIGHT = 1.5  # [-] with less, hardly any thrust is left for maneuvers
MAX_HOVER = 0.7  # [-] of a rotor's thrust in a hover; with more, little is left for rotation
MIN_BANDWIDTH = 5.0  # [rad/s] of the attitude loop; a vehicle with less falls while it turns
_NAMED = 1e-6  # [m] distance from an axis below which a rotor is on neither side


@facts.register
def _(vehicle: Vehicle) -> Iterator[Fact]:
    yield Fact("name", vehicle.name, vehicle.name, " ".join(vehicle.description.split()) or "a vehicle")
    moments = np.diag(vehicle.inertia).tolist()
    diagonal = ", ".join(f"{moment:.3g}" for moment in moments)
    yield Fact("mass_kg", vehicle.mass, "mass", f"{vehicle.mass:.4g} kg, inertia {diagonal} kg·m²")
    yield Fact("inertia_kg_m2", moments)
    places = ", ".join(map(_place, vehicle.rotors))
    yield Fact("rotors", len(vehicle.rotors), "rotors", f"{len(vehicle.rotors)}: {places}")
    each = f"up to {vehicle.max_thrusts.max():.4g} N each"
    thrust = f"{vehicle.thrust_to_weight:.2f} times the weight, {each}"
    yield Fact("thrust_to_weight", vehicle.thrust_to_weight, "thrust", thrust)
    body = (2.0 * vehicle.bounding_ellipsoid.semi_axes).tolist()
    yield Fact("body_m", body, "body", f"{' x '.join(map(length, body))} with its propellers")
    lag = float(vehicle.lags.max())
    yield Fact("lag_s", lag, "lag", f"{1e3 * lag:.3g} ms of the slowest rotor")
    doubts = list(implausibilities(vehicle))
    grounded = "" if vehicle.dead_rotors else _why_grounded(vehicle)
    if grounded:
        doubts.append(grounded)
    elif not vehicle.dead_rotors:
        hover = _hover(vehicle)
        yield Fact("hover", hover, "hover", f"at {100 * hover:.0f} % of the most loaded rotor's thrust")
        fleet, environment = Fleet.of([vehicle]), Environment()
        turns = hover_authority(fleet, environment)[0]
        roll, pitch, yaw = (f"{each:.3g}" for each in turns)
        text = f"at up to {roll}, {pitch} and {yaw} rad/s² in roll, pitch and yaw from a hover"
        yield Fact("turns_rad_s2", turns, "turns", text)
        bandwidth = float(max_bandwidth(fleet, environment)[0])
        text = f"up to {bandwidth:.3g} rad/s, {bandwidth / tau:.2g} Hz"
        yield Fact("attitude_loop_rad_s", bandwidth, "attitude loop", text)
        doubts += _weaknesses(vehicle, hover, bandwidth)
    yield from (line("looks wrong", doubt, style="red") for doubt in doubts)
    # an array: an empty tuple would be a table without rows
    yield Fact("doubts", np.array(doubts, dtype=object), "looks wrong", "" if doubts else "nothing")


@facts.register
def _(problem: Problem) -> Iterator[Fact]:
    yield Fact("problem", problem.name, "problem")
    yield Fact("description", problem.description, "what it is")


def vehicle_row(vehicle: Vehicle) -> Facts:
    """Return the facts of a vehicle in a list of many."""
    return Facts(
        (
            Fact("vehicle", vehicle.name, "vehicle"),
            Fact("mass_kg", vehicle.mass, "mass", unit="kg", form=".3g"),
            Fact("rotors", len(vehicle.rotors), "rotors"),
            Fact("thrust_to_weight", vehicle.thrust_to_weight, "thrust/weight", form=".2f"),
            Fact("description", vehicle.description, "what it is"),
        )
    )


def _weaknesses(vehicle: Vehicle, hover: float, bandwidth: float) -> Iterator[str]:
    """Yield a sentence for each property that leaves a vehicle little thrust or bandwidth to maneuver."""
    if vehicle.thrust_to_weight < MIN_THRUST_TO_WEIGHT:
        yield (
            f"max_thrust adds up to {vehicle.thrust_to_weight:.2f} times the weight: little is left to "
            "maneuver by; is it that of one rotor, in N?"
        )
    if hover > MAX_HOVER:
        yield f"a hover takes {100 * hover:.0f} % of a rotor's thrust: little is left to turn by"
    if not bandwidth >= MIN_BANDWIDTH:
        yield (
            f"the attitude loop has {bandwidth:.2g} rad/s at most: slow for flips; are inertia, "
            "position_body and lag those of this vehicle?"
        )


def _why_grounded(vehicle: Vehicle) -> str:
    """Return why a vehicle cannot hover, a sentence; empty where it can."""
    try:
        vehicle.require_hover(STANDARD_GRAVITY)
    except SpecError as error:
        return str(error)
    return ""


def _hover(vehicle: Vehicle) -> float:
    """Return the largest fraction of a rotor's thrust that a level hover takes [-]."""
    hover = vehicle.mass * STANDARD_GRAVITY * vehicle.mixer[:, 0]
    return float((hover / vehicle.max_thrusts).max())


def _place(rotor: Rotor) -> str:
    """Return the place of a rotor, as seen from the vehicle, and its sense of rotation."""
    x, y, _ = rotor.position_body.tolist()
    along = "front" if x > _NAMED else "back" if x < -_NAMED else ""
    aside = "left" if y > _NAMED else "right" if y < -_NAMED else ""
    turn = "counter-clockwise" if rotor.spin > 0 else "clockwise"
    return f"{' '.join(filter(None, (along, aside))) or 'middle'} {turn}"
