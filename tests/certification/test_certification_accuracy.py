"""Certificates state errors as large as they are: too small for no curve, and no larger than promised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.polynomial import chebyshev as npcheb

from aerobat.certification import Certificate, certify, quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certify import interpolated
from aerobat.certification.enclosure import chebyshev, interpolation_error
from aerobat.certification.enclosure.interpolation_error import RHO, InterpolationError
from aerobat.certification.enclosure.queries import TIGHTNESS
from aerobat.certification.quantities import MagnitudeBounds
from aerobat.certification.subdivision import subdivide
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.environment import Environment
from aerobat.kernels import flatness as kernel
from aerobat.trajectory import Trajectory
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle, load_vehicle
from random_flights import irregular, random_flight, with_lags

FINE = np.linspace(-1.0, 1.0, 2001)
VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)


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
    return curve.error_bounds(curve.norms(curve.series(curve.on(pieces)), pieces), pieces)


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
    rough, exact = (interpolated(each, pieces) for each in (curve, truth))
    off = np.abs(rough.ends() - exact.ends()).max(axis=1)[-1, :4]
    found = accuracy_of(curve, pieces)
    own = found.remainder + curve.basis.lebesgue * found.rounding
    assert (off <= rough.error[-1, :4]).all()
    assert (off > 100 * own[-1, :4]).any()
    np.testing.assert_array_less(rough.error[1, :4], rough.error[-1, :4] * 10)


@pytest.mark.parametrize("seed", range(6))
def test_quantities_are_as_large_and_as_far_off_as_what_they_are_made_of_allows(seed: int) -> None:
    """Rates of any direction: none beyond the bounds, some near them; gyroscopic moments among them."""
    rng = np.random.default_rng(seed)
    vehicle, rates, accelerations = irregular(rng), *(10 ** rng.uniform(-1, 2, 2))
    airborne = np.tile(rng.normal(size=(4, 3)) + 9.81 * np.eye(4)[1, :, None] * [0, 0, 1], (2000, 1, 1))
    unit = rng.normal(size=(4, 2000, 3))
    unit /= np.linalg.norm(unit, axis=-1, keepdims=True)
    omega, omega_dot = rates * unit[0], accelerations * unit[1]
    values = quantities.values(vehicle, airborne, omega, omega_dot)
    largest = MagnitudeBounds(np.abs(values[0, -4]), np.ones(()), np.array(rates), np.array(accelerations))
    bounds = quantities.bounds(vehicle, largest)
    reached = np.abs(values).max(axis=0)
    assert (reached <= bounds * (1 + 1e-9)).all()
    assert (reached > 0.01 * bounds).all()
    off = 1e-6 * rates, 1e-6 * accelerations
    changed = quantities.values(vehicle, airborne, omega + off[0] * unit[2], omega_dot + off[1] * unit[3])
    none = np.zeros(())
    errors = quantities.errors(vehicle, largest, MagnitudeBounds(none, none, *map(np.array, off)))
    found = np.abs(changed - values).max(axis=0)
    assert (found <= errors * (1 + 1e-4) + 1e-12 * bounds).all()
    rotors = len(vehicle.rotors)
    assert (found[:rotors] > 0.05 * errors[:rotors]).all()


@pytest.mark.parametrize(
    ("sizes", "part", "omega", "omega_dot"),
    [
        ((1.0, 0.0), 0, 1 / 2, 1 / 6),  # the thrust's own error, beside what its derivatives turn
        ((3.0, 0.0), 0, 1 / 2, 1 / 6),
        ((0.0, 3.0), 0, None, 1 / 2),
        ((1.0, 0.0), 1, 1.0, 1 / 2),
        ((3.0, 1.0), 1, 1.0, 1 / 2),
        ((0.0, 3.0), 2, None, 1.0),
    ],
)
def test_errors_of_the_thrust_do_to_body_rates_what_is_said_and_reach_a_known_fraction_of_it(
    sizes: tuple[float, float], part: int, omega: float | None, omega_dot: float
) -> None:
    """Of any direction, as are the derivatives f' and f'' of these sizes of a thrust of 1 m/s²."""
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(6, 3, 100_000))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    off = np.zeros((1, 4))
    off[0, part + 1] = 1e-6
    one, (jerk, snap) = np.ones(1), (np.full(1, size) for size in sizes)
    real = MagnitudeBounds(one, one, jerk, snap + 2 * jerk**2)
    said = interpolation_error.first_order(real, one, one, off, VEHICLE)
    before = unit[:3] * np.array([1.0, *sizes])[:, None, None]
    changes = []
    for thrust in (before, before + off[0, 1:, None, None] * unit[3:]):
        n = np.linalg.norm(thrust[0], axis=0)
        changes.append(np.array(kernel.body_rates(*(tuple(each / n) for each in thrust))))
    reached = np.linalg.norm(changes[1] - changes[0], axis=1).max(axis=1)
    if omega is not None:
        assert reached[0] == pytest.approx(omega * said.omega[0], rel=0.04)
    assert reached[1] == pytest.approx(omega_dot * said.omega_dot[0], rel=0.04)


