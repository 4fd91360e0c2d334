"""Rotations obey the group's laws, and agree with SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aerobat import so3

finite = st.floats(-3.0, 3.0)
vectors = st.tuples(finite, finite, finite).map(np.array)
quaternions = (
    st.tuples(*[st.floats(-1, 1)] * 4)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(so3.normalize)
)
units = vectors.filter(lambda v: np.linalg.norm(v) > 0.1).map(lambda v: v / np.linalg.norm(v))


def scipys(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


@given(quaternions, quaternions, vectors)
def test_products_and_rotations_agree_with_scipy(p: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
    both = scipys(p) * scipys(q)
    np.testing.assert_allclose(so3.rotate(so3.multiply(p, q), v), both.apply(v), atol=1e-12)
    np.testing.assert_allclose(so3.axes(q), scipys(q).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(so3.angle_between(p, q), (scipys(p).inv() * scipys(q)).magnitude(), atol=1e-7)


@given(quaternions, quaternions, quaternions)
def test_the_product_is_associative_and_the_conjugate_its_inverse(
    p: np.ndarray, q: np.ndarray, r: np.ndarray
) -> None:
    left = so3.multiply(so3.multiply(p, q), r)
    np.testing.assert_allclose(left, so3.multiply(p, so3.multiply(q, r)), atol=1e-12)
    np.testing.assert_allclose(so3.multiply(q, so3.conjugate(q)), so3.IDENTITY, atol=1e-12)


@given(vectors)
def test_log_undoes_exp_up_to_half_a_turn(phi: np.ndarray) -> None:
    angle = np.linalg.norm(phi)
    again = so3.log(so3.exp(phi))
    assert np.linalg.norm(again) <= np.pi + 1e-12
    if angle < np.pi:
        np.testing.assert_allclose(again, phi, atol=1e-9)


@given(quaternions, vectors.filter(lambda v: np.linalg.norm(v) < 3.0))
def test_box_minus_undoes_a_turn_in_body_axes(q: np.ndarray, phi: np.ndarray) -> None:
    np.testing.assert_allclose(so3.box_minus(so3.multiply(q, so3.exp(phi)), q), phi, atol=1e-9)


@given(units, units)
def test_the_smallest_rotation_takes_one_vector_to_the_other_by_the_angle_between(
    a: np.ndarray, b: np.ndarray
) -> None:
    q = so3.smallest_rotation(a, b)
    np.testing.assert_allclose(so3.rotate(q, a), b, atol=1e-9)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)
    assert so3.angle_between(so3.IDENTITY, q) == pytest.approx(angle, abs=1e-7)


@pytest.mark.parametrize("offset", [1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4])
def test_the_smallest_rotation_is_accurate_next_to_the_opposite(offset: float) -> None:
    rng = np.random.default_rng(0)
    a = rng.normal(size=(1000, 3))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = offset * rng.normal(size=a.shape) - a
    b /= np.linalg.norm(b, axis=1, keepdims=True)
    np.testing.assert_allclose(so3.rotate(so3.smallest_rotation(a, b), a), b, atol=1e-11)


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), np.array([0.6, 0.0, -0.8])])
def test_the_smallest_rotation_to_the_opposite_is_half_a_turn(axis: np.ndarray) -> None:
    np.testing.assert_allclose(so3.rotate(so3.smallest_rotation(axis, -axis), axis), -axis, atol=1e-12)


@given(vectors, vectors)
def test_the_cross_product_is_numpys(a: np.ndarray, b: np.ndarray) -> None:
    np.testing.assert_allclose(so3.cross(a, b), np.cross(a, b), atol=1e-12)


@given(quaternions, st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_the_twist_is_the_turn_about_z_whatever_swing_is_beside_it(
    p: np.ndarray, angle: float, x: float, y: float
) -> None:
    turn, swing = so3.about_axis(so3.UP, angle), so3.exp(np.array([x, y, 0.0]))
    for both in (so3.multiply(turn, swing), so3.multiply(swing, turn)):
        off = so3.twist(p, so3.multiply(p, both)) - angle
        assert abs((off + np.pi) % (2 * np.pi) - np.pi) < 1e-9


def test_leading_axes_broadcast() -> None:
    rng = np.random.default_rng(0)
    q, v = so3.normalize(rng.normal(size=(5, 1, 4))), rng.normal(size=(7, 3))
    together = so3.rotate(q, v)
    assert together.shape == (5, 7, 3)
    np.testing.assert_allclose(together[3, 2], so3.rotate(q[3, 0], v[2]), atol=1e-15)
