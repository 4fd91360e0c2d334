"""Scalar components compute what the array library does, on floats and on arrays of vehicles alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.engines.floats import ArrayOps, FloatOps
from aerobat.engines.pytree import components, from_components
from aerobat.kernels import quaternions, vectors

SEEDS = st.integers(0, 2**32 - 1)
COUNT = 50


def unit(rng: np.random.Generator, size: int) -> np.ndarray:
    values = rng.normal(size=(COUNT, size))
    return values / np.linalg.norm(values, axis=-1, keepdims=True)


def each(function, *arrays):
    """A kernel run on arrays of vehicles, checked against the same kernel on the floats of each."""
    batch = from_components(function(ArrayOps, *(components(a) for a in arrays)))
    alone = [function(FloatOps, *(tuple(a[k].tolist()) for a in arrays)) for k in range(COUNT)]
    np.testing.assert_allclose(batch, alone, rtol=0, atol=1e-14)
    return batch


@given(SEEDS)
def test_products_and_rotations_are_those_of_so3(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q, v, w = unit(rng, 4), unit(rng, 4), rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    close = {"rtol": 0, "atol": 1e-14}
    np.testing.assert_allclose(
        each(lambda ops, p, q: quaternions.multiply(p, q), p, q), so3.multiply(p, q), **close
    )
    np.testing.assert_allclose(
        each(lambda ops, q, v: quaternions.to_world(quaternions.axes(q), v), q, v), so3.rotate(q, v), **close
    )
    np.testing.assert_allclose(
        each(lambda ops, q, v: quaternions.to_body(quaternions.axes(q), v), q, v), so3.unrotate(q, v), **close
    )
    np.testing.assert_allclose(each(lambda ops, v, w: vectors.cross(v, w), v, w), np.cross(v, w), **close)
    np.testing.assert_allclose(
        each(lambda ops, q: quaternions.normalize(ops, q), 3 * q), so3.normalize(3 * q), **close
    )


@given(SEEDS)
def test_the_smallest_rotation_is_that_of_so3(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = unit(rng, 3), unit(rng, 3)
    normal = so3.thrust_axis(so3.smallest_rotation([1.0, 0.0, 0.0], a))
    np.testing.assert_allclose(
        each(quaternions.smallest_rotation, a, b, normal), so3.smallest_rotation(a, b), rtol=0, atol=1e-12
    )


def test_opposite_directions_are_a_half_turn_apart_and_near_it_only_rounding_grows() -> None:
    a, normal = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    assert quaternions.smallest_rotation(FloatOps, a, (0.0, 0.0, -1.0), normal) == (0.0, *normal)
    for gap in (1e-3, 1e-6, 1e-9):
        b = (0.0, np.sin(gap), -np.cos(gap))
        q = quaternions.smallest_rotation(FloatOps, a, b, normal)
        np.testing.assert_allclose(so3.rotate(q, a), b, rtol=0, atol=1e-15 / gap)


@pytest.mark.parametrize("ops", [FloatOps, ArrayOps])
def test_a_vector_is_shortened_to_the_limit_and_keeps_its_direction(ops) -> None:
    np.testing.assert_allclose(vectors.clamp_norm(ops, (3.0, 0.0, 4.0), 2.0), (1.2, 0.0, 1.6), rtol=1e-15)
    assert vectors.clamp_norm(ops, (0.3, 0.0, 0.4), 2.0) == (0.3, 0.0, 0.4)
    assert vectors.clamp_norm(ops, (0.0, 0.0, 0.0), 0.0) == (0.0, 0.0, 0.0)


@given(SEEDS)
def test_angles_between_attitudes_are_those_of_so3(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, turn = unit(rng, 4), rng.normal(size=(COUNT, 3)) * 10.0 ** rng.uniform(-9, 0.5, (COUNT, 1))
    q = so3.multiply(p, so3.exp(turn))
    angles = each(lambda ops, p, q: (quaternions.angle_between(ops, p, q),), p, q)[:, 0]
    np.testing.assert_allclose(angles, so3.angle_between(p, q), rtol=0, atol=1e-14)


def test_the_arc_tangent_is_right_to_the_last_digit_but_one() -> None:
    y, x = np.abs(np.random.default_rng(0).normal(size=(2, 100_000)))
    np.testing.assert_allclose(quaternions.atan2(ArrayOps, y, x), np.arctan2(y, x), rtol=5e-16)
    assert quaternions.atan2(FloatOps, 0.0, 1.0) == 0.0
    assert quaternions.atan2(FloatOps, 1.0, 0.0) == pytest.approx(np.pi / 2)


@given(SEEDS)
def test_each_component_is_clipped_to_the_same_range_about_zero(seed: int) -> None:
    v = 3.0 * np.random.default_rng(seed).normal(size=(COUNT, 3))
    clipped = each(lambda ops, v: vectors.clip_components(ops, v, 1.5), v)
    np.testing.assert_array_equal(clipped, np.clip(v, -1.5, 1.5))
    np.testing.assert_array_equal(vectors.ZERO, np.zeros(3))