def test_errors_of_series_are_what_the_derivation_adds_up() -> None:
    """Section 4: remainder + Λ (rounding + Σ (twist remainder + Λ twist rounding) · per radian)."""
    flight = random_flight(3)
    curve = ThrustCurve.of(flight.trajectory, flight.vehicle, flight.environment, 20)
    pieces = subdivide(curve)
    found, factor = accuracy_of(curve, pieces), 1 + 2 / np.pi * np.log(21)
    turned = np.cumsum(found.twist_remainder + factor * found.twist_rounding)[:, None]
    expected = found.remainder + factor * (found.rounding + turned * found.per_radian)
    error = interpolated(curve, pieces).error
    np.testing.assert_allclose(error, expected, rtol=1e-12)
    assert (factor * turned * found.per_radian > 0.1 * expected).any()


def is_accurate(curve: ThrustCurve, pieces: Subintervals) -> np.ndarray:
    """Section 4: what is left open is below 10⁻⁸ of what is large, 10⁻⁷ of a command, (P,)."""
    norms = curve.norms(curve.series(curve.on(pieces)), pieces)
    fine = interpolation_error.regular(norms)
    found = accuracy_of(curve, pieces[fine])
    large, lags = np.maximum(quantities.scales(curve.vehicle), found.magnitude), curve.vehicle.lags
    small = (found.remainder <= 1e-8 * large).all(axis=1)
    small &= (lags * found.rate_remainder[:, : len(lags)] <= 1e-7 * large[:, : len(lags)]).all(axis=1)
    fine[fine] = small
    return fine


@pytest.mark.parametrize("seed", [1, 3, 6, 7])
@pytest.mark.parametrize("lags", [False, True])
def test_pieces_are_as_fine_as_accuracy_asks_and_no_finer(seed: int, lags: bool) -> None:
    flight = random_flight(seed, lags)
    curve = ThrustCurve.of(flight.trajectory, flight.vehicle, flight.environment, 20)
    pieces = subdivide(curve)
    assert is_accurate(curve, pieces).all()
    halved = pieces[pieces.length < 1.0]
    twice = 2 * halved.length
    assert not is_accurate(curve, Subintervals(halved.interval, halved.start // twice * twice, twice)).any()


def test_of_a_hover_all_is_known_but_for_rounding() -> None:
    for finding in certify(Trajectory([1.0], np.zeros((1, 1, 3))), VEHICLE).findings:
        if finding.unit == "N":
            assert abs(finding.bound - finding.value) < 1e-12 * finding.value


def gaps(certificate: Certificate, vehicle: Vehicle) -> np.ndarray:
    """Between what is proven and what is reached, in ranges of the rotors."""
    ranges = vehicle.max_thrusts - vehicle.min_thrusts
    rotors = [f for f in certificate.findings if f.rotor is not None]
    return np.array([abs(f.bound - f.value) / ranges[f.rotor] for f in rotors])


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


@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_a_jump_of_direction_is_measured_by_the_thrust_at_its_knot(factor: float) -> None:
    """Which rises to g from a tenth of it, and falls again: 10⁻⁶ rad, not 10⁻⁵."""
    coefficients = np.zeros((2, 5, 3))
    coefficients[:, 3, 2] = 0.9 * 9.81 * np.array([1.0, -1.0]) / 6
    coefficients[0, 2, 2] = -0.9 * 9.81 / 2
    coefficients[1, :2, 2] = coefficients[0, :, 2].sum(), coefficients[0, :, 2] @ np.arange(5)
    coefficients[1, 2, 0] = factor * 1e-6 * 9.81 / 2
    jumps = certify(Trajectory([1.0, 1.0], coefficients), VEHICLE).discontinuities
    assert [jump.quantity for jump in jumps] == (["thrust direction"] if factor > 1 else [])


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
