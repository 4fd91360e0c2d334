"""What one flight draws of its conditions: the vehicle that really flies, its start, errors, disturbances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from math import hypot, tau
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import by_value
from aerobat.environment import Dispersion, Gusts, HandOff, Imu, MotionCapture
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

STREAMS = ("imu", "imu_bias", "motion_capture", "wind")  # of random numbers along a flight
_NORMALS = (  # standard normals of a draw, in this order, whatever the conditions
    ("mass", 1),
    ("inertia", 1),
    ("drag", 1),
    ("start_position", 3),
    ("start_velocity", 3),
    ("start_attitude", 3),
    ("gyro_bias", 3),
    ("accelerometer_bias", 3),
    ("first_position_error", 3),
    ("first_attitude_error", 3),
    ("hand_off_translation", 3),
    ("hand_off_rotation", 3),
    ("warp", 3),
    ("mean_wind", 2),
    ("gust", 5),
)
_ENDS = np.cumsum([count for _, count in _NORMALS]).tolist()
# of a second-order gust's two filters [-]: the Cholesky factor of their covariance (1/2, 1/4; 1/4, 1/4)
_GUST_ROOT = np.array([[np.sqrt(0.5), 0.0], [np.sqrt(0.125), np.sqrt(0.125)]])


@by_value
@dataclass(frozen=True, eq=False)
class Draw:
    """One flight's share of its conditions: flight k of a seed, whatever others fly beside it.

    A cause that is switched off leaves what is drawn of the others as it was, so that flights under other
    conditions can be compared pair by pair.
    """

    seed: int
    flight: int
    mass: float  # [-] over the nominal one
    inertia: float  # [-] over the nominal one
    drag: float  # [1/s] unmodelled, over the nominal mass
    effectiveness: Array  # [-] of each rotor: its thrust over what was commanded, (n,)
    lags: Array  # [-] of each rotor, over the nominal one, (n,)
    start_position: Array  # [m] off the reference's start, (3,)
    start_velocity: Array  # [m/s] likewise, (3,)
    start_attitude: Array  # [rad] likewise, a rotation vector in body axes, (3,)
    gyro_bias: Array  # [rad/s] at the start, (3,)
    accelerometer_bias: Array  # [m/s²] at the start, (3,)
    first_position_error: Array  # [m] of the pose known before the flight, (3,)
    first_attitude_error: Array  # [rad] likewise, (3,)
    hand_off_translation: Array  # [m] of the second camera system, (3,)
    hand_off_rotation: Array  # [rad] likewise, a rotation vector in world axes, (3,)
    warp: Array  # [m] displacement of poses at the hand-off, (3,)
    charge: float  # [-] of the battery at the start
    mean_wind: Array  # [m/s] beyond the environment's, (3,)
    gust: Array  # [-] states of the gusts' filters at the start, (5,)
    gust_heading: float  # [rad] of the turbulence where there is no mean wind

    def vehicle(self, nominal: Vehicle) -> Vehicle:
        """The vehicle that really flies, its rotors' effectiveness apart."""
        rotors = (
            replace(rotor, lag=factor * rotor.lag)
            for rotor, factor in zip(nominal.rotors, self.lags.tolist(), strict=True)
        )
        return replace(
            nominal,
            mass=self.mass * nominal.mass,
            inertia=self.inertia * nominal.inertia,
            drag_body=nominal.drag_body + self.drag * nominal.mass,
            rotors=tuple(rotors),
        )

    def start(self, reference: BodyState) -> BodyState:
        """The true state at the start of a flight whose reference starts so."""
        return BodyState(
            reference.position + self.start_position,
            reference.velocity + self.start_velocity,
            so3.multiply(reference.q_world_body, so3.exp(self.start_attitude)),
            np.asarray(reference.omega_body),
        )

    def stream(self, name: str) -> np.random.SeedSequence:
        """The seed of the random numbers of one of STREAMS along the flight."""
        return np.random.SeedSequence(self.seed, spawn_key=(self.flight, STREAMS.index(name)))

    def row(self) -> dict[str, float]:
        """All of it as numbers by name, those of arrays by an index behind: a row of a table."""
        columns: dict[str, float] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                columns |= {f"{field.name}_{i}": x for i, x in enumerate(value.tolist())}
            else:
                columns[field.name] = value
        return columns


def draw_flights(dispersion: Dispersion, rotors: int, seed: int, flights: Iterable[int]) -> tuple[Draw, ...]:
    """The draws of some flights, each the same whichever others are asked for.

    Args:
        dispersion: what varies.
        rotors: how many the vehicle has.
        seed: of all flights.
        flights: their numbers, from 0.
    """
    return tuple(_draw(dispersion, rotors, seed, flight) for flight in flights)


