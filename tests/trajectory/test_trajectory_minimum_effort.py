"""Laws of minimum-effort polynomials: what is given is met, the rest is optimal, digits are kept."""

import math

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import strategies as st

from aerobat.certification import certify
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.planning import RotorMargin
from aerobat.trajectory import ContinuityRule, Trajectory, minimum_effort, polynomial
from aerobat.vehicle import load_vehicle
from minimum_effort_reference import exact_coefficients
from suites import examples

CODE = Environment(gravity=9.80665)  # of the authors' evalTrajFeasibility.m

seeds = st.integers(0, 2**32 - 1)
orders = st.integers(3, 5)
ROUNDING = np.finfo(float).eps
EXTENDED = np.finfo(np.longdouble).eps < ROUNDING  # whether residuals have more digits than float64

# from rest to rest over the unit interval: the odd smoothsteps
SMOOTHSTEPS = {
    3: [0, 0, 0, 10, -15, 6],
    4: [0, 0, 0, 0, 35, -84, 70, -20],
    5: [0, 0, 0, 0, 0, 126, -420, 540, -315, 70],
}


def course(positions, order):
    """Through positions (n + 1, 3), from rest to rest."""
    given = np.full((len(positions), order, 3), np.nan)
    given[:, 0] = positions
    given[[0, -1], 1:] = 0.0
    return given


def random_course(seed, order, segments=5, spread=4.0):
    """Some derivatives given at every knot, others on each axis, all of them at the start."""
    rng = np.random.default_rng(seed)
    given = rng.normal(size=(segments + 1, order, 3))
    given[rng.random(given.shape) < rng.uniform(0.2, 0.9)] = np.nan
    given[-1, 0] = rng.normal(size=3)
    given[0] = rng.normal(size=(order, 3))
    return given, np.exp(rng.uniform(-0.5, 0.5, segments) * math.log(spread))


def magnitudes(trajectory, derivative):
    """Σ_j |terms| of a derivative at segment ends, (S, 3): its rounding is measured by them."""
    size = trajectory.degree + 1
    factors = np.array([math.perm(j, derivative) for j in range(size)], dtype=float)
    rates = trajectory.durations[:, None] ** derivative
    return np.einsum("j,sjx->sx", factors, np.abs(trajectory.coefficients)) / rates


def assert_jump_free(trajectory, knot, derivative, axis):
    ends = trajectory.on_segments([0.0, 1.0], derivative)[..., axis]
    size = magnitudes(trajectory, derivative)[knot - 1 : knot + 1, axis].sum()
    assert abs(ends[knot, 0] - ends[knot - 1, 1]) <= 20 * ROUNDING * size


def continuous_derivatives(fixed, order, rule):
    """By the rule's words: the derivatives that stay continuous at an inner knot where `fixed` are given."""
    free = [d for d in range(2 * order) if d not in fixed]
    if rule is ContinuityRule.HIGHEST:
        return free[: len(free) - len(fixed)]
    return [d for d in free if 2 * order - 1 - d not in fixed]


@drawn(seed=seeds, order=orders, rule=st.sampled_from(ContinuityRule), segments=st.integers(1, 6))
def test_what_is_given_is_met_and_what_the_rule_promises_is_continuous(seed, order, rule, segments):
    given, durations = random_course(seed, order, segments)
    trajectory = minimum_effort(given, durations, rule)
    assert trajectory.degree == 2 * order - 1
    for d in range(order):
        ends = trajectory.on_segments([0.0, 1.0], d)
        allowed = 20 * ROUNDING * magnitudes(trajectory, d)
        assert (np.nan_to_num(np.abs(ends[:, 0] - given[:-1, d])) <= allowed).all()
        assert (np.nan_to_num(np.abs(ends[:, 1] - given[1:, d])) <= allowed).all()
    for knot in range(1, segments):
        for axis in range(3):
            fixed = np.flatnonzero(~np.isnan(given[knot, :, axis]))
            for derivative in continuous_derivatives(fixed, order, rule):
                assert_jump_free(trajectory, knot, derivative, axis)


