"""Betaflight's settings for a vehicle, as lines of its command line that can be pasted to a board.

The gains are those of `kernels.rate_loop`, in the firmware's units. Features that would alter rates or thrust
are switched off: stick expo and smoothing, throttle attenuation, integral relaxation, boosts.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, pi

import numpy as np

from aerobat.control.parameters import airframe_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.errors import SpecError
from aerobat.kernels.rate_loop import rate_gains
from aerobat.links.betaflight.packets import MOTORS
from aerobat.simulation.law_controller import DERIVATIVE, GYRO
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

GYRO_LIMIT = 1998.0  # [°/s] range of the gyro, and largest rate of a stick
_RATE_STEP = 10.0  # [°/s] resolution of the sticks' rates
_MIN_RATE = 570.0  # [°/s] least rate at a stick's end, with room for corrections
_CORRECTION = 9.0  # [rad/s] beyond the reference's rates: corrections of the outer loop, and its lead
_LEVER_SPREAD = 0.02  # [-] largest relative difference of the rotors' lever arms

_OFF = {
    "iterm_relax": "OFF", "iterm_windup": 100, "anti_gravity_gain": 0, "throttle_boost": 0, "tpa_rate": 0,
    "tpa_low_rate": 0, "crash_recovery": "OFF", "abs_control_gain": 0, "thr_expo": 0, "thrust_linear": 0,
    "rc_smoothing": "OFF", "vbat_sag_compensation": 0, "yaw_lowpass_hz": 0, "simplified_pids_mode": "OFF",
    "simplified_gyro_filter": "OFF", "simplified_dterm_filter": "OFF", "d_max_roll": 0, "d_max_pitch": 0,
    "d_max_yaw": 0, "f_roll": 0, "f_pitch": 0, "f_yaw": 0, "gyro_lpf1_dyn_min_hz": 0,
    "gyro_lpf2_static_hz": 0, "dterm_lpf1_dyn_min_hz": 0, "dterm_lpf2_static_hz": 0,
}  # fmt: skip
_WHOLE = {
    "pidsum_limit": 1000, "pidsum_limit_yaw": 1000, "yaw_rate_limit": 1998,
    "airmode_start_throttle_percent": 0,
    "gyro_lpf1_static_hz": round(0.5 / (pi * GYRO)), "dterm_lpf1_static_hz": round(0.5 / (pi * DERIVATIVE)),
}  # fmt: skip
# features that protect a real vehicle near the ground, and would end a flip
_SIMULATED = {
    "runaway_takeoff_prevention": "OFF", "yaw_spin_recovery": "OFF", "gyro_overflow_detect": "OFF",
    "small_angle": 180, "motor_pwm_protocol": "PWM", "motor_idle": 0,
}  # fmt: skip


def board_rate(vehicle: Vehicle, peak: float = 0.0) -> float:
    """Return the rate at a stick's end [rad/s] of a vehicle's board, for any plan within its limits.

    Args:
        vehicle: Of which `max_body_rate` is used.
        peak: The largest rate of references [rad/s], if it is larger.

    Raises SpecError for rates beyond the firmware's gyro range.
    """
    fastest = 180.0 / pi * max(peak, min(vehicle.max_body_rate, pi / 180.0 * GYRO_LIMIT))
    if fastest > GYRO_LIMIT:
        raise SpecError(
            f"autopilot: the path turns at {fastest:.0f}°/s, and Betaflight knows rates up to "
            f"{GYRO_LIMIT:.0f}°/s; plan it with a lower max_body_rate of the vehicle"
        )
    wanted = max(fastest + 180.0 / pi * _CORRECTION, _MIN_RATE)
    return pi / 180.0 * min(_RATE_STEP * ceil(wanted / _RATE_STEP), _RATE_STEP * int(GYRO_LIMIT / _RATE_STEP))


def throttle_of(vehicle: Vehicle, thrust: float) -> float:
    """Return the throttle, 0 to 1, at which all rotors together give a thrust [N]."""
    low, high = vehicle.min_thrusts.sum(), vehicle.max_thrusts.sum()
    return float(np.clip((thrust - low) / (high - low), 0.0, 1.0))


def rotor_order(vehicle: Vehicle) -> tuple[int, ...]:
    """Return the rotor of each of the packet's motors. Raises SpecError for any but a quadrotor in X."""
    places = np.array([rotor.position_body for rotor in vehicle.rotors])
    complaint = SpecError(
        f"autopilot: Betaflight's simulator flies quadrotors in X, and the rotors of '{vehicle.name}' are no "
        "such; take another vehicle, such as agile-quad"
    )
    if len(places) != len(MOTORS):
        raise complaint
    x, y = np.abs(places[:, :2]).T
    order = []
    for front, left in ((1, -1), (-1, 1), (1, 1), (-1, -1)):
        there = np.flatnonzero((np.sign(places[:, 0]) == front) & (np.sign(places[:, 1]) == left))
        order += there[:1].tolist()
    if len(order) < len(MOTORS) or max(np.ptp(x) / x.max(), np.ptp(y) / y.max()) > _LEVER_SPREAD:
        raise complaint
    spins = [vehicle.rotors[k].spin for k in order]
    if spins[0] != spins[1] or spins[2] != spins[3] or spins[0] == spins[2]:
        raise complaint
    return tuple(order)


