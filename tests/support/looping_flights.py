"""A path that rises, falls and swings, starts about it, and flights compared row by row."""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.simulation import Flight
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle

QUAD, HEXA = load_vehicle("agile-quad"), load_vehicle("hexarotor")
SERIES = ("commands", "thrusts", "saturated")


def loops(duration: float) -> Trajectory:
    """Rising and falling with a swing to the side, four segments, continuous up to snap."""
    s = np.array([0, 0, 0, 0, 0, 126, -420, 540, -315, 70], dtype=float)
    ends = np.array([[0, 0, 0], [1, 0.5, 2], [2, -0.5, 1], [1, 0, 0], [0, 0, 0]], dtype=float)
    coefficients = s[None, :, None] * np.diff(ends, axis=0)[:, None, :]
    coefficients[:, 0] += ends[:-1]
    return Trajectory(np.full(4, duration / 4), coefficients)


def near(count: int, seed: int = 0) -> BodyState:
    """Starts about the origin, none like another."""
    rng = np.random.default_rng(seed)
    scatter = [scale * rng.normal(size=(count, 3)) for scale in (0.1, 0.2, 0.3, 0.5)]
    return BodyState(scatter[0], scatter[1], so3.exp(scatter[2]), scatter[3])


def one(states: BodyState, k: int) -> BodyState:
    return BodyState(**{name: value[k] for name, value in vars(states).items()})


def assert_same(a: Flight, b: Flight, atol: float = 0.0) -> None:
    for x, y in zip(vars(a.states).values(), vars(b.states).values(), strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=atol)
    for name in SERIES:  # commands answer a state's rounding with the controller's gains
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=1e3 * atol)
    assert (a.outcomes, a.sentences, a.vehicles) == (b.outcomes, b.sentences, b.vehicles)
    np.testing.assert_array_equal(a.times, b.times)