@drawn(seed=seeds, order=orders)
def test_what_is_free_at_an_end_makes_its_dual_derivative_vanish(seed, order):
    given, durations = random_course(seed, order)
    trajectory = minimum_effort(given[::-1], durations)
    start = given[-1]
    for d in range(order):
        dual = 2 * order - 1 - d
        value = trajectory.on_segments([0.0], dual)[0, 0]
        allowed = 20 * ROUNDING * magnitudes(trajectory, dual)[0]
        assert (np.abs(value) <= allowed)[np.isnan(start[d])].all()


@drawn(seed=seeds, order=orders)
def test_no_admissible_change_lowers_the_effort(seed, order):
    """Any curve through what is given costs the minimum, plus what its difference from it costs."""
    given, durations = random_course(seed, order)
    best = minimum_effort(given, durations)
    change = np.random.default_rng(seed + 1).normal(size=given.shape)
    change[~np.isnan(given)] = 0.0
    scaled = change[:, None] * durations[None, :, None, None] ** np.arange(order)[:, None]
    each = np.arange(len(durations))
    difference = polynomial.hermite(scaled[each, each], scaled[each + 1, each])
    other = Trajectory(durations, best.coefficients + difference)
    expected = best.effort(order) + Trajectory(durations, difference).effort(order)
    assert other.effort(order) == pytest.approx(expected, rel=1e-8)


@examples(40)
@drawn(seed=seeds, order=orders, segments=st.integers(1, 4))
def test_a_dense_quadratic_program_agrees(seed, order, segments):
    given, durations = random_course(seed, order, segments)
    trajectory = minimum_effort(given, durations)
    for axis in range(3):
        dense = dense_minimum(given[..., axis], durations, order)
        found = trajectory.coefficients[..., axis]
        np.testing.assert_allclose(found, dense, atol=1e-6 * np.abs(dense).max())


