"""Bounds behind a certificate are attained, or nearly: no factor of them is missing, and none is too much."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import chebyshev as npcheb

from aerobat.certification.enclosure import chebyshev, interpolation_error
from aerobat.certification.enclosure.interpolation_error import RHO
from aerobat.vehicle import load_vehicle
from random_flights import with_lags

FINE = np.linspace(-1.0, 1.0, 2001)
VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)


# of Chebyshev series


@pytest.mark.parametrize("degree", [1, 2, 5, 20])
def test_interpolants_of_chebyshev_polynomials_are_as_near_as_tails_say_and_no_nearer(degree: int) -> None:
    """T_k beyond the degree is at most γ_k on an ellipse, and is taken for T_j, 2K − k or so."""
    basis = chebyshev.basis(degree)
    ratios = []
    for k in range(degree + 1, degree + 6):
        unit = np.eye(k + 1)[k]
        interpolant = basis.analysis @ npcheb.chebval(basis.nodes, unit)
        off = np.abs(npcheb.chebval(FINE, unit) - npcheb.chebval(FINE, interpolant)).max()
        slope = np.abs(
            npcheb.chebval(FINE, npcheb.chebder(unit)) - npcheb.chebval(FINE, basis.derivative @ interpolant)
        ).max()
        size = chebyshev.growth(k, RHO[1:])[k]
        bounds = np.array(chebyshev.tails(degree, RHO[1:])) * size
        assert (np.array([[off], [slope]]) <= bounds * (1 + 1e-9)).all()
        ratios.append(off / bounds[0])
    assert ratios[0][-1] > 0.75  # of the first beyond, on the largest ellipse: |T_3 − T_1| is 1.54 at most


@pytest.mark.parametrize("degree", [1, 2, 5, 20])
def test_tails_are_their_sums(degree: int) -> None:
    k = np.arange(degree + 1, degree + 400)[:, None]
    sums = [np.sum(4.0 * k**power * RHO[1:] ** -k.astype(float), axis=0) for power in (0, 2)]
    np.testing.assert_allclose(chebyshev.tails(degree, RHO[1:]), sums, rtol=1e-12)


@pytest.mark.parametrize("degree", [1, 2, 5, 10, 20, 40])
def test_errors_of_values_grow_by_lebesgues_constant_and_those_of_slopes_by_markovs(degree: int) -> None:
    basis = chebyshev.basis(degree)
    cardinal = npcheb.chebvander(FINE, degree) @ basis.analysis
    magnified = np.abs(cardinal).sum(axis=1).max()
    assert magnified <= basis.lebesgue <= 1.5 * magnified
    slopes = npcheb.chebvander(FINE, degree) @ basis.derivative @ basis.analysis
    assert np.abs(slopes).sum(axis=1).max() == pytest.approx(basis.steepening, rel=1e-9)


# of flatness in complex time


def around(pair: tuple[tuple[int, int], tuple[int, int]], sizes: tuple[float, float]) -> np.ndarray:
    """f = e3 + sizes T_k along axes, with f' and f'' as their derivatives, in 2 s, (30, 3, 3)."""
    series = np.zeros((30, 3, 3))
    series[0, 0, 2] = 1.0
    for (k, axis), size in zip(pair, sizes, strict=True):
        series[k, 0, axis] += size
    for derivative in (1, 2):
        series[:-1, derivative] = npcheb.chebder(series[:, derivative - 1])
    return series


@pytest.mark.parametrize("rho", [1, 3, 6, 9])
def test_small_turns_reach_the_bounds_on_thrust_rate_and_angular_acceleration(rho: int) -> None:
    """The thrust grows along itself, or turns: either is all that its series allows, to first order."""
    for axis, quantity in ((2, "thrust"), (0, "omega"), (0, "omega_dot")):
        size = 1e-3 / chebyshev.growth(9, RHO[rho : rho + 1])[9, 0]
        series = around(((9, axis), (0, 2)), (size, 0.0))
        z = (RHO[rho] + 1 / RHO[rho]) / 2
        f, df, ddf = (npcheb.chebval(z, series[:, k]) for k in range(3))
        truth = {
            "thrust": VEHICLE.mass * abs(f[2] - 1.0),
            "omega": abs(df[0] * f[2]) / (f @ f),
            "omega_dot": abs(ddf[0]),
        }
        norms = np.concatenate([np.zeros((1, 30, 1)), np.linalg.norm(series, axis=-1)[None]], axis=-1)
        found = interpolation_error.on_ellipses(norms, np.ones(1), VEHICLE)
        bound = getattr(found.magnitudes, quantity)[0, rho]
        assert truth[quantity] <= bound <= truth[quantity] * 1.01


@pytest.mark.parametrize("rho", [1, 3, 6])
def test_the_frame_turns_by_as_much_as_its_bound_says_where_slow_and_fast_turns_meet(rho: int) -> None:
    """Slow along x, fast along y: what is swept is |f × f'|, their product."""
    gamma = chebyshev.growth(29, RHO[rho : rho + 1])[:, 0]
    series = around(((1, 0), (29, 1)), (1e-2 / gamma[1], 3e-3 / gamma[29]))
    z = (RHO[rho] + 1 / RHO[rho]) / 2
    f, df = (npcheb.chebval(z, series[:, k]) for k in range(2))
    n = np.sqrt(f @ f)
    truth = abs((f[0] * df[1] - f[1] * df[0]) / (n * (n + f[2])))
    norms = np.concatenate([np.zeros((1, 30, 1)), np.linalg.norm(series, axis=-1)[None]], axis=-1)
    for half in (1.0, 0.3):
        bound = interpolation_error.on_ellipses(norms, np.array([half]), VEHICLE).twist[0, rho]
        assert half * truth <= bound <= half * truth * 1.6


@pytest.mark.parametrize("delta", [0.05, 0.2, 0.4])
def test_the_root_of_the_thrusts_square_keeps_its_distance_from_zero(delta: float) -> None:
    """f = e3 + δ u with any complex u: bounds of Re n, |n − 1| and |b3| hold, the first two attained."""
    rng = np.random.default_rng(0)
    u = rng.normal(size=(20_000, 3)) + 1j * rng.normal(size=(20_000, 3)) * rng.choice([0, 1, 9], (20_000, 1))
    u[:4] = [[0, 0, -1], [1j, 0, 0], [0, 0, 1], [0.5j, 0, -np.sqrt(0.75)]]
    f = delta * u / np.linalg.norm(u, axis=1, keepdims=True) + [0.0, 0.0, 1.0]
    n = np.sqrt(np.sum(f * f, axis=1))
    norms = np.zeros((1, 2, 4))
    norms[0, :, 1] = 1.0, delta / chebyshev.growth(1, RHO[1:2])[1, 0]
    found = interpolation_error.on_ellipses(norms, np.ones(1), VEHICLE)
    thrust, ratio = found.magnitudes.thrust[0, 1] / VEHICLE.mass, found.magnitudes.cos_tilt[0, 1]
    assert found.root[0, 1] - 1e-9 <= n.real.min() <= found.root[0, 1] + 1e-9
    assert np.abs(n - 1).max() <= thrust <= np.abs(n - 1).max() * (1 + 1.3 * delta)
    reached = (np.linalg.norm(f, axis=1) / np.abs(n)).max()
    assert reached <= ratio <= reached * (1 + delta) / (1 - delta)
