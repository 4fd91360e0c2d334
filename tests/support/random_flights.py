"""Random vehicles on random trajectories in 3D, their rotors near the limits, to judge certificates.

Rotors have no lag, or commands that come as near to their limits as the thrusts of those without.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from aerobat import so3
from aerobat.certification import Certificate
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.trajectory import Trajectory
from aerobat.trajectory.polynomial import hermite
from aerobat.vehicle import Rotor, Vehicle

MARGINS = (-0.2, 0.2)  # of a rotor's range, between which the margin is sought
HALVINGS = 10  # to a hundredth of the flight's time
STENCIL_STEP = 2e-4  # of a segment, of differences


@dataclass(frozen=True)
class Flight:
    """A vehicle and a trajectory, on every second seed in a wind."""

    vehicle: Vehicle
    trajectory: Trajectory
    environment: Environment = field(default_factory=Environment)


@dataclass(frozen=True)
class Sampled:
    """What dense sampling says."""

    margin: float  # the least distance from a limit, in ranges of that rotor
    determined: bool


@lru_cache(maxsize=256)
def random_flight(seed: int, lags: bool = False) -> Flight:
    """One with its time scaled so that the rotors come as close to their limits as drawn.

    With `lags` the rotors have some, no two alike, and the path is smooth enough for them.
    """
    rng = np.random.default_rng(seed)
    vehicle = irregular(rng)
    if lags:
        drawn = rng.permutation([0.0, *rng.uniform(0.005, 0.08, len(vehicle.rotors) - 1)])
        vehicle = with_lags(vehicle, drawn)
    trajectory = tour(rng, 5 if lags else 4)
    trajectory = replace(trajectory, heading=rng.uniform(-3, 3))
    margin = rng.uniform(*MARGINS)
    environment = Environment(wind=seed % 2 * 5 * rng.normal(size=3))
    low, high = np.log([0.02, 50.0])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        near = Flight(vehicle, stretched(trajectory, np.exp(middle)), environment)
        low, high = (middle, high) if sampled(near, 300).margin < margin else (low, middle)
    return replace(near, trajectory=stretched(trajectory, np.exp(high)))


def with_lags(vehicle: Vehicle, lags: ArrayLike) -> Vehicle:
    """The vehicle with other rotors' time constants [s], (n,) or one for all."""
    each = np.broadcast_to(lags, len(vehicle.rotors)).tolist()
    return replace(
        vehicle, rotors=tuple(replace(r, lag=lag) for r, lag in zip(vehicle.rotors, each, strict=True))
    )


def irregular(rng: np.random.Generator) -> Vehicle:
    """Four or six rotors, no two alike, products of inertia, drag on every second, unequal by axes."""
    count, size, strength = int(rng.choice([4, 6])), 10 ** rng.uniform(-1.5, 0), 10 ** rng.uniform(-1, 1.5)
    masses = rng.normal(size=(6, 3)) * size * rng.uniform(0.2, 0.8)
    inertia = (np.sum(masses**2) * np.eye(3) - masses.T @ masses) / 6
    rotors = tuple(rotor(rng, size, strength, i, count) for i in range(count))
    mass = rng.uniform(0.1, 0.67) * sum(made.max_thrust for made in rotors) / 9.81
    drag = rng.choice([0.0, 1.0]) * mass * rng.uniform(0.0, 0.5, 3)
    try:
        made = Vehicle("random", mass, mass * (inertia + inertia.T) / 2, rotors, drag)
        made.require_hover(9.81)
        return made
    except SpecError:  # it cannot hover
        return irregular(rng)


def rotor(rng: np.random.Generator, size: float, strength: float, index: int, count: int) -> Rotor:
    """One of a ring of `count`."""
    angle = 2 * np.pi * index / count + rng.uniform(-0.2, 0.2)
    return Rotor(
        position_body=size * rng.uniform(0.8, 1.2) * np.array([np.cos(angle), np.sin(angle), 0.0]),
        spin=(1, -1)[index % 2],
        min_thrust=strength * rng.uniform(-0.05, 0.05),
        max_thrust=strength * rng.uniform(0.8, 1.2),
        torque_coefficient=size * rng.uniform(0.1, 0.5),
        lag=0.0,
        radius=0.1,
    )


