"""Units of the numbers of problems and vehicles, by the last part of their names."""

from __future__ import annotations

from types import MappingProxyType

DEGREES = "_deg"  # ends the names of angles in files

# as the comments beside the fields say, and docs/files.md; what is not here has none, or none of its own
UNITS = MappingProxyType(
    {
        "acceleration": "m/s²", "attitude_frequency": "rad/s", "attitude_integral_gain": "1/s³",
        "attitude_tolerance": "rad", "centre": "m", "centre_of_mass": "m", "crackle": "m/s⁵",
        "drag_body": "kg/s",
        "duration": "s", "gravity": "m/s²", "ground": "m", "heading": "rad", "height": "m", "hold": "s",
        "inertia": "kg·m²", "integral_gain": "1/s³", "jerk": "m/s³", "jerk_filter": "s", "lag": "s",
        "lead": "m",
        "lead_time_constant": "s", "margin": "m", "mass": "kg", "max_attitude_integral": "rad·s",
        "max_body_rate": "rad/s", "max_feedback": "m/s²", "max_integral": "m·s", "max_thrust": "N",
        "min_inverted_thrust": "m/s²", "min_lateral_thrust": "m/s²", "min_speed": "m/s",
        "min_upright_thrust": "m/s²", "polygon": "m", "position": "m", "position_body": "m",
        "position_gain": "1/s²", "radius": "m", "semi_axes": "m", "snap": "m/s⁴", "speed": "m/s",
        "thrust": "m/s²", "time": "s", "tolerance": "rad", "torque_coefficient": "m", "velocity": "m/s",
        "velocity_gain": "1/s", "width": "m", "wind": "m/s",
    }
)  # fmt: skip
OF_LIMITS = MappingProxyType({"lower": "m", "upper": "m"})
OF_PROBLEM = MappingProxyType({"min_thrust": "m/s²"})
OF_VEHICLE = MappingProxyType({"min_thrust": "N"})


def unit_of(names: tuple[str, ...], of_vehicle: bool) -> str:
    """The unit of a number, empty where it has none.

    Args:
        names: the keys that lead to it, without those of lists.
        of_vehicle: true of a vehicle's, false of a problem's.
    """
    if names[-1].endswith(DEGREES):
        return "°"
    inner = OF_LIMITS if names[0] == "limits" else OF_VEHICLE if of_vehicle else OF_PROBLEM
    return inner.get(names[-1], UNITS.get(names[-1], ""))
