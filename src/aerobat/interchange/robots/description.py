"""Vehicles from robot descriptions, URDF and SDF, and the loss of the conversion.

All links together are one rigid body with joints at zero. The rotors are part of it, so their angular
momentum is lost. A rotor is at its link's centre of mass, pushes along the body's +z axis and turns about
it. Tilted rotors, and joints about another axis, are refused.

Of Gazebo's motor models, the largest thrust motorConstant · maxRotVelocity², momentConstant and
turningDirection are kept. The slower of the two time constants of the speed becomes the lag of the thrust.
The rotors' drag, rotorDragCoefficient, is kept as its slope in hover. Lost are rollingMomentCoefficient, the
effects of other plugins, sensors, and shapes except for the rotors' radii. A URDF has no thrusts unless it
has such plugins.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, degrees, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from aerobat.declaration import PathName, from_table, validated
from aerobat.documents import in_document, to_toml
from aerobat.errors import SpecError
from aerobat.interchange.robots.body import Link, Motor, Robot, merged
from aerobat.interchange.robots.markup import parse_xml
from aerobat.interchange.robots.sdf import read_sdf
from aerobat.interchange.robots.urdf import read_urdf
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import Vehicle

READERS = {"robot": read_urdf, "sdf": read_sdf}  # by the root's name
ROTOR_NAME = re.compile("rotor|prop", re.IGNORECASE)
MAX_TILT_DEG = 0.5  # of a rotor's axis, more than by rounding in a file
REQUIRED = {  # keys of a rotor, with their meanings
    "spin": "1 counter-clockwise seen from above, -1 clockwise",
    "max_thrust": "[N] at full throttle",
    "torque_coefficient": "[m] drag torque over thrust",
    "lag": "[s] time constant of the thrust",
    "radius": "[m] of the propeller",
}


@dataclass(frozen=True)
class VehicleDescription:
    """A vehicle, as far as a robot's file describes it."""

    table: dict[str, Any]  # as in a vehicle's file
    missing: tuple[str, ...]  # keys of rotors that the robot's file does not give
    notes: tuple[str, ...]  # sentences about the conversion

    def vehicle(self) -> Vehicle:
        """Return the vehicle. Raises SpecError where keys are missing or values are wrong."""
        if self.missing:
            raise SpecError(
                f"nothing is said of the rotors' {', '.join(self.missing)}; write a vehicle's file of it and "
                "add them: aerobat show FILE --out mine.toml"
            )
        return from_table(Vehicle, self.table)

    def toml(self) -> str:
        """Return the text of a vehicle's file, with comments on missing keys."""
        lines = [f"# {note}" for note in self.notes]
        lines += [f"# to be added, for each rotor or for all: {key}, {REQUIRED[key]}" for key in self.missing]
        return "\n".join([*lines, "", to_toml(self.table)])


@validated
def import_vehicle(path: PathName) -> Vehicle:
    """Return the vehicle that a URDF or SDF file describes; see `aerobat.interchange.robots` for the loss.

    Raises SpecError, one sentence that names the file, where it is malformed, describes no multirotor, or
    lacks properties of its rotors.
    """
    with in_document(Path(path), "robot"):
        return read_robot_description(path).vehicle()


@validated
def read_robot_description(path: PathName) -> VehicleDescription:
    """Return a vehicle as far as a URDF or SDF file describes it. Raises SpecError for a malformed file."""
    path = Path(path)
    root = parse_xml(path)
    if root.tag not in READERS:
        raise SpecError(f"its root is <{root.tag[:40]}>; a URDF's is <robot>, an SDF's <sdf>")
    with np.errstate(all="ignore"):  # overflow is refused by the checks of its results
        return _described(READERS[root.tag](root, path), path)


