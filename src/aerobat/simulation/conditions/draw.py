"""Random draws of a flight from its conditions: true vehicle, start, sensor errors and disturbances."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import sqrt, tau
from typing import Any

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Dispersion, Gusts, HandOff, Imu, MotionCapture
from aerobat.simulation.nested import rows_of
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

STREAMS = ("imu", "imu_bias", "motion_capture", "wind")  # streams of random numbers along a flight
_NORMALS = {  # standard normals of a draw, always all of them in this order, whatever the conditions
    "mass": 1,
    "inertia": 1,
    "drag": 1,
    "start_position": 3,
    "start_velocity": 3,
    "start_attitude": 3,
    "gyro_bias": 3,
    "accelerometer_bias": 3,
    "first_position_error": 3,
    "first_attitude_error": 3,
    "hand_off_translation": 3,
    "hand_off_rotation": 3,
    "warp": 3,
    "mean_wind": 2,
    "gust": 5,
}
# Cholesky factor [-] of (1/2, 1/4; 1/4, 1/4), the covariance of the two filters of a second-order gust
_GUST_FIRST, _GUST_SECOND = sqrt(0.5), sqrt(0.125)


class Draws:
    """Columns of random draws for flights. Flight k of a seed is the same whatever other flights are drawn.

    Switching one cause off leaves the draws of the others unchanged, so that flights under other conditions
    can be compared pair by pair.
    """

    columns: Mapping[str, Array]  # (flights,) or (flights, n); the functions below explain the names

    def __init__(self, dispersion: Dispersion, rotors: int, seed: int, flights: Iterable[int]) -> None:
        """Draw the varied quantities of all flights.

        Args:
            dispersion: the distributions.
            rotors: the vehicle's number of rotors.
            seed: of all flights.
            flights: their numbers, from 0.
        """
        flights = self.flights = tuple(flights)
        count = sum(_NORMALS.values())
        normals, uniforms = np.empty((len(flights), count + 2 * rotors)), np.empty((len(flights), 2))
        words = np.empty((len(flights), 1 + len(STREAMS), 3), dtype=np.uint64)  # of a generator's state
        for k, flight in enumerate(flights):
            own = np.random.SeedSequence(seed, spawn_key=(flight,))
            words[k] = own.generate_state(words[k].size, np.uint64).reshape(words[k].shape)
            generator = np.random.Generator(np.random.SFC64(_Seed(words[k, 0])))  # type: ignore[arg-type]
            generator.random(out=uniforms[k])
            generator.standard_normal(out=normals[k])  # rotors last: other vehicles draw the rest alike
        *parts, of_rotors = np.split(normals, np.cumsum(list(_NORMALS.values())), axis=1)
        normal = dict(zip(_NORMALS, parts, strict=True))
        each_rotor = of_rotors.reshape(-1, 2, rotors).swapaxes(0, 1)
        self.columns = {
            **_of_vehicle(dispersion, normal, each_rotor),
            **_of_sensors(dispersion, normal),
            **_of_surroundings(dispersion, normal, uniforms),
        }
        self._words = words
        for values in self.columns.values():
            values.flags.writeable = False

    def __len__(self) -> int:
        return len(self.flights)

    def starts(self, reference: BodyState) -> BodyState:
        """Return the true states at the start of flights whose reference starts at `reference`."""
        position, velocity, turn = (
            self.columns[f"start_{name}"] for name in ("position", "velocity", "attitude")
        )
        q = so3.normalize(so3.multiply(reference.q_world_body, so3.exp(turn)))
        omega = np.broadcast_to(reference.omega_body, position.shape)
        return BodyState(reference.position + position, reference.velocity + velocity, q, omega)

    def stream(self, name: str) -> list[ISeedSequence]:
        """Return the seeds of the random numbers of one of STREAMS, one seed per flight."""
        return [_Seed(words) for words in self._words[:, 1 + STREAMS.index(name)]]


class _Seed(ISeedSequence):
    """Seed of a generator with known words: those of all generators of a flight are made at once."""

    def __init__(self, words: NDArray[np.uint64]) -> None:
        self._words = words

    def generate_state(self, n_words: int, dtype: Any = np.uint64) -> NDArray[np.uint64]:
        """Return the first words."""
        return self._words[:n_words]


def _of_vehicle(conditions: Dispersion, normal: Mapping[str, Array], each_rotor: Array) -> dict[str, Array]:
    """Return factors of nominal parameters, unmodelled drag over mass [1/s], offsets of the start [SI]."""
    return {
        "mass": _factors(conditions.mass, normal["mass"][:, 0]),
        "inertia": _factors(conditions.inertia, normal["inertia"][:, 0]),
        "drag": conditions.drag * np.abs(normal["drag"][:, 0]),
        "effectiveness": _factors(conditions.rotor, each_rotor[0]),
        "lags": _factors(conditions.lag, each_rotor[1]),
        "start_position": conditions.start_position * normal["start_position"],
        "start_velocity": conditions.start_velocity * normal["start_velocity"],
        "start_attitude": conditions.start_attitude * normal["start_attitude"],
    }


def _of_sensors(conditions: Dispersion, normal: Mapping[str, Array]) -> dict[str, Array]:
    """Return initial biases, errors of the first pose, and misfits of the second camera system [SI]."""
    imu = conditions.imu or Imu()
    capture = conditions.motion_capture or MotionCapture()
    hand_off = capture.hand_off or HandOff()
    return {
        "gyro_bias": imu.gyro_bias * normal["gyro_bias"],
        "accelerometer_bias": imu.accelerometer_bias * normal["accelerometer_bias"],
        "first_position_error": capture.position_noise * normal["first_position_error"],
        "first_attitude_error": capture.attitude_noise * normal["first_attitude_error"],
        "hand_off_translation": hand_off.translation * _directions(normal["hand_off_translation"]),
        "hand_off_rotation": hand_off.rotation * _directions(normal["hand_off_rotation"]),
        "warp": hand_off.warp * _directions(normal["warp"]),
    }


def _of_surroundings(
    conditions: Dispersion, normal: Mapping[str, Array], uniforms: Array
) -> dict[str, Array]:
    """Return battery charge [-], added mean wind [m/s], states of gusts [-] and gust heading [rad]."""
    gusts = conditions.gusts or Gusts()
    used, turn = uniforms.T
    along, *across = normal["gust"].T
    filters = ((_GUST_FIRST * a, _GUST_SECOND * (a + b)) for a, b in (across[:2], across[2:]))
    x, y = normal["mean_wind"].T
    return {
        "charge": 1.0 - used * (conditions.battery.charge_spread if conditions.battery else 0.0),
        "mean_wind": gusts.mean_wind * np.stack([x, y, np.zeros_like(x)], axis=-1),
        "gust": np.stack([along, *(state for both in filters for state in both)], axis=-1),
        "gust_heading": tau * turn,
    }


def _factors(spread: float, normals: Array) -> Array:
    """Return log-normal factors, never negative, with mean 1 and standard deviation `spread`."""
    variance = np.log1p(spread**2)
    return np.asarray(np.exp(np.sqrt(variance) * normals - 0.5 * variance))


def _directions(normals: Array) -> Array:
    x, y, z = normals.T
    return np.asarray(normals / np.sqrt(x * x + y * y + z * z)[:, None])


def dispersed_fleet(nominal: Vehicle, draws: Draws) -> Fleet:
    """Return the vehicles that really fly, as arrays: `Fleet.of` each draw's vehicle, made directly."""
    one = Fleet.of([nominal])
    drag = draws.columns["drag"] * nominal.mass
    return replace(
        rows_of(one, np.zeros(len(draws), np.intp)),
        names=one.names * len(draws),
        mass=draws.columns["mass"] * nominal.mass,
        inertia=draws.columns["inertia"][:, None, None] * nominal.inertia,
        drag_body=nominal.drag_body + drag[:, None],
        lags=draws.columns["lags"] * one.lags,
    )
