"""Units of the numbers that studies vary, by the last part of their names."""

from __future__ import annotations

from types import MappingProxyType

DEGREES = "_deg"  # suffix of the names of angles in files

# as in the comments beside the fields and in docs/files.md; names that are not here have no unit
UNITS = MappingProxyType(
    {
        "acceleration": "m/s²", "attitude": "rad", "attitude_frequency": "rad/s",
        "attitude_integral_gain": "1/s³", "attitude_tolerance": "rad", "centre": "m", "centre_of_mass": "m",
        "crackle": "m/s⁵", "disturbance_filter": "s", "drag_body": "kg/s",
        "duration": "s", "gravity": "m/s²", "ground": "m", "heading": "rad", "height": "m", "hold": "s",
        "inertia": "kg·m²", "integral_gain": "1/s³", "jerk": "m/s³", "jerk_filter": "s", "lag": "s",
        "lead": "m",
        "lead_time_constant": "s", "margin": "m", "mass": "kg", "max_attitude_integral": "rad·s",
        "max_body_rate": "rad/s", "max_feedback": "m/s²", "max_integral": "m·s", "max_thrust": "N",
        "max_tilt": "rad",
        "min_inverted_thrust": "m/s²", "min_lateral_thrust": "m/s²", "min_speed": "m/s",
        "min_upright_thrust": "m/s²", "polygon": "m", "position": "m", "position_body": "m",
        "position_gain": "1/s²", "radius": "m", "semi_axes": "m", "snap": "m/s⁴", "speed": "m/s",
        "thrust": "m/s²", "time": "s", "tolerance": "rad", "torque_coefficient": "m", "velocity": "m/s",
        "velocity_gain": "1/s", "width": "m", "wind": "m/s",
    }
)  # fmt: skip
OF = MappingProxyType(  # units of names that mean something else in these owners
    {
        "limits": {"lower": "m", "upper": "m"},
        "problem": {"angle": "°", "min_thrust": "m/s²", "point": "m", "start": "rad"},
        "vehicle": {"min_thrust": "N"},
        "conditions": {
            "accelerometer_bias": "m/s²", "accelerometer_bias_walk": "m/s³/√Hz",
            "accelerometer_noise": "m/s²/√Hz", "accelerometer_range": "m/s²", "airspeed": "m/s",
            "attitude_noise": "rad", "computation_delay": "s", "control_rate": "1/s", "drag": "1/s",
            "endurance": "s", "gyro_bias": "rad/s", "gyro_bias_walk": "rad/s²/√Hz",
            "gyro_noise": "rad/s/√Hz", "gyro_range": "rad/s", "gyro_range_deg": "°/s", "inertia": "",
            "intensity": "m/s", "lag": "", "latency": "s", "length": "m", "mass": "", "mean_wind": "m/s",
            "outlier_size": "m", "point": "m", "position_noise": "m", "rate": "1/s", "rotation": "rad",
            "start": "s", "start_attitude": "rad", "start_position": "m", "start_velocity": "m/s",
            "translation": "m", "warp": "m", "warp_depth": "m",
        },
        "planner": {"clearance": "m", "time_limit": "s"},
    }
)  # fmt: skip


def unit_of(names: tuple[str, ...]) -> str:
    """Return the unit of the number that these keys, without indices, lead to; empty where it has none."""
    holder = "limits" if names[1:2] == ("limits",) else names[0]
    own = OF.get(holder, {})
    if names[-1].endswith(DEGREES) and names[-1] not in own:
        return "°"
    return own.get(names[-1], UNITS.get(names[-1], ""))
