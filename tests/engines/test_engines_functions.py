"""Kernels at many places as machine code: their own numbers, and two derivatives against complex steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from aerobat.engines.floats import ArrayOps
from aerobat.engines.gradient import gradient
from aerobat.engines.llvm.functions import NO_DIRECTION, smooth_functions
from aerobat.engines.tracing import Trace
from aerobat.kernels.ops import Ops, Scalar

SHARED, WEIGHTS = np.array([3.0]), np.array([0.7, -1.3])


def kernel(
    ops: Ops, shared: Sequence[Scalar], moved: Sequence[Scalar], fixed: Sequence[Scalar]
) -> list[Scalar]:
    """Every function that a trace knows, smooth where it is looked at, and a product."""
    (x, y), (z,), (three,) = moved, fixed, shared
    root = ops.sqrt(x * x + y * y + 1.0) / (2.0 - y)
    larger = ops.maximum(root, ops.exp(-x)) - ops.minimum(x, three * y)
    return [ops.select(x < y, larger * y, -larger / (1.0 + x * x)), x * y * z]


FUNCTIONS = smooth_functions(kernel, 1, 2, 1, squares=True)


def places() -> np.ndarray:
    return np.random.default_rng(3).uniform(-1.5, 1.5, (203, 3))


def along(x: np.ndarray, direction: np.ndarray, step: complex = 1e-30j) -> np.ndarray:
    """What the kernel returns with what moves moved by a step, (2, 203)."""
    moved = x[:, :2].astype(complex) + step * direction
    return np.array(kernel(ComplexOps(), SHARED, [moved[:, 0], moved[:, 1]], [x[:, 2]]))


class ComplexOps:
    """Arithmetic of complex arrays, whose real parts decide."""

    sqrt, exp, select = staticmethod(np.sqrt), staticmethod(np.exp), staticmethod(np.where)

    @staticmethod
    def minimum(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.real(x) < np.real(y), x, y)

    @staticmethod
    def maximum(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(np.real(x) > np.real(y), x, y)


def test_a_kernel_gives_its_own_numbers_at_all_places_at_once() -> None:
    x = places()
    found = FUNCTIONS.values(SHARED, x, NO_DIRECTION)
    expected = kernel(ArrayOps, [SHARED[0]], [x[:, 0], x[:, 1]], [x[:, 2]])
    np.testing.assert_allclose(found[0], expected, rtol=1e-14)


def test_slopes_along_directions_are_those_of_complex_steps() -> None:
    x, directions = places(), np.array([[1.0, 0.0], [0.3, -2.0]])
    found = FUNCTIONS.slopes(SHARED, x, directions)
    for direction, slope in zip(directions, found, strict=True):
        np.testing.assert_allclose(slope, along(x, direction).imag / 1e-30, rtol=1e-12, atol=1e-14)


def test_the_curvature_is_that_of_differences_of_slopes_and_symmetric() -> None:
    x, pairs = places(), np.array([0.5, -0.2, 1.1])
    own = np.concatenate([x, np.tile([*WEIGHTS, *pairs], (len(x), 1))], axis=1)
    found = FUNCTIONS.curvature(SHARED, own, np.eye(2))
    np.testing.assert_allclose(found[0, 1], found[1, 0], rtol=1e-10, atol=1e-12)
    slopes = FUNCTIONS.slopes(SHARED, x, np.eye(2))
    smooth = np.abs(x[:, 0] - x[:, 1]) > 1e-3
    for k, step in enumerate(1e-6 * np.eye(3)[:2]):
        ahead, behind = (FUNCTIONS.slopes(SHARED, x + sign * step, np.eye(2)) for sign in (1.0, -1.0))
        bent = np.einsum("dom,o->dm", ahead - behind, WEIGHTS) / 2e-6
        both = np.array([[pairs[0], pairs[1] / 2], [pairs[1] / 2, pairs[2]]])
        squared = np.einsum("om,op,dpm->dm", slopes[k], both + both.T - np.diag(np.diag(both)), slopes)
        close = np.isclose(found[k], bent + squared, rtol=1e-4, atol=1e-5)
        assert close[:, smooth].mean() > 0.99


def test_what_an_input_does_not_move_has_no_slope() -> None:
    trace = Trace()
    x, other = trace.input("x"), trace.input("other")
    (slope,) = gradient(trace.exp(x), [other])
    assert trace.operations[slope.number].content == 0.0


def test_a_function_without_a_derivative_is_refused() -> None:
    trace = Trace()
    x = trace.input("x")
    with pytest.raises(ValueError, match="no derivative of less"):
        gradient(x < 1.0, [x])