def dense_minimum(given, durations, order):
    """Coefficients (n, 2s) of one axis from the optimality conditions of the quadratic program."""
    count, size = len(durations), 2 * order
    cost = np.zeros((count * size, count * size))
    rows, sides = [], []
    for k, duration in enumerate(durations):
        block = slice(k * size, (k + 1) * size)
        cost[block, block] = polynomial.gram(size - 1, order) / duration ** (2 * order - 1)
    for d in range(order):
        at = polynomial.differentiate(np.eye(size)[..., None], d)[..., 0]  # row j: d-th derivative of s^j
        start, end = at[:, 0], at.sum(axis=1)
        for knot in range(count + 1):
            ends, begins = np.zeros((2, count, size))
            if knot > 0:
                ends[knot - 1] = end / durations[knot - 1] ** d
            if knot < count:
                begins[knot] = start / durations[knot] ** d
            if not np.isnan(given[knot, d]):
                present = [side.ravel() for side in (ends, begins) if side.any()]
                rows += present
                sides += [given[knot, d]] * len(present)
            elif 0 < knot < count:
                rows.append((ends - begins).ravel())
                sides.append(0.0)
    rows = np.array(rows)
    optimality = np.block([[cost, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    scale = 1 / np.sqrt(np.abs(optimality).max(axis=1))
    right = scale * np.concatenate([np.zeros(count * size), sides])
    solution = np.linalg.lstsq(scale[:, None] * optimality * scale, right, rcond=1e-15)[0] * scale
    return solution[: count * size].reshape(count, size)


@drawn(seed=seeds, order=orders)
def test_the_highest_rule_never_costs_less(seed, order):
    given, durations = random_course(seed, order)
    best = minimum_effort(given, durations).effort(order)
    assert best <= minimum_effort(given, durations, ContinuityRule.HIGHEST).effort(order) * (1 + 1e-9)


@drawn(seed=seeds, order=orders, fixed=st.integers(1, 3))
def test_the_rules_agree_where_the_lowest_derivatives_are_given_and_differ_elsewhere(seed, order, fixed):
    rng = np.random.default_rng(seed)
    given = course(rng.normal(size=(5, 3)), order)
    given[1:-1, :fixed] = rng.normal(size=(3, fixed, 3))
    durations = rng.uniform(0.5, 2.0, 4)
    highest, variational = (minimum_effort(given, durations, rule) for rule in ContinuityRule)
    np.testing.assert_array_equal(highest.coefficients, variational.coefficients)
    given[1:-1, 1] = np.nan
    given[1:-1, 2] = rng.normal(size=(3, 3))  # a thrust direction at the waypoints, as in a flip
    variational, highest = (minimum_effort(given, durations, rule).effort(order) for rule in ContinuityRule)
    assert highest > 1.01 * variational


@drawn(seed=seeds, order=orders, rule=st.sampled_from(ContinuityRule), part=st.floats(0.1, 0.9))
def test_a_knot_where_nothing_is_given_changes_nothing(seed, order, rule, part):
    given, durations = random_course(seed, order, 3)
    whole = minimum_effort(given, durations, rule)
    parted = minimum_effort(
        np.insert(given, 2, np.nan, axis=0),
        np.insert(durations, 1, part * durations[1]) - [0, 0, part * durations[1], 0],
        rule,
    )
    t = np.linspace(0.0, whole.duration, 50)
    scale = np.abs(whole.coefficients).max()
    np.testing.assert_allclose(parted.evaluate(t), whole.evaluate(t), atol=1e-11 * scale)


@drawn(seed=seeds, order=orders, knot=st.integers(1, 4), derivative=st.integers(0, 4))
def test_giving_what_the_optimum_has_changes_nothing(seed, order, knot, derivative):
    given, durations = random_course(seed, order)
    best = minimum_effort(given, durations)
    derivative = min(derivative, order - 1)
    given[knot, derivative] = best.on_segments([0.0], derivative)[knot, 0]
    again = minimum_effort(given, durations)
    difference = np.abs(again.coefficients - best.coefficients).max()
    assert difference <= 1e-10 * np.abs(best.coefficients).max()


@drawn(seed=seeds, order=orders, rule=st.sampled_from(ContinuityRule), slower=st.floats(1e-3, 1e3))
def test_slower_time_keeps_the_path(seed, order, rule, slower):
    given, durations = random_course(seed, order)
    trajectory = minimum_effort(given, durations, rule)
    powers = slower ** np.arange(order)[:, None]
    slowed = minimum_effort(given / powers, slower * durations, rule)
    scale = np.abs(trajectory.coefficients).max()
    np.testing.assert_allclose(slowed.coefficients, trajectory.coefficients, atol=1e-12 * scale)
    expected = trajectory.effort(order) * slower ** (1 - 2 * order)
    assert slowed.effort(order) == pytest.approx(expected, rel=1e-8)


@drawn(seed=seeds, order=orders, rule=st.sampled_from(ContinuityRule))
def test_backwards_the_path_is_the_same(seed, order, rule):
    given, durations = random_course(seed, order)
    trajectory = minimum_effort(given, durations, rule)
    signs = (-1.0) ** np.arange(order)[:, None]
    backwards = minimum_effort((given * signs)[::-1], durations[::-1], rule)
    s = np.linspace(0.0, 1.0, 9)
    scale = np.abs(trajectory.coefficients).max()
    there, back = trajectory.on_segments(s), backwards.on_segments(1.0 - s)[::-1]
    np.testing.assert_allclose(back, there, atol=1e-11 * scale)


@drawn(seed=seeds, order=orders, rule=st.sampled_from(ContinuityRule))
def test_the_curve_is_linear_in_what_is_given_and_axes_stand_alone(seed, order, rule):
    given, durations = random_course(seed, order)
    rng = np.random.default_rng(seed + 1)
    other = np.where(np.isnan(given), np.nan, rng.normal(size=given.shape))
    one, two, both = (
        minimum_effort(values, durations, rule).coefficients for values in (given, other, 2 * given - other)
    )
    np.testing.assert_allclose(2 * one - two, both, atol=1e-11 * np.abs([one, two]).max())
    alone = minimum_effort(given[..., [1, 1, 1]], durations, rule).coefficients
    np.testing.assert_allclose(alone[..., 2], one[..., 1], rtol=0, atol=1e-13 * np.abs(one).max())


@pytest.mark.parametrize("order", [3, 4, 5])
def test_from_rest_to_rest_it_is_the_smoothstep(order):
    trajectory = minimum_effort(course([[0, 0, 1], [1, -2, 1]], order), [0.7])
    expected = np.outer(SMOOTHSTEPS[order], [1, -2, 0])
    expected[0, 2] = 1
    np.testing.assert_allclose(trajectory.coefficients[0], expected, rtol=1e-13, atol=1e-13)


def section_v(k, order=5):
    """The paper's example at iteration k of its search: only a height is given on the way."""
    given = course([[0, 0, 0], [np.nan, np.nan, -2], [6, 0, 0]], order)
    return minimum_effort(given, [0.5 + 0.1 * (k - 1), 1.5])


@pytest.mark.parametrize("k", [1, 6, 12])
def test_in_the_papers_example_x_is_one_smoothstep_through_the_free_knot(k):
    trajectory = section_v(k)
    t = np.linspace(0.0, trajectory.duration, 100)
    expected = 6 * np.polynomial.Polynomial(SMOOTHSTEPS[5])(t / trajectory.duration)
    np.testing.assert_allclose(trajectory.evaluate(t)[:, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(trajectory.evaluate(t)[:, 1], 0.0)
    assert trajectory.evaluate(trajectory.knots[1])[2] == pytest.approx(-2.0, abs=1e-14)


@pytest.mark.parametrize(
    ("k", "thrust", "moment", "rate", "rotors"),
    [
        (1, (1.21, 100.23), 2705.6, 185.97, (-4508.9, 4509.7)),
        (6, (5.89, 35.27), 8.019, 7.856, (-11.742, 14.992)),
        (11, (8.46, 26.53), 1.680, 2.459, (-0.539, 6.656)),
        (12, (8.55, 25.76), 1.445, 2.175, (-0.137, 6.464)),
        (13, (8.60, 25.15), 1.256, 1.941, (0.185, 6.309)),
    ],
)
def test_the_papers_iterations_ask_of_the_vehicle_what_is_known(k, thrust, moment, rate, rotors):
    vehicle, trajectory = load_vehicle("section-v"), section_v(k)
    times = np.linspace(0.0, trajectory.duration, 40_001)
    asked = reference(trajectory, vehicle, times=times, environment=CODE).setpoint
    margin = RotorMargin.of(certify(trajectory, vehicle, CODE))
    least, largest = trajectory.specific_thrust_range(CODE.gravity)
    found = (vehicle.mass * least.value, vehicle.mass * largest.value)
    assert found == pytest.approx(thrust, abs=0.006)
    moments = np.linalg.norm(asked.wrench.moment_body, axis=-1)
    assert moments.max() == pytest.approx(moment, rel=4e-4)
    assert np.linalg.norm(asked.omega_body, axis=-1).max() == pytest.approx(rate, rel=4e-4)
    assert (margin.min_thrust, margin.max_thrust) == pytest.approx(rotors, rel=1e-4, abs=6e-4)


@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize("seed", [0, 1])
def test_durations_from_a_hundredth_to_ten_seconds_cost_no_digits(seed, order):
    """Against 400 bits, each segment to the last digits of its largest coefficient.

    GCOPTER, banded LU in absolute time without pivoting, reached 9e-11 to 3e-6 on ten of them (snap).
    """
    rng = np.random.default_rng(seed)
    durations = np.exp(rng.uniform(math.log(0.01), math.log(10.0), 40))
    given = course(rng.uniform(-5.0, 5.0, (41, 3)), order)
    exact = exact_coefficients(given, durations)
    errors = np.abs((minimum_effort(given, durations).coefficients - exact).astype(float))
    sizes = np.abs(exact.astype(float)).max(axis=1)
    assert (errors.max(axis=1) / sizes).max() <= (2 * ROUNDING if EXTENDED else 5e-13)


@pytest.mark.parametrize("order", [3, 4, 5])
def test_two_hundred_segments_are_exact_to_rounding(order):
    positions = np.random.default_rng(0).uniform(-5.0, 5.0, (201, 3))
    given, durations = course(positions, order), np.ones(200)
    difference = minimum_effort(given, durations).coefficients - exact_coefficients(given, durations)
    position_error = np.abs(difference.astype(float)).sum(axis=1).max()  # [m], |s| <= 1
    assert position_error <= 1e-12


@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize(
    ("positions", "durations"),
    [
        ([[1, 2, 3], [1, 2, 3]], [1.0]),
        ([[0, 0, 0], [0, 0, 4], [0, 0, 1]], [1.0, 0.5]),
        ([[0, 0, 0], [1, 1, 1], [1, 1, 1], [2, 2, 2]], [1.0, 1.0, 1.0]),
        ([[0, 0, 0], [1, 2, 3], [2, 4, 6]], [1e-6, 1.0]),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [1e-3, 1e3, 1.0]),
        ([[1e7, 0, 0], [1e7 + 1, 0, 0], [1e7, 1, 0]], [1.0, 2.0]),
    ],
)
def test_degenerate_courses_are_flown(positions, durations, order):
    trajectory = minimum_effort(course(positions, order), durations)
    ends = trajectory.on_segments([0.0, 1.0])
    allowed = 4 * ROUNDING * magnitudes(trajectory, 0).max()
    np.testing.assert_allclose(ends[:, 0], positions[:-1], atol=allowed)
    np.testing.assert_allclose(ends[:, 1], positions[1:], atol=allowed)
    for axis in range(3):
        if len(set(np.array(positions)[:, axis])) == 1:
            np.testing.assert_array_equal(trajectory.coefficients[:, 1:, axis], 0.0)


def free_ends(order, **derivatives):
    """Three knots with their positions, the first and last with what is named besides: {'0': [1, 2]}."""
    given = np.full((3, order, 3), np.nan)
    given[[0, -1], 0] = [[0, 0, 0], [1, 2, 3]]
    for knot, values in derivatives.items():
        given[int(knot[1:]), values] = 1.0
    return given


@pytest.mark.parametrize(
    ("given", "missing"),
    [
        (free_ends(3), 1),
        (free_ends(4), 2),
        (free_ends(5), 3),
        (free_ends(5, k1=[0]), 2),
        (free_ends(5, k1=[0, 1]), 1),
        (free_ends(4, k1=[2, 3]), 0),
        (free_ends(4, k0=[3], k1=[3], k2=[3]), 1),  # however often, it is the same number
    ],
)
def test_too_little_is_refused_with_what_is_missing(given, missing):
    if missing:
        with pytest.raises(SpecError, match=f"along x undetermined; give {missing} more"):
            minimum_effort(given, [1.0, 1.0])
    else:
        assert minimum_effort(given, [1.0, 1.0]).effort(4) == pytest.approx(0.0, abs=1e-9)


def with_entry(index, value):
    given = course([[0, 0, 0], [1, 1, 1], [2, 2, 2]], 4)
    given[index] = value
    return given


GOOD = course([[0, 0, 0], [1, 1, 1], [2, 2, 2]], 4)


@pytest.mark.parametrize(
    ("given", "durations", "rule", "named"),
    [
        (GOOD, [1.0, 0.0], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [1.0, -1.0], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [1.0, np.nan], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [1.0, np.inf], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [[1.0, 1.0]], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [], ContinuityRule.VARIATIONAL, "durations"),
        (GOOD, [1.0], ContinuityRule.VARIATIONAL, "2 knots"),
        (GOOD[:, :2], [1.0, 1.0], ContinuityRule.VARIATIONAL, "3, 4 or 5 derivatives"),
        (GOOD[..., 0], [1.0, 1.0], ContinuityRule.VARIATIONAL, "shape"),
        (1.0, [1.0], ContinuityRule.VARIATIONAL, "shape"),
        ("fast", [1.0], ContinuityRule.VARIATIONAL, "fixed must be numbers"),
        (with_entry((1, 0, 2), np.inf), [1.0, 1.0], ContinuityRule.VARIATIONAL, "fixed must be finite"),
        (with_entry((0, 0, 2), np.nan), [1.0, 1.0], ContinuityRule.VARIATIONAL, "position at both ends"),
        (with_entry((2, 0, 0), np.nan), [1.0, 1.0], ContinuityRule.VARIATIONAL, "position at both ends"),
        (GOOD, [1.0, 1.0], "lowest", "variational, highest"),
        (GOOD, [1e-200, 1e200], ContinuityRule.VARIATIONAL, "more alike"),
        (course(np.arange(9.0).reshape(3, 3), 5), [1e-300, 1.0], ContinuityRule.HIGHEST, "more alike"),
    ],
)
def test_what_cannot_be_solved_is_refused_by_name(given, durations, rule, named):
    with pytest.raises(SpecError, match=named):
        minimum_effort(given, durations, rule)
