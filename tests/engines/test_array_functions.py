"""Functions of arrays made of traces: the kernel's own numbers, and gradients against differences."""

from __future__ import annotations

import numpy as np
import pytest

from aerobat.engines.array_functions import array_function, gradient
from aerobat.engines.floats import ArrayOps
from aerobat.engines.tracing import Trace, TraceOps
from aerobat.kernels.ops import Ops, Scalar


def kernel(ops: Ops, x: Scalar, y: Scalar) -> Scalar:
    """Every function that a trace knows, smooth where it is looked at."""
    root = ops.sqrt(x * x + y * y + 1.0) / (2.0 - y)
    larger = ops.maximum(root, ops.exp(-x)) - ops.minimum(x, 3.0 * y)
    return ops.select(x < y, larger * y, -larger / (1.0 + x * x))


def traced() -> tuple[Trace, list, object]:
    trace = Trace()
    inputs = [trace.input("x"), trace.input("y")]
    return trace, inputs, kernel(TraceOps(trace), *inputs)


def samples() -> np.ndarray:
    return np.random.default_rng(3).uniform(-1.5, 1.5, (2, 200))


def test_a_traced_kernel_gives_its_own_numbers_for_all_entries_at_once() -> None:
    _, inputs, value = traced()
    x = samples()
    (found,) = array_function(inputs, [value])(list(x))
    np.testing.assert_array_equal(found, kernel(ArrayOps, *x))


def test_a_gradient_is_that_of_a_complex_step() -> None:
    _, inputs, value = traced()
    function, slopes = array_function(inputs, [value]), array_function(inputs, gradient(value, inputs))
    x = samples()
    for k, slope in enumerate(slopes(list(x))):
        moved = x.astype(complex)
        moved[k] += 1e-30j
        np.testing.assert_allclose(slope, function(list(moved))[0].imag / 1e-30, rtol=1e-12, atol=1e-14)


def test_slopes_of_a_gradient_are_symmetric_second_derivatives() -> None:
    _, inputs, value = traced()
    slopes = array_function(inputs, gradient(value, inputs))
    x, second = samples(), np.zeros((2, 2, 200))
    for k in range(2):
        moved = x.astype(complex)
        moved[k] += 1e-30j
        second[k] = np.imag(slopes(list(moved))) / 1e-30
    np.testing.assert_allclose(second, second.swapaxes(0, 1), rtol=1e-10, atol=1e-12)


def test_what_an_input_does_not_move_has_no_slope() -> None:
    trace, inputs, value = traced()
    other = trace.input("other")
    (slope,) = array_function([*inputs, other], gradient(value, [other]))([1.0, 2.0, 3.0])
    assert slope == 0.0


def test_an_operation_without_a_derivative_is_named() -> None:
    trace = Trace()
    x = trace.input("x")
    with pytest.raises(ValueError, match="no derivative of less"):
        gradient(x < 1.0, [x])
