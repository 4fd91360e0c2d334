"""The filter in the loop, its sensors simulated, the controller flying by what it says."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.pytree import from_components, tree_stack
from aerobat.kernels.ekf.covariance import unpack
from aerobat.kernels.imu import ImuSample
from aerobat.simulation import prepare
from ekf_flights import CONVERGED, STRIDE, planned

LATENCY = 10  # ticks of `lab`


def filter_row(signals: Any) -> Any:
    """The truth, the filter's state, and the true biases."""
    return signals.plant.body, signals.observer.own.filter, signals.of(ImuSample)


def fused_errors(plan: ab.Plan, conditions: ab.Dispersion, flights: range) -> tuple[Array, Array, Array]:
    """Errors of 15 after each pose, (flights, poses, 15), their covariances, and the poses' NIS."""
    setup = prepare(plan, config=ab.FlightConfig(conditions=conditions, flights=flights))
    loop = setup.compile(log=filter_row)
    carry, parts = loop.init(setup.first_tick), []
    for begin, end in setup.chunks():
        carry, rows = loop.scan(carry, setup.inputs(begin, end))
        parts.append(rows)
    body, state, bias = tree_stack(parts, lambda leaves: np.concatenate(leaves, axis=-1))
    poses = slice(LATENCY, None, STRIDE)
    nominal = state.nominal
    error = np.concatenate(
        [
            from_components(body.position) - from_components(nominal.position),
            from_components(body.velocity) - from_components(nominal.velocity),
            so3.box_minus(from_components(body.q_world_body), from_components(nominal.q_world_body)),
            from_components(bias.omega) - from_components(nominal.gyro_bias),
            from_components(bias.specific_force) - from_components(nominal.accelerometer_bias),
        ],
        axis=-1,
    )
    covariance = np.moveaxis(np.array(unpack(state.covariance)), (0, 1), (-2, -1))
    return error[:, poses], covariance[:, poses], state.nis[:, poses]


@pytest.mark.parametrize(
    ("numbers", "flights"), [((0,), 3), pytest.param((0, 1), 50, marks=pytest.mark.slow)]
)
def test_errors_in_flips_are_as_large_as_the_filter_says_and_small(
    numbers: tuple[int, ...], flights: int
) -> None:
    """`lab` without what no filter reckons with: outliers, dropouts and a second camera system."""
    lab = ab.load_dispersion("lab")
    assert lab.motion_capture is not None
    capture = replace(lab.motion_capture, dropout=0.0, outlier=0.0, hand_off=None)
    conditions = replace(lab, motion_capture=capture)
    runs = [
        fused_errors(planned(k), conditions, range(50 * k, 50 * k + flights))  # no two with the same draw
        for k in numbers
    ]
    poses = min(run[0].shape[1] for run in runs)
    error, covariance, nis = (np.concatenate([run[k][:, :poses] for run in runs]) for k in range(3))
    nees = np.einsum("nti,nti->nt", error, np.linalg.solve(covariance, error[..., None])[..., 0])
    count = len(nees)
    assert count == len(numbers) * flights
    for values, freedoms in ((nees, 15), (nis, 6)):
        low, high = chi2.ppf([0.025, 0.975], count * freedoms) / count
        assert low < values.mean() < high
        at_each_pose = values.mean(axis=0)
        # nearly all of the instants, which hang together: the filter is a little more modest than it need be
        assert ((at_each_pose > low) & (at_each_pose < high)).mean() > 0.75
    settled = error[:, CONVERGED // STRIDE :]
    position, attitude = (np.sqrt((settled[..., k : k + 3] ** 2).sum(axis=-1).mean()) for k in (0, 6))
    assert position < 0.001
    assert np.degrees(attitude) < 0.15
