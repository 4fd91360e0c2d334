"""Flights as an IMU and motion capture see them: interval means and poses of truth, and their errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import components, from_components
from aerobat.environment import Environment
from aerobat.estimation import Ekf, FilterInput, FilterParameters, ekf_parameters, filter_loop
from aerobat.estimation.replay import NO_SLOT
from aerobat.kernels.ekf import EkfState, ImuSample, Pose
from aerobat.kernels.ekf.covariance import unpack
from aerobat.simulation import fly
from aerobat.states import BodyState
from shared_plans import shared_plan

RATE = 1000  # [1/s] of the IMU
STRIDE = 10  # samples from one pose to the next
CONVERGED = 200  # samples after which the start is forgotten
SETTINGS = Ekf()


@dataclass(frozen=True)
class Truth:
    """True motions of many vehicles at the ends of IMU intervals, T of them after the start."""

    position: Array  # [m], (N, T + 1, 3)
    velocity: Array  # [m/s], (N, T + 1, 3)
    q_world_body: Array  # (N, T + 1, 4)
    omega: Array  # [rad/s] means over the intervals, (N, T, 3)
    specific_force: Array  # [m/s²] means over the intervals, body axes, (N, T, 3)


NAMES = ("half-flip", "flip-pitch")


def planned(number: int) -> ab.Plan:
    """One of two maneuvers of the hexarotor, quickly planned."""
    return shared_plan(NAMES[number], "hexarotor", ab.Miqp())


@lru_cache
def flips(number: int, count: int) -> Truth:
    """Flights of a plan by many vehicles, none like another, each from a start of its own."""
    hexarotor, plan = ab.load_vehicle("hexarotor"), planned(number)
    rng = np.random.default_rng(number)
    factors = rng.uniform(0.95, 1.05, count)
    vehicles = [replace(hexarotor, name=f"{k}", mass=hexarotor.mass * f) for k, f in enumerate(factors)]
    scatter = [s * rng.normal(size=(count, 3)) for s in (0.02, 0.05, 0.03, 0.1)]
    first = ab.reference(plan, times=[0.0]).setpoint
    start = BodyState(
        first.flat.position + scatter[0],
        first.flat.velocity + scatter[1],
        so3.multiply(first.q_world_body, so3.exp(scatter[2])),
        first.omega_body + scatter[3],
    )
    flight = fly(plan, vehicles, start=start, rate=2.0 * RATE, nominal=hexarotor)
    return seen(flight, np.array([v.mass for v in vehicles]), hexarotor.drag_body)


def seen(flight: ab.Flight, masses: Array, drag_body: Array) -> Truth:
    """The means by Simpson's rule over two ticks of the flight."""
    states = flight.states
    drag = drag_body * so3.unrotate(states.q_world_body, states.velocity)
    force = -drag
    force[..., 2] += flight.thrusts.sum(axis=-1)
    force /= masses[:, None, None]
    samples = (len(flight.times) - 2) // (2 * STRIDE) * STRIDE  # the flight's last tick is a shorter one
    ends = slice(0, 2 * samples + 1, 2)
    return Truth(
        states.position[:, ends],
        states.velocity[:, ends],
        states.q_world_body[:, ends],
        simpson(states.omega_body[:, : 2 * samples + 1]),
        simpson(force[:, : 2 * samples + 1]),
    )


def simpson(values: Array) -> Array:
    """Means over pairs of intervals, (N, 2 T + 1, 3) -> (N, T, 3)."""
    return np.asarray((values[:, :-1:2] + 4.0 * values[:, 1::2] + values[:, 2::2]) / 6.0)


@dataclass(frozen=True)
class Measured:
    """What the sensors of N vehicles show; poses of every STRIDE-th instant, the first at the start."""

    omega: Array  # [rad/s], (N, T, 3)
    specific_force: Array  # [m/s²], (N, T, 3)
    gyro_bias: Array  # [rad/s] true at the ends of the intervals, (N, T, 3)
    accelerometer_bias: Array  # [m/s²], (N, T, 3)
    position: Array  # [m], (N, T // STRIDE + 1, 3)
    q_world_body: Array  # (N, T // STRIDE + 1, 4)


def measured(truth: Truth, settings: Ekf = SETTINGS, seed: int = 0) -> Measured:
    """The truth with the errors that the settings reckon with."""
    rng = np.random.default_rng(seed)
    shape = truth.omega.shape
    dt = 1.0 / RATE

    def walk(start: float, density: float) -> Array:
        first = start * rng.normal(size=(shape[0], 1, 3))
        return np.asarray(first + np.cumsum(density * dt**0.5 * rng.normal(size=shape), axis=1))

    gyro_bias = walk(settings.gyro_bias, settings.gyro_bias_walk)
    accelerometer_bias = walk(settings.accelerometer_bias, settings.accelerometer_bias_walk)
    position, q = truth.position[:, ::STRIDE], truth.q_world_body[:, ::STRIDE]
    turns = settings.attitude_noise * rng.normal(size=position.shape)
    return Measured(
        truth.omega + gyro_bias + settings.gyro_noise / dt**0.5 * rng.normal(size=shape),
        truth.specific_force
        + accelerometer_bias
        + settings.accelerometer_noise / dt**0.5 * rng.normal(size=shape),
        gyro_bias,
        accelerometer_bias,
        position + settings.position_noise * rng.normal(size=position.shape),
        so3.multiply(q, so3.exp(turns)),
    )


