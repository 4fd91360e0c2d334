"""Dual numbers: the chain rule through any kernel, the same under every engine."""

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.engines import FLOATS, choose, run_whole
from aerobat.engines.duals import Dual, DualOps, differentiated, dual
from aerobat.engines.floats import ArrayOps, FloatOps
from suites import examples

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402 - after what it needs

INPUTS = 3
SMOOTH: tuple[Callable[..., Any], ...] = (
    lambda ops, x, y: x + y,
    lambda ops, x, y: x - y,
    lambda ops, x, y: x * y,
    lambda ops, x, y: x / (1.5 + y * y),
    lambda ops, x, y: 2.0 - x + y * 0.5,
    lambda ops, x, y: 1.0 / (2.0 + x * x),
    lambda ops, x, y: -x,
    lambda ops, x, y: ops.sqrt(1.0 + x * x),
    lambda ops, x, y: ops.exp(-(x * x) - y * y),
)
KINKED: tuple[Callable[..., Any], ...] = (
    lambda ops, x, y: ops.minimum(x, y),
    lambda ops, x, y: ops.maximum(x, 0.25),
    lambda ops, x, y: ops.select(x < y, x * y, y),
    lambda ops, x, y: ops.select((x > 0.1) & (y <= 0.3), 1.0, x),
)


class JaxOps:
    """JAX's own arithmetic, which differentiates in its own way."""

    sqrt, exp, minimum, maximum, select = jnp.sqrt, jnp.exp, jnp.minimum, jnp.maximum, jnp.where


def programs(functions: tuple[Callable[..., Any], ...]) -> st.SearchStrategy[Any]:
    """Kernels of a few operations, each of two earlier values."""
    place = st.integers(0, INPUTS + 9)
    line = st.tuples(st.sampled_from(functions), place, place)
    return st.lists(line, min_size=1, max_size=10)


def run(program: Any, ops: Any, inputs: Any) -> Any:
    values = list(inputs)
    for function, i, j in program:
        values.append(function(ops, values[i % len(values)], values[j % len(values)]))
    return values[-1]


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    at, along = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, INPUTS))
    return at, along


@given(program=programs(SMOOTH), seed=st.integers(0, 1000))
def test_slopes_are_limits_of_differences(program: Any, seed: int) -> None:
    at, along = drawn(seed)
    slope = dual(run(program, DualOps(FloatOps), map(Dual, at, along))).tangent
    assert slope is not None
    wanted = richardson(lambda h: run(program, FloatOps, at + h * along), 1e-3)
    assert slope == pytest.approx(wanted, rel=1e-7, abs=1e-7)


def richardson(function: Callable[[float], float], h: float) -> float:
    """The derivative at zero, to the fourth order of h."""
    wide, narrow = ((function(x) - function(-x)) / (2 * x) for x in (h, h / 2))
    return (4 * narrow - wide) / 3


@examples(40)
@given(program=programs(SMOOTH + KINKED), seed=st.integers(0, 1000))
def test_slopes_are_those_of_jax(program: Any, seed: int) -> None:
    at, along = drawn(seed)
    with jax.enable_x64(True):
        value, wanted = jax.jvp(lambda *x: run(program, JaxOps, x), tuple(at), tuple(along))
    got = dual(run(program, DualOps(FloatOps), map(Dual, at, along)))
    assert got.value == pytest.approx(float(value), rel=1e-13, abs=1e-13)
    assert (got.tangent or 0.0) == pytest.approx(float(wanted), rel=1e-12, abs=1e-12)


@given(program=programs(SMOOTH + KINKED), seed=st.integers(0, 1000))
def test_values_are_those_of_the_plain_kernel_to_the_last_bit(program: Any, seed: int) -> None:
    at, along = drawn(seed)
    got = dual(run(program, DualOps(FloatOps), map(Dual, at, along)))
    assert got.value == run(program, FloatOps, at.tolist())


def test_no_slope_comes_of_none() -> None:
    ops, x, y = DualOps(FloatOps), Dual(2.0), Dual(3.0)
    results = (x + y, x - 1.0, 1.0 - x, x * y, x / y, -x, x**3, ops.sqrt(x), ops.exp(x), ops.minimum(x, y))
    assert all(result.tangent is None for result in results)


def test_at_a_kink_the_slope_is_that_of_the_second_and_the_root_of_zero_has_none() -> None:
    ops, x, y = DualOps(FloatOps), Dual(1.0, 2.0), Dual(1.0, 3.0)
    assert ops.minimum(x, y).tangent == ops.maximum(x, y).tangent == 3.0
    root = DualOps(ArrayOps).sqrt(Dual(np.array([0.0, 4.0]), np.array([1.0, 1.0])))
    np.testing.assert_array_equal(root.tangent, [0.0, 0.25])


def test_powers_and_comparisons_are_those_of_values() -> None:
    x = Dual(2.0, 5.0)
    assert ((x**3).value, (x**3).tangent) == (8.0, 60.0)
    compared = (operator.lt, operator.le, operator.gt, operator.ge, operator.eq, operator.ne)
    assert [f(x, 2.0) for f in compared] == [False, True, False, True, True, False]
    assert [f(1.0, x) for f in compared] == [True, True, False, False, False, True]
    assert x == Dual(2.0, 7.0) != Dual(3.0, 5.0)


def begin(ops: Any, rate: Any, push: Any) -> Any:
    return 1.0, False  # plain constants, one of which will have a slope


def grow(ops: Any, rate: Any, carry: Any, push: Any) -> Any:
    x, ever = carry
    x = x * rate + push
    return (x, ops.select(x > 2.0, True, ever)), (x, ops.select(ever, 0.0, x))


@pytest.mark.parametrize("engine", ["floats", "compiled", pytest.param("jax", marks=pytest.mark.slow)])
def test_a_loop_carries_slopes_along(engine: str) -> None:
    """x_n = a^n has the slope n a^(n-1), whatever runs the loop."""
    rate, ticks = np.array([0.9, 1.0, 1.01, 1.02, 1.1]), 50
    parameters, inputs = (rate, (np.ones_like(rate),)), (np.zeros(ticks), ((),))
    values, slopes = run_whole(
        choose(engine, len(rate), ticks), *differentiated(begin, grow), parameters, inputs
    )
    n = np.arange(1, ticks + 1)
    np.testing.assert_allclose(values[0], rate[:, None] ** n, rtol=1e-13)
    np.testing.assert_allclose(slopes[0], n * rate[:, None] ** (n - 1), rtol=1e-13)
    np.testing.assert_array_equal(slopes[1] == 0.0, values[1] == 0.0)


def test_inputs_have_slopes_too() -> None:
    """Of a push at every tick, Σ a^k."""
    inputs = (np.zeros(5), (np.ones(5),))
    _, slopes = run_whole(FLOATS, *differentiated(begin, grow), (np.array([0.5]), ((),)), inputs)
    np.testing.assert_allclose(slopes[0][0], np.cumsum(0.5 ** np.arange(5)))
