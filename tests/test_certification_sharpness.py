"""Bounds behind a certificate are attained, or nearly: no factor of them is missing, and none is too much."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev as npcheb

from aerobat.certification import Certificate, certify, quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certify import TIGHTNESS, interpolated
from aerobat.certification.enclosure import chebyshev, interpolation_error
from aerobat.certification.enclosure.interpolation_error import RHO, InterpolationError
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.environment import Environment
from aerobat.trajectory import Trajectory
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle, load_vehicle
from random_flights import random_flight, with_lags

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
    """f = e3 + δ u with any complex u: Re n ≥ r, |n − 1| ≤ 1 − r and |f|/|n| ≤ (1 + δ)/r."""
    rng = np.random.default_rng(0)
    u = rng.normal(size=(20_000, 3)) + 1j * rng.normal(size=(20_000, 3)) * rng.choice([0, 1, 9], (20_000, 1))
    u[:4] = [[0, 0, -1], [1j, 0, 0], [0, 0, 1], [0.5j, 0, -np.sqrt(0.75)]]
    f = delta * u / np.linalg.norm(u, axis=1, keepdims=True) + [0.0, 0.0, 1.0]
    n = np.sqrt(np.sum(f * f, axis=1))
    norms = np.zeros((1, 2, 4))
    norms[0, :, 1] = 1.0, delta / chebyshev.growth(1, RHO[1:2])[1, 0]
    found = interpolation_error.on_ellipses(norms, np.ones(1), VEHICLE)
    thrust, ratio = found.magnitudes.thrust[0, 1] / VEHICLE.mass, found.magnitudes.cos_tilt[0, 1]
    assert n.real.min() >= 1 - thrust
    assert np.abs(n - 1).max() <= thrust <= np.abs(n - 1).max() * (1 + 4 * delta)
    assert (np.linalg.norm(f, axis=1) / np.abs(n)).max() <= ratio


# of interpolation


TRUTH = 60  # the degree of interpolation that stands for the truth; its nodes hold those of COARSE
COARSE = 6


def swaying(first: int, second: int, depth: float = 0.4) -> Trajectory:
    """1 s of acceleration by T_first along x and T_second along y, as large as a regular piece allows."""
    terms = np.zeros((5, 3))
    larger = chebyshev.growth(4, RHO[1:2])[:, 0]
    terms[first, 0] += depth * 9.81 / larger[first] / 2
    terms[second, 1] += depth * 9.81 / larger[second] / 2
    s = np.linspace(0.0, 1.0, 5)
    acceleration = np.linalg.solve(np.vander(s, increasing=True), npcheb.chebvander(2 * s - 1, 4) @ terms)
    return Trajectory([1.0], np.polynomial.polynomial.polyint(acceleration, 2)[None])


def coarse(trajectory: Trajectory) -> tuple[ThrustCurve, ThrustCurve, Subintervals]:
    """A curve with nodes as few as can be, the same with many, and the whole as one piece."""
    curve, truth = (ThrustCurve.of(trajectory, VEHICLE, Environment(), degree) for degree in (COARSE, TRUTH))
    pieces = Subintervals.whole(1)
    assert curve.basis.degree == COARSE
    assert interpolation_error.regular(curve.norms(curve.series(curve.on(pieces)), pieces)).all()
    return curve, truth, pieces


def accuracy_of(curve: ThrustCurve, pieces: Subintervals) -> InterpolationError:
    norms = curve.norms(curve.series(curve.on(pieces)), pieces)
    seconds = pieces.seconds(curve.trajectory)
    return interpolation_error.accuracy(norms, seconds, curve.sums[pieces.interval], curve.vehicle)


def turning(curve: ThrustCurve, pieces: Subintervals) -> ThrustDirectionRates:
    """Rates in a frame of each piece's own, upright."""
    mean, seconds = np.tile([0.0, 0.0, 1.0], (len(pieces), 1)), pieces.seconds(curve.trajectory)
    return ThrustDirectionRates.along(curve.on(pieces)[..., 1:, :], mean, seconds, curve.basis)


