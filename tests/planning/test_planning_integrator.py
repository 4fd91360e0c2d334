"""The condensed chain of integrators is the trajectory that its inputs make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.planning.miqp.integrator import IntegratorChain
from aerobat.trajectory import Trajectory


@given(st.sampled_from([3, 4, 5]), st.integers(1, 12), st.floats(0.02, 3.0), st.integers(0, 2**32 - 1))
def test_free_plus_forced_response_is_the_trajectory_at_every_interval_end(
    order: int, intervals: int, dt: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    initial, inputs = rng.normal(size=(order, 3)), rng.normal(size=(intervals, 3))
    chain = IntegratorChain(order, intervals)
    states = chain.free(initial, dt) + chain.forced @ (inputs * dt**order)
    trajectory = Trajectory.from_inputs(initial, inputs, dt)
    for d in range(order):
        # derivatives below the order are continuous, so either side of an end will do
        expected = trajectory.on_segments(np.array([1.0]), d)[:, 0] * dt**d
        np.testing.assert_allclose(states[:, d], expected, rtol=1e-9, atol=1e-9 * np.abs(states[:, d]).max())


@pytest.mark.parametrize(("order", "intervals"), [(2, 20), (6, 20), (4, 0), (4, -3), (4, 10**6)])
def test_a_chain_that_cannot_be_is_refused(order: int, intervals: int) -> None:
    with pytest.raises(SpecError, match=r"order|intervals"):
        IntegratorChain(order, intervals)