def tour(rng: np.random.Generator, order: int) -> Trajectory:
    """Up to 8 segments through random states, or 20 intervals of constant inputs, of this order at least."""
    if rng.uniform() < 0.25:
        initial = rng.normal(size=(order, 3)) * np.array([1.0, 1.0, 3.0, 5.0, 10.0])[:order, None]
        return Trajectory.from_inputs(initial, 30 * rng.normal(size=(20, 3)), 0.1)
    segments, order = int(rng.integers(1, 9)), int(rng.integers(order, 7))
    size = np.array([3.0, 3.0, 4.0, 6.0, 10.0, 20.0])[:order, None]
    states = size * rng.normal(size=(segments + 1, order, 3))
    durations = rng.uniform(0.4, 1.6, segments)
    scale = durations[:, None, None] ** np.arange(order)[:, None]
    return Trajectory(durations, hermite(scale * states[:-1], scale * states[1:]))


def stretched(trajectory: Trajectory, factor: float) -> Trajectory:
    """The same path, flown so many times slower."""
    return replace(trajectory, durations=factor * trajectory.durations)


def moved(flight: Flight, heading: float, shift: np.ndarray) -> Flight:
    """The same flight elsewhere, into another direction."""
    turn = so3.about_axis(np.array([0.0, 0.0, 1.0]), np.array(heading))
    coefficients = so3.rotate(turn, flight.trajectory.coefficients)
    coefficients[:, 0] += shift
    turned = Trajectory(flight.trajectory.durations, coefficients, flight.trajectory.heading + heading)
    environment = replace(flight.environment, wind=so3.rotate(turn, flight.environment.wind))
    return Flight(flight.vehicle, turned, environment)


def sampled(flight: Flight, points: int) -> Sampled:
    """The margin at equally spaced times, in chunks that fit the processor's cache."""
    times = np.linspace(0.0, flight.trajectory.duration, points)
    parts = [at(flight, part, times[::100]) for part in np.array_split(times, 1 + points // 5000)]
    return Sampled(min(part.margin for part in parts), all(part.determined for part in parts))


def at(flight: Flight, times: np.ndarray, before: np.ndarray) -> Sampled:
    """The margin at some times; those of `before` that precede them help to carry the attitude there."""
    times = np.concatenate([before[before < times[0]], times])
    found = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    low, high = flight.vehicle.min_thrusts, flight.vehicle.max_thrusts
    rotors = [found.rotor_thrusts, *([commands(flight, times)] if flight.vehicle.lags.any() else [])]
    gaps = [np.minimum(each - low, high - each) / (high - low) for each in rotors]
    return Sampled(float(np.min(gaps)), not found.undetermined)


def commands(flight: Flight, times: np.ndarray) -> np.ndarray:
    """f + τ f' [N] at rising times, (T, n), by differences of f on the same segment, of fourth order."""
    trajectory = flight.trajectory
    segment = np.clip(np.searchsorted(trajectory.knots, times, side="right") - 1, 0, trajectory.segments - 1)
    start, duration = trajectory.knots[segment], trajectory.durations[segment]
    step = STENCIL_STEP * duration
    middle = np.clip(times, start + 3 * step, start + duration - 3 * step)
    stencil = middle[:, None] + step[:, None] * np.array([-2.0, -1.0, 1.0, 2.0])
    unique, places = np.unique(stencil, return_inverse=True)
    thrusts = reference(trajectory, flight.vehicle, unique, environment=flight.environment).rotor_thrusts[
        places.reshape(stencil.shape)
    ]
    rates = np.einsum("k,tkn->tn", [1.0, -8.0, 8.0, -1.0], thrusts) / (12 * step[:, None])
    at_middle = reference(trajectory, flight.vehicle, middle, environment=flight.environment).rotor_thrusts
    return at_middle + flight.vehicle.lags * rates


def certified_margin(flight: Flight, certificate: Certificate) -> float:
    """The margin that a certificate states, in ranges of that rotor."""
    low, high = flight.vehicle.min_thrusts, flight.vehicle.max_thrusts
    rotors = [f for f in certificate.findings if f.rotor is not None]
    return min(f.margin / (high - low)[f.rotor] for f in rotors)