def interpolation_errors(degree: int, series: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By how much interpolation of a degree is off a series of a higher one, and its slope, (Q,) each."""
    basis, nodes = chebyshev.basis(degree), chebyshev.basis(len(series) - 1).nodes
    interpolant = basis.analysis @ npcheb.chebval(basis.nodes, series).T
    pairs = (series, interpolant), (npcheb.chebder(series), npcheb.chebder(interpolant))
    value, slope = (
        np.abs(npcheb.chebval(nodes, exact) - npcheb.chebval(nodes, rough)).max(axis=-1)
        for exact, rough in pairs
    )
    return value, slope


@pytest.mark.parametrize("terms", [(4, 4), (4, 2), (3, 4)])
def test_interpolants_of_quantities_and_their_slopes_are_as_near_as_they_say(terms: tuple[int, int]) -> None:
    """On one coarse piece, where rounding is nothing beside what interpolation leaves open."""
    curve, truth, pieces = coarse(swaying(*terms))
    found, exact = accuracy_of(curve, pieces), turning(truth, pieces)
    values = quantities.values(VEHICLE, truth.on(pieces), *exact.body(exact.twist))[0]
    off, slope = interpolation_errors(COARSE, truth.basis.analysis @ values)
    rounding = curve.basis.lebesgue * found.rounding[0]
    assert (off <= found.remainder[0] + rounding).all()
    assert off[4] > 1e5 * rounding[4]
    steep = 2 * curve.basis.steepening * found.rounding[0]
    assert (2 * slope <= found.rate_remainder[0] + steep).all()
    assert 2 * slope[4] > 1e5 * steep[4]
    if terms == (4, 4):  # in a plane it is nearest to its bound
        assert off[4] > 0.02 * found.remainder[0, 4]
        assert 2 * slope[4] > 0.005 * found.rate_remainder[0, 4]


@pytest.mark.parametrize("terms", [(4, 3), (4, 2), (2, 1), (1, 4)])
def test_the_frames_angle_is_as_near_as_it_says(terms: tuple[int, int]) -> None:
    curve, truth, pieces = coarse(swaying(*terms))
    found = accuracy_of(curve, pieces)
    nodes = slice(None, None, TRUTH // COARSE)
    off = np.abs(turning(curve, pieces).twist - turning(truth, pieces).twist[:, nodes]).max()
    rounding = curve.basis.lebesgue * found.twist_rounding[0]
    assert 1e4 * rounding < off <= found.twist_remainder[0] + rounding


@pytest.mark.parametrize("terms", [(4, 4), (4, 2), (2, 1)])
def test_an_error_of_the_frames_angle_does_what_is_said_to_quantities_and_slopes(
    terms: tuple[int, int],
) -> None:
    _, truth, pieces = coarse(swaying(*terms))
    found, exact, turned = accuracy_of(truth, pieces), turning(truth, pieces), 1e-6
    before, after = (
        quantities.values(VEHICLE, truth.on(pieces), *exact.body(exact.twist + angle))[0, :, :4]
        for angle in (0.0, turned)
    )
    per_radian = (after - before) / turned
    slope = 2 * np.abs(npcheb.chebval(FINE, npcheb.chebder(truth.basis.analysis @ per_radian))).max(axis=1)
    size = np.abs(per_radian).max(axis=0)
    assert (size <= found.per_radian[0, :4] * 1.001).all()
    assert (slope <= found.rate_per_radian[0, :4] * 1.001 + 1e-6).all()
    assert (size > 1e-3 * found.per_radian[0, :4]).any()
    if terms == (4, 4):
        assert (slope > 3e-4 * found.rate_per_radian[0, :4]).any()


def test_an_error_of_the_frames_angle_early_on_counts_in_all_that_follows() -> None:
    """A coarse piece, then fine ones: far off the truth by no more than the error that they state."""
    early, late = (swaying(4, 3, depth).coefficients[0] for depth in (0.4, 0.05))
    both = Trajectory([1.0, 1.0], np.stack([early, late]))
    start = np.append(0.0, np.arange(64) / 64)
    pieces = Subintervals(np.append(0, np.ones(64, dtype=int)), start, np.append(1.0, np.full(64, 1 / 64)))
    curve, truth = (ThrustCurve.of(both, VEHICLE, Environment(), degree) for degree in (COARSE, TRUTH))
    rough, exact = (interpolated(each, pieces, everywhere=True) for each in (curve, truth))
    off = np.abs(rough.ends() - exact.ends()).max(axis=1)[-1, :4]
    found = accuracy_of(curve, pieces)
    own = found.remainder + curve.basis.lebesgue * found.rounding
    assert (off <= rough.error[-1, :4]).all()
    assert (off > 100 * own[-1, :4]).any()
    np.testing.assert_array_less(rough.error[1, :4], rough.error[-1, :4] * 10)


# of certificates


def gaps(certificate: Certificate, vehicle: Vehicle) -> np.ndarray:
    """Between what is proven and what is reached, in ranges of the rotors."""
    ranges = vehicle.max_thrusts - vehicle.min_thrusts
    rotors = [f for f in certificate.findings if f.quantity.startswith("rotor ")]
    return np.array([abs(f.bound - f.value) / ranges[int(f.quantity.split()[1])] for f in rotors])


@pytest.mark.parametrize("seed", [0, 2, 6, 8])
def test_what_is_proven_is_as_near_to_what_is_reached_as_promised(seed: int) -> None:
    flight = random_flight(seed)
    certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
    assert gaps(certificate, flight.vehicle).max() < 1.5 * TIGHTNESS


@pytest.mark.parametrize("terms", [(4, 3), (4, 2)])
def test_so_is_what_is_proven_of_commands(terms: tuple[int, int]) -> None:
    vehicle = load_vehicle("agile-quad")
    assert gaps(certify(swaying(*terms), vehicle), vehicle).max() < 1.5 * TIGHTNESS


FAR, PER_PLACE = 1000.0, 1e3 * np.finfo(float).eps  # [m] from the origin, and what rounding there makes of it


@pytest.mark.parametrize(
    ("derivative", "quantity", "tolerance"),
    [
        (0, "position", FAR * PER_PLACE),
        (1, "velocity", FAR * PER_PLACE * 4 / 0.5),
        (2, "thrust direction", 1e-6),
        (3, "body rate", FAR * PER_PLACE * 24 / 0.5**3 / 9.81),
    ],
)
@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_a_jump_is_told_from_rounding(
    derivative: int, quantity: str, tolerance: float, factor: float
) -> None:
    """Far from the origin, at rest before the knot; per second and per norm of the thrust as need be."""
    coefficients = np.zeros((2, 5, 3))
    coefficients[:, 0, 2] = FAR
    size = factor * tolerance * (9.81 if derivative >= 2 else 1.0)
    coefficients[1, derivative, 0] = size * 0.5**derivative / math.factorial(derivative)
    jumps = certify(Trajectory([0.5, 0.5], coefficients), VEHICLE).discontinuities
    assert [jump.quantity for jump in jumps] == ([quantity] if factor > 1 else [])
    assert all(jump.norm == pytest.approx(factor * tolerance, rel=1e-2) for jump in jumps)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_jump_of_thrust_counts_where_commands_can_tell_it(factor: float) -> None:
    """By a thousandth of the range of a lagging rotor, made by a jump of snap."""
    plus = load_vehicle("section-v")
    lagging = with_lags(plus, 0.02)
    size = factor * (plus.max_thrusts - plus.min_thrusts)[0] / 1000
    coefficients = np.zeros((2, 5, 3))
    coefficients[1, 4, 0] = (
        size * 2 * 0.3 * 9.81 / plus.inertia[1, 1] / 24
    )  # two rotors at 0.3 m make the moment
    path = Trajectory([1.0, 1.0], coefficients)
    assert certify(path, plus).discontinuities == ()
    jumps = certify(path, lagging).discontinuities
    assert [jump.norm for jump in jumps] == ([pytest.approx(size, rel=1e-6)] if factor > 1 else [])
