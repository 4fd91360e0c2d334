"""The JAX engine: the numbers of floats in either precision, whatever JAX is set to; compiled once."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from aerobat.engines import FLOATS, Engine, run_whole

jax = pytest.importorskip("jax")
from aerobat.engines.jax import ENGINE, SINGLE  # noqa: E402 - after what it needs

TICKS, VEHICLES = 3000, 5


class Swing(NamedTuple):
    """A pendulum's output: where it is, and whether it has been beyond half a radian."""

    angle: Any
    speed: Any
    beyond: Any
    constant: Any


def init(ops: Any, stiffness: Any, push: Any) -> Any:
    return (0.0, ops.sqrt(stiffness)), False


def step(ops: Any, stiffness: Any, carry: Any, push: Any) -> Any:
    """Every operation of the kernels' arithmetic, in a motion that stays bounded."""
    (angle, speed), beyond = carry
    common, own = push
    force = ops.minimum(ops.maximum(-stiffness * angle, -2.0), 2.0) + common + own
    speed = (speed + 0.01 * force) * ops.exp(-0.001 / stiffness)
    angle = angle + 0.01 * ops.select((speed > 0.0) & (angle <= 3.0), speed, 0.9 * speed)
    return ((angle, speed), beyond), Swing(angle, speed, ops.select(angle > 1.5, True, beyond), 1.0)


def swung(engine: Engine, ticks: int = TICKS, seed: int = 0) -> Swing:
    rng = np.random.default_rng(seed)
    pushes = 9.0 * rng.normal(size=ticks), 9.0 * rng.normal(size=(ticks, VEHICLES))
    answer: Swing = run_whole(engine, init, step, rng.uniform(0.5, 2.0, VEHICLES), pushes)
    return answer


@pytest.mark.parametrize(("engine", "atol"), [(ENGINE, 1e-12), (SINGLE, 1e-3)], ids=["float64", "float32"])
def test_all_arithmetic_agrees_with_floats_in_either_precision(engine: Engine, atol: float) -> None:
    expected, found = swung(FLOATS), swung(engine)
    assert type(found) is Swing
    assert found.beyond.dtype == bool
    for name in ("angle", "speed", "constant"):
        value = getattr(found, name)
        assert value.dtype == np.float64
        np.testing.assert_allclose(value, getattr(expected, name), rtol=0, atol=atol)
    np.testing.assert_array_equal(found.beyond, expected.beyond)
    assert 0 < found.beyond.sum() < found.beyond.size


@pytest.mark.parametrize("set_to", [False, True])
def test_the_precision_that_jax_is_set_to_is_neither_used_nor_changed(set_to: bool) -> None:
    exact, single = swung(ENGINE), swung(SINGLE)
    with jax.enable_x64(set_to):
        np.testing.assert_array_equal(swung(ENGINE).angle, exact.angle)
        np.testing.assert_array_equal(swung(SINGLE).angle, single.angle)
        assert jax.config.jax_enable_x64 == set_to
        assert jax.numpy.ones(1).dtype == (np.float64 if set_to else np.float32)


@pytest.mark.slow
def test_loops_of_the_same_operations_are_compiled_once(caplog) -> None:
    """Other numbers, closures and a few ticks more change nothing; another operation does."""

    def steeper(ops: Any, stiffness: Any, carry: Any, push: Any) -> Any:
        return step(ops, stiffness * stiffness, carry, push)

    def compiled(step_: Any, seed: int, ticks: int) -> int:
        rng = np.random.default_rng(seed)
        pushes = rng.normal(size=ticks), rng.normal(size=(ticks, 3))
        caplog.clear()
        with jax.log_compiles():
            run_whole(ENGINE, init, lambda *given: step_(*given), rng.uniform(0.5, 2.0, 3), pushes)
        return sum(
            "_scanned" in record.message and "Compiling" in record.message for record in caplog.records
        )

    assert [compiled(step, *given) for given in ((0, 40), (1, 40), (2, 53))] == [1, 0, 0]
    assert [compiled(steeper, seed, 40) for seed in (0, 1)] == [1, 0]
