"""Laws of polynomials in normalised time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.trajectory import polynomial
from suites import examples

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds, degree=st.integers(0, 9), order=st.integers(0, 11))
def test_derivatives_and_values_agree_with_numpy_polynomials(seed, degree, order):
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(4, degree + 1, 3))
    s = rng.uniform(size=(4, 7))
    found = polynomial.evaluate(polynomial.differentiate(coefficients, order)[:, None], s)
    for row in range(4):
        for axis in range(3):
            expected = np.polynomial.Polynomial(coefficients[row, :, axis]).deriv(order)(s[row])
            np.testing.assert_allclose(found[row, :, axis], expected, rtol=1e-12, atol=1e-9)


@given(seed=seeds, degree=st.integers(0, 9), derivative=st.integers(0, 10))
def test_gram_matrix_is_the_integral_of_the_squared_derivative(seed, degree, derivative):
    coefficients = np.random.default_rng(seed).normal(size=degree + 1)
    squared = np.polynomial.Polynomial(coefficients).deriv(derivative) ** 2
    expected = squared.integ()(1.0)
    found = coefficients @ polynomial.gram(degree, derivative) @ coefficients
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@given(seed=seeds, count=st.integers(1, 5))
def test_hermite_takes_the_given_derivatives_at_both_ends(seed, count):
    left, right = np.random.default_rng(seed).normal(size=(2, 3, count, 3))
    coefficients = polynomial.hermite(left, right)
    for k in range(count):
        derivative = polynomial.differentiate(coefficients, k)
        np.testing.assert_allclose(polynomial.evaluate(derivative, 0.0), left[:, k], atol=1e-12)
        np.testing.assert_allclose(polynomial.evaluate(derivative, 1.0), right[:, k], atol=1e-9)


@examples(60)
@given(
    seed=seeds,
    degree=st.integers(0, 9),
    leading=st.sampled_from([1.0, 1e-3, 1e-8, 1e-11, 1e-13, 1e-16, 0.0]),
)
def test_extremes_are_found_whatever_the_leading_coefficients(seed, degree, leading):
    coefficients = np.random.default_rng(seed).normal(size=(5, degree + 1, 3))
    coefficients[:, degree // 2 + 1 :] *= leading
    points = polynomial.stationary_points(coefficients)
    norms = np.linalg.norm(polynomial.evaluate(coefficients[:, None], points), axis=-1)
    dense = np.linspace(0.0, 1.0, 4001)
    sampled = np.linalg.norm(polynomial.evaluate(coefficients[:, None], dense), axis=-1)
    assert ((points >= 0) & (points <= 1)).all()
    assert (norms.max(axis=1) >= sampled.max(axis=1) - 1e-12).all()
    assert (norms.min(axis=1) <= sampled.min(axis=1) + 1e-12).all()


def test_a_curve_through_zero_has_its_least_norm_there():
    # p(s) = (s − 0.3)·u and (s − 0.3)²·u: a simple and a fourfold zero of |p|²
    u = np.array([1.0, -2.0, 0.5])
    for factor, digits in (([-0.3, 1.0, 0.0], 1e-14), ([0.09, -0.6, 1.0], 1e-10)):
        coefficients = np.outer(factor, u)[None]
        points = polynomial.stationary_points(coefficients)
        least = np.linalg.norm(polynomial.evaluate(coefficients[:, None], points), axis=-1).min()
        assert least == pytest.approx(0.0, abs=digits)