def _described(robot: Robot, path: Path) -> VehicleDescription:
    mass, centre, inertia = merged(robot.links)
    motors = {motor.link: motor for motor in robot.motors}
    rotors = _rotor_links(robot, motors)
    hover = sqrt(mass * STANDARD_GRAVITY / sum(m.k_f for m in motors.values())) if motors else 0.0  # [rad/s]
    drag = sum(motor.drag for motor in motors.values()) * hover
    defaults = _defaults(robot, mass, len(rotors))
    table: dict[str, Any] = {
        "name": robot.name,
        "description": f"imported from {path.name}",
        "mass": _rounded(mass),
        "inertia": _rounded(inertia if (inertia - np.diag(np.diag(inertia))).any() else np.diag(inertia)),
        "centre_of_mass": _rounded(centre),
    }
    if drag > 0.0:
        table["drag_body"] = _rounded(np.array([drag, drag, 0.0]))
    own = [_rotor(link, motors.get(link.name)) for link in rotors]
    shared = {key: value for key, value in own[0].items() if all(each.get(key) == value for each in own)}
    table["rotor_defaults"] = defaults | shared
    table["rotors"] = [{key: value for key, value in each.items() if key not in shared} for each in own]
    given = {*table["rotor_defaults"], *set.intersection(*map(set, own))}
    missing = tuple(key for key in REQUIRED if key not in given)
    return VehicleDescription(table, missing, (*robot.notes, *_notes(path, robot, hover, drag)))


def _rotor_links(robot: Robot, motors: dict[str, Motor]) -> Sequence[Link]:
    """Return the links with motors, in the motors' order, or else the links named after rotors."""
    links = {link.name: link for link in robot.links}
    for name in motors:
        if name not in links:
            raise SpecError(f"a motor model turns the link '{name}', which is not there")
    found = [links[name] for name in motors] or [link for link in robot.links if ROTOR_NAME.search(link.name)]
    if not found:
        raise SpecError("it has no motor model, and no link is named after a rotor or a propeller")
    for link in found:
        tilt = degrees(acos(np.clip(link.pose.rotation[2, 2], -1.0, 1.0)))
        turned = 0.0 if link.axis is None else degrees(acos(np.clip(abs(link.axis[2]), 0.0, 1.0)))
        if not max(tilt, turned) <= MAX_TILT_DEG:
            raise SpecError(
                f"the rotor '{link.name}' is tilted by {max(tilt, turned):.3g}°; all must push along the "
                "body's +z and turn about it"
            )
    return found


def _rotor(link: Link, motor: Motor | None) -> dict[str, Any]:
    found: dict[str, Any] = {"position_body": _rounded(link.centre)}
    if link.radius:
        found["radius"] = _rounded(link.radius)
    if motor is not None:
        found |= {
            "spin": motor.spin,
            "max_thrust": _rounded(motor.k_f * motor.max_speed * motor.max_speed),
            "torque_coefficient": motor.torque_coefficient,
            "lag": motor.lag,
        }
    return found


def _defaults(robot: Robot, mass: float, rotors: int) -> dict[str, float]:
    """Return the values that all rotors share; their minimum thrust is 0."""
    defaults = {"min_thrust": 0.0} | robot.rotor_defaults
    if "thrust_to_weight" in defaults:
        total = defaults.pop("thrust_to_weight") * mass * STANDARD_GRAVITY
        defaults["max_thrust"] = _rounded(total / rotors)
    return defaults


def _notes(path: Path, robot: Robot, hover: float, drag: float) -> list[str]:
    notes = [f"from {path.name}: mass, inertia and centre of mass are those of all {len(robot.links)} links"]
    if robot.motors:
        notes.append(
            "max_thrust is motorConstant maxRotVelocity², lag the slower of the motor's time constants"
        )
    if drag > 0.0:
        notes.append(f"drag_body is that of the rotors at {hover:.4g} rad/s, in hover on Earth")
    return notes


def _rounded(value: Any) -> Any:
    """Return a number, or nested lists of numbers, with 12 digits."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    return [_rounded(each) for each in value] if isinstance(value, list) else float(f"{value:.12g}") + 0.0