def _draw(conditions: Dispersion, rotors: int, seed: int, flight: int) -> Draw:
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(flight,)))
    normals = rng.standard_normal(_ENDS[-1])
    normal = {name: normals[end - count : end] for (name, count), end in zip(_NORMALS, _ENDS, strict=True)}
    uniform = rng.random(2).tolist()
    each_rotor = rng.standard_normal((2, rotors))  # last: other vehicles draw the rest alike
    values = {
        **_of_vehicle(conditions, normal, each_rotor),
        **_of_sensors(conditions, normal),
        **_of_surroundings(conditions, normal, uniform),
    }
    for value in values.values():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return Draw(seed, flight, **values)


def _of_vehicle(conditions: Dispersion, normal: Mapping[str, Array], each_rotor: Array) -> dict[str, Any]:
    return {
        "mass": float(_factors(conditions.mass, normal["mass"])[0]),
        "inertia": float(_factors(conditions.inertia, normal["inertia"])[0]),
        "drag": conditions.drag * abs(float(normal["drag"][0])),
        "effectiveness": _factors(conditions.rotor, each_rotor[0]),
        "lags": _factors(conditions.lag, each_rotor[1]),
        "start_position": conditions.start_position * normal["start_position"],
        "start_velocity": conditions.start_velocity * normal["start_velocity"],
        "start_attitude": conditions.start_attitude * normal["start_attitude"],
    }


def _of_sensors(conditions: Dispersion, normal: Mapping[str, Array]) -> dict[str, Any]:
    imu = conditions.imu or Imu()
    capture = conditions.motion_capture or MotionCapture()
    hand_off = capture.hand_off or HandOff()
    return {
        "gyro_bias": imu.gyro_bias * normal["gyro_bias"],
        "accelerometer_bias": imu.accelerometer_bias * normal["accelerometer_bias"],
        "first_position_error": capture.position_noise * normal["first_position_error"],
        "first_attitude_error": capture.attitude_noise * normal["first_attitude_error"],
        "hand_off_translation": hand_off.translation * _direction(normal["hand_off_translation"]),
        "hand_off_rotation": hand_off.rotation * _direction(normal["hand_off_rotation"]),
        "warp": hand_off.warp * _direction(normal["warp"]),
    }


def _of_surroundings(
    conditions: Dispersion, normal: Mapping[str, Array], uniform: Sequence[float]
) -> dict[str, Any]:
    gusts = conditions.gusts or Gusts()
    used, turn = uniform
    along, *across = normal["gust"]
    return {
        "charge": 1.0 - used * (conditions.battery.charge_spread if conditions.battery else 0.0),
        "mean_wind": gusts.mean_wind * np.append(normal["mean_wind"], 0.0),
        "gust": np.append(along, (np.reshape(across, (2, 2)) @ _GUST_ROOT.T).ravel()),
        "gust_heading": tau * turn,
    }


def _factors(spread: float, normals: Array) -> Array:
    """Log-normal factors, never negative, with mean 1 and standard deviation `spread`."""
    variance = np.log1p(spread**2)
    return np.asarray(np.exp(np.sqrt(variance) * normals - 0.5 * variance))


def _direction(normals: Array) -> Array:
    return normals / hypot(*normals.tolist())


def dispersed_fleet(nominal: Vehicle, draws: Sequence[Draw]) -> Fleet:
    """The vehicles that really fly, as arrays: `Fleet.of` of each draw's vehicle, without making those."""
    one, shape = Fleet.of([nominal]), (len(draws),)
    mass, inertia = np.array([(d.mass, d.inertia) for d in draws]).T
    drag = np.array([d.drag for d in draws]) * nominal.mass

    def alike(array: Array) -> Array:
        return np.broadcast_to(array[0], shape + array.shape[1:]).copy()

    return Fleet(
        names=one.names * len(draws),
        mass=mass * nominal.mass,
        inertia=inertia[:, None, None] * nominal.inertia,
        drag_body=nominal.drag_body + drag[:, None],
        rotor_positions=alike(one.rotor_positions),
        spins=alike(one.spins),
        min_thrusts=alike(one.min_thrusts),
        max_thrusts=alike(one.max_thrusts),
        torque_coefficients=alike(one.torque_coefficients),
        lags=np.array([d.lags for d in draws]) * one.lags,
        radii=alike(one.radii),
    )