def betaflight_settings(vehicle: Vehicle, max_rate: float, simulated: bool = False) -> tuple[str, ...]:
    """Return lines of Betaflight's command line for a vehicle, without the final `save`.

    Args:
        vehicle: Of which inertia, lever arms and lag determine the gains.
        max_rate: [rad/s] at the end of each stick.
        simulated: Whether protections of a real vehicle are switched off too.

    Raises SpecError for a vehicle that the firmware's mixer or gains do not fit.
    """
    order = rotor_order(vehicle)
    reversed_yaw = vehicle.rotors[order[0]].spin < 0  # Betaflight's front right turns counter-clockwise
    rate = round(180.0 / pi * max_rate / _RATE_STEP)
    values: dict[str, object] = {
        "rates_type": "ACTUAL",
        "yaw_motors_reversed": "ON" if reversed_yaw else "OFF",
    }
    for axis in ("roll", "pitch", "yaw"):
        values |= {f"{axis}_rc_rate": rate, f"{axis}_srate": rate, f"{axis}_expo": 0}
    values |= dict(_gains(vehicle)) | _OFF | _WHOLE | (_SIMULATED if simulated else {})
    features = ("feature -GPS", "feature -TELEMETRY") if simulated else ()
    arming = "aux 0 0 0 1700 2100 0 0"  # by the first switch
    return (
        *features,
        "feature AIRMODE",
        arming,
        *(f"set {name} = {value}" for name, value in values.items()),
    )


def _gains(vehicle: Vehicle) -> Iterator[tuple[str, int]]:
    """Yield the gains in the firmware's units.

    One unit is `scale` thousandths of a motor's range for 1°/s, 1° and 1°/s². Source: its
    src/main/flight/pid.h, for the integral of yaw pid_init.c.
    """
    gains = rate_gains(FloatOps, first_numbers(airframe_parameters(Fleet.of([vehicle]))))
    # [N·m] torque with every motor at its limit for an axis
    torque = np.abs(vehicle.allocation[1:]) @ vehicle.thrust_ranges
    authority = torque / np.diag(vehicle.inertia)  # [rad/s²]
    for k, axis in enumerate(("roll", "pitch", "yaw")):
        for letter, kind, scale in (
            ("p", gains.proportional, 0.032029),
            ("i", gains.integral, 0.244381 * (2.5 if axis == "yaw" else 1.0)),
            ("d", gains.derivative, 0.000529),
        ):
            value = round(kind[k] / authority[k] * 1000.0 * pi / 180.0 / scale)
            value = max(value, 1 if kind[k] > 0.0 else 0)  # a small gain must not be rounded to zero
            if value > 250:  # the largest value of its command line
                raise SpecError(
                    f"autopilot: the rotors of '{vehicle.name}' are too slow for Betaflight's gains, "
                    f"{letter}_{axis} would be {value}; take a vehicle of less lag or less inertia"
                )
            yield f"{letter}_{axis}", value
