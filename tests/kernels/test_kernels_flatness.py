"""Rates that flatness gives are derivatives of what they are rates of: complex steps say the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.kernels import flatness
from aerobat.kernels.vectors import dot, scale
from suites import examples

STEP = 1e-30  # imaginary: derivatives without cancellation
UP = np.array([0.0, 0.0, 1.0])
seeds = st.integers(0, 2**32 - 1)


def curve(rng: np.random.Generator) -> np.ndarray:
    """Random coefficients of a vector polynomial, its value at zero far from nothing, (6, 3)."""
    coefficients = rng.normal(size=(6, 3)) * np.array([1, 3, 6, 9, 9, 9])[:, None]
    coefficients[0] += np.array([0.0, 0.0, 3.0]) * rng.choice([-1, 1])
    return coefficients


def at(coefficients: np.ndarray, t: complex, derivative: int) -> tuple[Any, Any, Any]:
    """A derivative of a vector polynomial, in components."""
    polynomial = np.polynomial.polynomial.polyder(coefficients, derivative)
    x, y, z = np.polynomial.polynomial.polyval(t, polynomial)
    return x, y, z


def rate(of: Callable[[complex], Any]) -> np.ndarray:
    """The derivative at zero."""
    return np.asarray(of(1j * STEP)).imag / STEP


def per_norm(f: np.ndarray, t: complex) -> list[tuple[Any, Any, Any]]:
    """b3 and f', f'', f''' over |f|."""
    return [scale(1.0 / norm(f, t), at(f, t, k)) for k in range(4)]


def norm(f: np.ndarray, t: complex) -> Any:
    return dot(at(f, t, 0), at(f, t, 0)) ** 0.5


@examples(30)
@given(seeds)
def test_body_rates_turn_the_thrust_axis_as_it_moves(seed: int) -> None:
    f = curve(np.random.default_rng(seed))
    b3, jerk, snap, _ = per_norm(f, 0.0)
    omega, omega_dot = flatness.body_rates(b3, jerk, snap)
    moved = rate(lambda t: per_norm(f, t)[0])
    np.testing.assert_allclose(np.cross(omega, b3), moved, rtol=1e-9, atol=1e-9)
    gained = rate(lambda t: flatness.body_rates(*per_norm(f, t)[:3])[0])
    np.testing.assert_allclose(omega_dot, gained, rtol=1e-9, atol=1e-9 * (1 + np.abs(gained).max()))
    assert np.dot(omega, b3) == pytest.approx(0.0, abs=1e-12 * (1 + np.abs(omega).max()))


@examples(30)
@given(seeds)
def test_angular_jerk_is_the_rate_of_angular_acceleration_in_turning_axes(seed: int) -> None:
    f = curve(np.random.default_rng(seed))
    omega, omega_dot = flatness.body_rates(*per_norm(f, 0.0)[:3])
    in_world = rate(lambda t: flatness.body_rates(*per_norm(f, t)[:3])[1])
    expected = in_world - np.cross(omega, omega_dot)
    *rates, found = flatness.turning(*per_norm(f, 0.0))
    np.testing.assert_array_equal(rates, [omega, omega_dot])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * (1 + np.abs(in_world).max()))


@examples(30)
@given(seeds)
def test_the_rates_of_moment_and_collective_thrust_are_their_derivatives(seed: int) -> None:
    rng = np.random.default_rng(seed)
    omega, f, path, root = *(curve(rng) for _ in range(3)), rng.normal(size=(3, 3))
    inertia = (root @ root.T + np.eye(3)).tolist()
    mass, axial = rng.uniform(0.1, 2.0), rng.normal()
    expected = rate(lambda t: flatness.moment(inertia, at(omega, t, 0), at(omega, t, 1)))
    moment, found = flatness.moment_and_rate(inertia, *(at(omega, 0.0, k) for k in range(3)))
    np.testing.assert_array_equal(moment, flatness.moment(inertia, at(omega, 0.0, 0), at(omega, 0.0, 1)))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())

    def collective(t: complex) -> Any:
        return flatness.collective(mass, axial, norm(f, t), per_norm(f, t)[0], at(path, t, 1))

    thrust, air = (norm(f, 0.0), at(f, 0.0, 1)), (at(path, 0.0, 1), at(path, 0.0, 2))
    found = flatness.collective_rate(mass, axial, per_norm(f, 0.0)[0], thrust, air)
    assert found == pytest.approx(float(rate(collective)), rel=1e-9, abs=1e-9)


@examples(30)
@given(seeds)
def test_the_moment_is_the_rate_of_angular_momentum_seen_from_the_world(seed: int) -> None:
    """L = R J ω and L' = R M, with R' from the rates."""
    rng = np.random.default_rng(seed)
    omega, root = curve(rng), rng.normal(size=(3, 3))
    inertia = root @ root.T + np.eye(3)
    rates, accelerations = (np.array(at(omega, 0.0, k)) for k in range(2))
    h = 1e-5 / (1 + np.abs(rates).max())

    def momentum(t: float) -> np.ndarray:
        turned = so3.exp(t * rates + t**2 / 2 * accelerations)  # the attitude up to the second order
        return so3.rotate(turned, inertia @ np.array(at(omega, t, 0)))

    expected = (momentum(h) - momentum(-h)) / (2 * h)
    found = flatness.moment(inertia.tolist(), tuple(rates), tuple(accelerations))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


@examples(30)
@given(seeds)
def test_components_in_tilted_axes_are_those_of_the_smallest_rotation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    b3 = rng.normal(size=3)
    b3 /= np.linalg.norm(b3)
    across = np.cross(b3, rng.normal(size=3))
    expected = so3.unrotate(so3.smallest_rotation(UP, b3), across)
    size = 1e-12 / (1 + b3[2])
    np.testing.assert_allclose(flatness.tilted(tuple(b3), tuple(across)), expected[:2], atol=size)


@examples(30)
@given(seeds)
def test_the_specific_thrust_and_its_derivatives_belong_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path, weight, drag = curve(rng), rng.normal(size=3), rng.uniform()

    def found(t: complex) -> tuple[Any, Any, Any]:
        return flatness.specific_thrust(weight, drag, *(np.array(at(path, t, k)) for k in (1, 2, 3, 4)))

    f, df, ddf = found(0.0)
    np.testing.assert_allclose(f, np.array(at(path, 0.0, 2)) + drag * np.array(at(path, 0.0, 1)) + weight)
    np.testing.assert_allclose([df, ddf], rate(found)[:2], rtol=1e-9, atol=1e-9)
