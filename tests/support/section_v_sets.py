"""The vehicle of Section V with other rotors and inertias, and how long its problem takes at least."""

from dataclasses import replace

import numpy as np

from aerobat.vehicle import Vehicle, load_vehicle

# rotors up to [N], inertia [kg·m²], duration [s] of the planar problem by multiple shooting of the rigid body
_SETS = {
    "A": (18.0, 0.12, 1.842),
    "B": (6.5, 0.12, 2.342),
    "D": (18.0, 0.012, 1.134),
    "E": (6.5, 0.012, 1.942),
}
LEAST_TIMES = {name: least for name, (_, _, least) in _SETS.items()}  # [s] in the plane


def section_v(name: str) -> Vehicle:
    """The vehicle of a set, its rotors from 0 N."""
    max_thrust, inertia, _ = _SETS[name]
    vehicle = load_vehicle("section-v")
    rotors = tuple(replace(rotor, min_thrust=0.0, max_thrust=max_thrust) for rotor in vehicle.rotors)
    return replace(vehicle, inertia=inertia * np.eye(3), rotors=rotors)
