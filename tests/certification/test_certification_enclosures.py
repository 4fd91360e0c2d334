"""The bounds behind a certificate contain what they bound."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import chebyshev as npcheb

from aerobat.certification import certify, quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certify import interpolated
from aerobat.certification.enclosure import chebyshev, extrema, interpolation_error
from aerobat.certification.enclosure.extrema import MAX_OPEN, SeriesBatch, enclose_maximum
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.environment import Environment
from aerobat.interchange.rows import PathRows
from aerobat.kernels import flatness
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import load_vehicle
from random_flights import random_flight
from shared_plans import closed_form
from suites import examples

seeds = st.integers(0, 2**32 - 1)
FINE = np.linspace(-1.0, 1.0, 4001)
TIGHTNESS = 1e-7


@examples(60)
@given(seed=seeds, degree=st.integers(1, 24), decay=st.floats(0.0, 1.5))
def test_the_greatest_value_of_series_is_enclosed_tightly_and_found(seed, degree, decay):
    rng = np.random.default_rng(seed)
    members, groups = 12, 3
    coefficients = rng.normal(size=(members, degree + 1)) * np.exp(-decay * np.arange(degree + 1))
    error, group = 1e-3 * rng.uniform(size=members), rng.integers(0, groups, members)
    group[:groups] = np.arange(groups)
    found = enclose_maximum(SeriesBatch(coefficients, error, group, np.ones(groups), TIGHTNESS))
    sampled = npcheb.chebval(FINE, coefficients.T)
    for g in range(groups):
        own = group == g
        tolerance = TIGHTNESS * max(1, abs(found.max[g]))
        assert found.max[g] >= (sampled.max(axis=1) + error)[own].max() - 1e-12
        assert found.min[g] >= (sampled.max(axis=1) - error)[own].max() - tolerance
        assert found.max[g] - found.min[g] <= 2 * error[own].max() + 1.1 * tolerance
        member = found.member[g]
        assert own[member]
        taken = npcheb.chebval(found.position[g], coefficients[member]) - error[member]
        assert taken == pytest.approx(found.min[g], abs=1e-12)


@pytest.mark.slow
def test_a_path_with_one_number_far_too_large_takes_no_more_intervals_than_others(monkeypatch):
    """As of a file of rows that somebody mistyped: it took minutes and gigabytes."""
    path = closed_form().trajectory
    times = np.arange(0.0, path.duration, 0.05)
    rows = np.stack([path.evaluate(times, derivative) for derivative in range(4)], axis=1)
    rows[30, 0, 0] *= 1e4
    first, whole = [], extrema.parabola_maximum

    def parabola(coefficients, flat):
        first.append(len(coefficients))
        assert len(coefficients) <= 2 * (MAX_OPEN + first[0])
        return whole(coefficients, flat)

    monkeypatch.setattr(extrema, "parabola_maximum", parabola)
    mistyped = PathRows(rows, np.diff(times)).trajectory
    assert not certify(mistyped, load_vehicle("agile-quad")).certified


@given(value=st.floats(-5, 5), count=st.integers(1, 9))
def test_of_equal_greatest_values_the_earliest_is_told(value, count):
    flat = np.zeros((count, 5))
    flat[:, 0] = value
    found = enclose_maximum(
        SeriesBatch(flat, np.zeros(count), np.zeros(count, dtype=int), np.ones(1), TIGHTNESS)
    )
    assert (found.member[0], found.position[0]) == (0, -1.0)
    assert found.min[0] == found.max[0] == pytest.approx(value)


@examples(25)
@given(seed=seeds, degree=st.integers(3, 24))
def test_halving_shrinks_all_but_a_parabola_by_eight_however_large_that_is(seed, degree):
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=degree + 1)
    coefficients[:3] *= 1e15  # rounding of which would never shrink, and enclosing would not end
    for _ in range(40):
        coefficients = rng.choice(chebyshev.basis(degree).halves) @ coefficients
    assert np.abs(coefficients[3:]).sum() <= degree**7 * 8.0**-40


@examples(25)
@given(seed=seeds, degree=st.integers(2, 24))
def test_halves_and_integrals_are_those_of_the_polynomial(seed, degree):
    basis = chebyshev.basis(degree)
    coefficients = np.random.default_rng(seed).normal(size=degree + 1)
    for half, side in zip(basis.halves, (-1, 1), strict=True):
        whole = npcheb.chebval((FINE + side) / 2, coefficients)
        np.testing.assert_allclose(npcheb.chebval(FINE, half @ coefficients), whole, atol=1e-11)
    values = npcheb.chebval(basis.nodes, coefficients)
    expected = npcheb.chebval(basis.nodes, npcheb.chebint(coefficients, lbnd=-1))
    np.testing.assert_allclose(chebyshev.integral(values, basis), expected, atol=1e-11)


@examples(25)
@given(seed=seeds, rho=st.floats(1.0, 30.0), degree=st.integers(0, 20))
def test_growth_bounds_chebyshev_polynomials_on_ellipses(seed, rho, degree):
    z = rho * np.exp(1j * np.linspace(0, 2 * np.pi, 999))
    sizes = np.abs(npcheb.chebvander((z + 1 / z) / 2, degree)).max(axis=0)
    bound = chebyshev.growth(degree, np.array([rho]))[:, 0]
    assert (sizes <= bound * (1 + 1e-9)).all()
    np.testing.assert_allclose(sizes, bound, rtol=1e-3)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("degree", [11, 14, 20])
def test_interpolation_is_as_near_as_its_bound_says_on_coarse_pieces_too(seed, degree):
    # the same pieces with a far higher degree stand for the truth
    flight = random_flight(seed)
    segments = flight.trajectory.segments
    coarse, truth = (
        ThrustCurve.of(flight.trajectory, flight.vehicle, flight.environment, k) for k in (degree, 60)
    )
    for parts in (4, 16, 64):
        start = np.tile(np.arange(parts) / parts, segments)
        pieces = Subintervals(np.repeat(np.arange(segments), parts), start, np.full(len(start), 1 / parts))
        norms = coarse.norms(coarse.series(coarse.on(pieces)), pieces)
        usable = interpolation_error.regular(norms)
        pieces, norms = pieces[usable], norms[usable]
        if not len(pieces):
            continue
        found = coarse.error_bounds(norms, pieces)
        middle = truth.at(pieces.interval, (pieces.start + pieces.length / 2)[:, None])[:, 0, 1]
        interpolants, exact = (piecewise(curve, pieces, middle) for curve in (coarse, truth))
        nodes = npcheb.chebvander(truth.basis.nodes, coarse.basis.degree)
        off = np.abs(nodes @ coarse.basis.analysis @ interpolants - exact).max(axis=1)
        twist = found.twist_remainder + coarse.basis.lebesgue * found.twist_rounding
        allowed = found.remainder + 4 * (found.rounding + twist[:, None] * found.per_radian)
        assert (off <= allowed).all()
        assert (np.abs(exact).max(axis=1) <= found.magnitude * (1 + 1e-9)).all()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("degree", [9, 14])
def test_series_in_the_carried_frame_are_as_near_as_they_say(seed, degree):
    flight = random_flight(seed)
    coarse, truth = (
        ThrustCurve.of(flight.trajectory, flight.vehicle, flight.environment, k) for k in (degree, 60)
    )
    pieces = Subintervals.whole(flight.trajectory.segments)
    for _ in range(12):
        pieces = pieces.halves()
        pieces = pieces[pieces.order()]
        if interpolation_error.regular(coarse.norms(coarse.series(coarse.on(pieces)), pieces)).all():
            break
    near, exact = (interpolated(curve, pieces) for curve in (coarse, truth))
    values = [
        np.einsum("tk,pkq->ptq", npcheb.chebvander(FINE[::50], found.series.shape[1] - 1), found.series)
        for found in (near, exact)
    ]
    assert (np.abs(values[0] - values[1]).max(axis=1) <= near.error + exact.error).all()


@pytest.mark.parametrize("seed", range(4))
def test_magnitudes_in_complex_time_stay_within_their_bounds(seed):
    """On Bernstein ellipses, with the equations of flatness in complex numbers."""
    flight = random_flight(seed)
    vehicle = replace(flight.vehicle, drag_body=np.zeros(3))
    curve = ThrustCurve.of(flight.trajectory, vehicle, Environment(), 20)
    pieces = Subintervals.whole(flight.trajectory.segments)
    for _ in range(4):
        pieces = pieces.halves()
    series, seconds = curve.series(curve.on(pieces)), pieces.seconds(flight.trajectory)
    bounds = interpolation_error.on_ellipses(curve.norms(series, pieces), seconds / 2, vehicle)
    reached = []
    for ellipse, rho in enumerate(interpolation_error.RHO[1:5], 1):
        used = np.flatnonzero(bounds.regular[:, ellipse])[:40]
        found = complex_magnitudes(series[used, :, 1:], rho, seconds[used] / 2, vehicle.mass)
        allowed = (*vars(bounds.magnitudes).values(), bounds.twist, bounds.curl)
        reached += [of / bound[used, ellipse] for of, bound in zip(found.T, allowed, strict=True)]
    ratios = np.array([np.concatenate(reached[k::6]).max() for k in range(6)])
    assert (ratios <= 1 + 1e-6).all()
    assert (ratios[[0, 1, 2, 3]] > 0.5).all()  # which are hardly larger than need be


def complex_magnitudes(series: np.ndarray, rho: float, half: np.ndarray, mass: float) -> np.ndarray:
    """What `EllipseBounds` bounds, its largest values on one ellipse about each piece, (P, 6).

    Args:
        series: Of f, f', f'' [m/s²] and so on, (P, K + 1, 3, 3).
        rho: The ellipse's.
        half: Of the pieces' durations [s], (P,).
        mass: [kg].
    """
    e3 = series[:, 0, 0] / np.linalg.norm(series[:, 0, 0], axis=-1, keepdims=True)
    e1 = np.cross(e3, np.eye(3)[np.abs(e3).argmin(axis=-1)])
    e1 /= np.linalg.norm(e1, axis=-1, keepdims=True)
    axes = np.stack([e1, np.cross(e3, e1), e3], axis=-1)
    local = (series @ axes[:, None]).transpose(0, 2, 3, 1)  # (P, 3, 3, K + 1)
    circle = rho * np.exp(1j * np.linspace(0, np.pi, 32))  # below the real line is the conjugate
    z = (circle + 1 / circle) / 2

    def at(times: np.ndarray) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray], np.ndarray]:
        f, df, ddf = np.moveaxis(local @ npcheb.chebvander(times, series.shape[1] - 1).T, (1, 2), (0, 1))
        n = np.sqrt(np.sum(f * f, axis=0))
        rates = flatness.body_rates(f / n, df / n, ddf / n)
        tilted = [np.array(flatness.tilted(f / n, rate)) for rate in rates]
        return n, tilted, f / n, half[:, None] * rates[0][2] / (1 + f[2] / n)

    n, (omega, omega_dot), b3, rate = at(z)
    # the frame's angle at z, integrated along the way from the real line's middle
    nodes, weights = np.polynomial.legendre.leggauss(12)
    angle = z / 2 * sum(w * at((1 + s) / 2 * z)[3] for s, w in zip(nodes, weights, strict=True))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    sizes = [mass * np.abs(n - np.linalg.norm(series[:, 0, 0], axis=-1)[:, None]), np.linalg.norm(b3, axis=0)]
    sizes += [np.linalg.norm(np.einsum("ij...,j...->i...", turn, x), axis=0) for x in (omega, omega_dot)]
    return np.stack([*sizes, np.abs(rate), np.abs(angle.imag)], axis=-1).max(axis=1)


def piecewise(curve: ThrustCurve, pieces: Subintervals, near: np.ndarray) -> np.ndarray:
    """The quantities at the basis's nodes, every piece in a frame of its own, about the thrust `near` it."""
    values = curve.on(pieces)
    turning = ThrustDirectionRates.along(
        values[..., 1:, :], near, pieces.seconds(curve.trajectory), curve.basis
    )
    return quantities.values(curve.vehicle, values, *turning.body(turning.twist))