def inputs(measured: Measured, latency: int, slots: int, lost: slice = slice(0)) -> FilterInput:
    """The rows of a filter, an instant for each sample; `latency` is in samples."""
    samples = measured.omega.shape[1]
    tick = np.arange(1, samples + 1)
    exposed = np.where(tick % STRIDE == 0, tick // STRIDE % slots, NO_SLOT)
    due = (tick - latency) // STRIDE
    arrives = ((tick - latency) % STRIDE == 0) & (due > 0)
    arrives &= ~np.isin(due, np.arange(measured.position.shape[1])[lost])
    pose = np.clip(due, 0, None)
    return FilterInput(
        elapsed=np.full(samples, 1.0 / RATE),
        sample=ImuSample(*(components(x.swapaxes(0, 1)) for x in (measured.omega, measured.specific_force))),
        exposed=exposed,
        arrived=np.where(arrives, due % slots, NO_SLOT),
        measured=Pose(
            *(components(x[:, pose].swapaxes(0, 1)) for x in (measured.position, measured.q_world_body))
        ),
    )


def parameters(measured: Measured, velocity: Array, settings: Ekf = SETTINGS) -> FilterParameters:
    """Those of filters that begin at the first poses; `velocity` (N, 3) is what is taken for it at first."""
    first = Pose(components(measured.position[:, 0]), components(measured.q_world_body[:, 0]))
    numbers = ekf_parameters(settings, Environment().gravity, len(velocity))
    return FilterParameters(numbers, first, components(velocity))


def measured_hover(
    vehicles: int = 3, poses: int = 27, latency: int = 15
) -> tuple[FilterParameters, FilterInput]:
    """A hover that is measured late, with an outlier and a jump."""
    rng = np.random.default_rng(8)
    still = Truth(
        np.zeros((vehicles, STRIDE * poses + 1, 3)),
        np.zeros((vehicles, STRIDE * poses + 1, 3)),
        np.tile(so3.IDENTITY, (vehicles, STRIDE * poses + 1, 1)),
        np.zeros((vehicles, STRIDE * poses, 3)),
        np.tile([0.0, 0.0, 9.81], (vehicles, STRIDE * poses, 1)),
    )
    seen_by = measured(still)
    seen_by.position[:, 5] += 0.3
    seen_by.position[1:, 20:] += rng.normal(0.0, 0.05, 3)
    return parameters(seen_by, np.zeros((vehicles, 3))), inputs(seen_by, latency, 2)


@dataclass(frozen=True)
class Filtered:
    """What filters say of N vehicles after each sample, and how far it is from the truth."""

    states: EkfState  # leaves (N, T)
    error: Array  # of 15, (N, T, 15)

    @property
    def nees(self) -> Array:
        """Normalized estimation error squared, (N, T)."""
        rows = np.moveaxis(np.array(unpack(self.states.covariance)), (0, 1), (-2, -1))
        return np.asarray(
            np.einsum("nti,nti->nt", self.error, np.linalg.solve(rows, self.error[..., None])[..., 0])
        )

    def rms(self, part: int, since: int = 0) -> float:
        """Of the length of one part of the error, from a sample on."""
        errors = self.error[:, since:, 3 * part : 3 * part + 3]
        return float(np.sqrt((errors**2).sum(axis=-1).mean()))


def filtered(
    truth: Truth,
    seen: Measured,
    latency: int = 10,
    settings: Ekf = SETTINGS,
    seed: int = 0,
    lost: slice = slice(0),
) -> Filtered:
    """The filters' states, their first velocities off by what the settings say; some poses are lost."""
    slots = max(1, -(-latency // STRIDE))
    rng = np.random.default_rng([seed, 1])
    velocity = truth.velocity[:, 0]
    rows = inputs(seen, latency, slots, lost)
    velocity = velocity + settings.start_velocity * rng.normal(size=velocity.shape)
    init, step = filter_loop(slots)
    loop = choose("auto", len(velocity), len(rows.elapsed)).compile(
        init, step, parameters(seen, velocity, settings), first_row(rows)
    )
    states: EkfState = loop.scan(loop.init(first_row(rows)), rows)[1]
    return Filtered(states, error_of(truth, seen, states))


def error_of(truth: Truth, seen: Measured, states: EkfState) -> Array:
    """True less estimated, (N, T, 15)."""
    estimate = [from_components(part) for part in states.nominal]
    parts = (
        truth.position[:, 1:] - estimate[0],
        truth.velocity[:, 1:] - estimate[1],
        so3.box_minus(truth.q_world_body[:, 1:], estimate[2]),
        seen.gyro_bias - estimate[3],
        seen.accelerometer_bias - estimate[4],
    )
    return np.concatenate(parts, axis=-1)
