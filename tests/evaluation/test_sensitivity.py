"""Slopes of a flight's errors: those of differences between flights, in gains, vehicle and start."""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aerobat import so3
from aerobat.arrays import Array
from aerobat.control import Controller
from aerobat.engines.duals import Dual, DualOps, dual
from aerobat.engines.floats import FloatOps
from aerobat.errors import SpecError
from aerobat.evaluation import Sensitivity, score_flights, sensitivity
from aerobat.problem import load_problem
from aerobat.simulation import fly
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle
from looping_flights import loops, near, one

AGILE = load_vehicle("agile-quad")
NOMINAL = replace(AGILE, drag_body=[0.1, 0.12, 0.2])
QUAD = replace(
    NOMINAL,
    mass=1.02 * AGILE.mass,
    inertia=AGILE.inertia * 1.04 + 1e-4 * np.ones((3, 3)) * np.trace(AGILE.inertia),
)  # not quite the nominal one
PATH, RATE = loops(6.0), 500.0
NUMBERS = tuple(f.name for f in fields(Controller) if isinstance(f.default, float))
GAINS = tuple(name for name in NUMBERS if name not in ("lead_time_constant", "disturbance_filter"))
FIVE = ("position_gain", "velocity_gain", "integral_gain", "attitude_frequency", "attitude_damping")
ROTORS = ("lag", "torque_coefficient", "min_thrust", "max_thrust", "position_body")
START = BodyState(
    [0.02, -0.01, 0.015], [0.04, 0.03, -0.02], so3.exp([0.02, -0.015, 0.03]), [0.1, -0.05, 0.08]
)
TIGHT = Controller(max_feedback=0.5, max_integral=0.005, max_attitude_integral=0.0005)  # all limits are met
PARTS = ("mean_square_position_error", "mean_square_attitude_error", "final_square_position_error")


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


def flown(vehicle: Vehicle | list[Vehicle] = QUAD, **options: Any) -> Array:
    """The three errors of a flight or of each of a batch, from its log, (..., 3)."""
    given = {"controller": TIGHT, "start": START, "nominal": NOMINAL, "rate": RATE, "engine": "compiled"}
    flight = fly(PATH, vehicle, **(given | options))
    square = flight.position_error**2
    angle = flight.attitude_error**2
    return np.stack([square.mean(axis=-1), angle.mean(axis=-1), square[..., -1]], axis=-1)


@pytest.fixture(scope="module")
def everything() -> Sensitivity:
    """In all there is, in one call."""
    names = [*GAINS, "mass", "drag_body", "inertia", *(f"rotors.{name}" for name in ROTORS)]
    names += [f"start.{name}" for name in ("position", "velocity", "attitude", "omega_body")]
    return sensitivity(PATH, names, QUAD, controller=TIGHT, start=START, nominal=NOMINAL, rate=RATE)


def listed(answer: Sensitivity, name: str) -> Array:
    """Slopes of the three errors, (3, ...)."""
    return np.array([getattr(answer, part).slopes[name] for part in PARTS])


def differences(flights: Callable[[Array], Array], step: float) -> Array:
    """Slopes at zero of what flies with each of four values, to the fourth order of the step."""
    errors = flights(step * np.array([-1.0, -0.5, 0.5, 1.0]))
    return (8.0 * (errors[2] - errors[1]) - (errors[3] - errors[0])) / (6.0 * step)


def assert_slopes(got: Array, flights: Callable[[Array], Array], step: float, rtol: float = 1e-7) -> None:
    """As far as rounding leaves digits in a difference."""
    np.testing.assert_allclose(got, differences(flights, step), rtol=rtol, atol=1e-17 / step)


def test_values_are_those_of_the_flight(everything: Sensitivity) -> None:
    assert not fly(PATH, QUAD, controller=TIGHT, start=START, nominal=NOMINAL, rate=RATE).saturated.any()
    values = [getattr(everything, part).value for part in PARTS]
    np.testing.assert_allclose(values, flown(), rtol=1e-12)


@pytest.mark.parametrize("name", GAINS)
def test_slopes_in_gains(name: str, everything: Sensitivity) -> None:
    value = getattr(TIGHT, name)

    def flights(moves: Array) -> Array:
        return np.array([flown(controller=replace(TIGHT, **{name: value * (1.0 + h)})) for h in moves])

    assert_slopes(value * listed(everything, name), flights, 3e-5)


@pytest.mark.parametrize("max_bandwidth", [15.0, 100.0])
@pytest.mark.parametrize("name", GAINS)
def test_gains_have_slopes_on_weak_rotors_too(name: str, max_bandwidth: float) -> None:
    """Where the vehicle, not the controller, sets how fast the loops are."""
    value = getattr(TIGHT, name)
    gains = TIGHT.gains(max_bandwidth, DualOps(FloatOps), **{name: Dual(value, value)})
    got = [dual(gain).tangent or 0.0 for gain in gains]

    def changed(moves: Array) -> Array:
        return np.array([replace(TIGHT, **{name: value * (1.0 + h)}).gains(max_bandwidth) for h in moves])

    assert_slopes(np.array(got), changed, 1e-3, rtol=1e-9)


def changed(name: str, change: Any) -> Callable[[Array], Array]:
    """Errors of vehicles that are changed by so much of it."""
    return lambda moves: flown([replace(QUAD, **{name: getattr(QUAD, name) + h * change}) for h in moves])


def test_slopes_in_mass(everything: Sensitivity) -> None:
    assert_slopes(listed(everything, "mass"), changed("mass", 1.0), 1e-6)


@pytest.mark.parametrize("axis", [1, slow(0), slow(2)])
def test_slopes_in_drag(axis: int, everything: Sensitivity) -> None:
    assert_slopes(listed(everything, "drag_body")[:, axis], changed("drag_body", np.eye(3)[axis]), 1e-5)


@pytest.mark.parametrize(("i", "j"), [(1, 2), *(slow(*pair) for pair in ((0, 0), (1, 1), (2, 2), (0, 1)))])
def test_slopes_in_inertia(i: int, j: int, everything: Sensitivity) -> None:
    change = np.zeros((3, 3))
    change[i, j] = change[j, i] = np.trace(QUAD.inertia)
    slopes = np.sum(listed(everything, "inertia") * change, axis=(1, 2))
    assert_slopes(slopes, changed("inertia", change), 1e-5)


def retrofitted(vehicle: Vehicle, name: str, change: Array) -> Vehicle:
    """With rotors changed, each by its own."""
    pairs = zip(vehicle.rotors, change, strict=True)
    return replace(vehicle, rotors=tuple(replace(r, **{name: getattr(r, name) + x}) for r, x in pairs))


@pytest.mark.parametrize("name", ["lag", "position_body", *map(slow, ROTORS[1:4])])
def test_slopes_in_the_rotors(name: str, everything: Sensitivity) -> None:
    got = listed(everything, f"rotors.{name}")
    along = np.random.default_rng(1).uniform(0.5, 1.0, got.shape[1:]) * 0.01
    slopes = np.tensordot(got, along, along.ndim)
    step = {"position_body": 3e-6, "lag": 1e-4, "torque_coefficient": 1e-4}.get(name, 1e-3)
    assert_slopes(slopes, lambda moves: flown([retrofitted(QUAD, name, h * along) for h in moves]), step)


@pytest.mark.parametrize("name", ["attitude", *map(slow, ("position", "velocity", "omega_body"))])
def test_slopes_in_the_start(name: str, everything: Sensitivity) -> None:
    along = np.random.default_rng(2).normal(size=3)

    def flights(moves: Array) -> Array:
        each = {key: np.tile(value, (len(moves), 1)) for key, value in vars(START).items()}
        turns = moves[:, None] * along
        if name == "attitude":
            each["q_world_body"] = so3.multiply(START.q_world_body, so3.exp(turns))
        else:
            each[name] = each[name] + turns
        return flown(start=BodyState(**each))

    assert_slopes(listed(everything, f"start.{name}") @ along, flights, 3e-6)


@pytest.mark.slow
def test_slopes_of_a_scored_flight_in_five_gains() -> None:
    """As a user would check: the mean squared error of score_flights(), one gain after another."""
    line, controller = load_problem("line"), Controller()
    got = sensitivity(PATH, FIVE, QUAD, start=START, rate=200.0).mean_square_position_error
    options = {"rate": 200.0, "engine": "compiled"}

    def scored(name: str, factor: float) -> float:
        changed = replace(controller, **{name: factor * getattr(controller, name)})
        scores = score_flights(PATH, QUAD, problem=line, start=START, controller=changed, **options)
        return float(scores.rms_position_error_m[0]) ** 2

    for name in FIVE:
        wanted = differences(lambda moves, name=name: np.array([scored(name, 1 + h) for h in moves]), 1e-4)
        slope = float(got.slopes[name]) * getattr(controller, name)
        assert slope == pytest.approx(wanted, rel=1e-7), name


@cache
def slopes_by(engine: str, names: tuple[str, ...], seconds: float) -> Sensitivity:
    return sensitivity(loops(seconds), names, QUAD, engine=engine, nominal=NOMINAL, start=START, rate=200.0)


IN_ALL = ("position_gain", "mass", "start.attitude")


@pytest.mark.parametrize(
    ("engine", "names", "seconds"),
    [
        ("compiled", ("position_gain", "mass"), 0.3),
        slow("compiled", IN_ALL, 1.0),
    ],
)
def test_engines_agree(engine: str, names: tuple[str, ...], seconds: float) -> None:
    wanted, got = (slopes_by(each, names, seconds) for each in ("floats", engine))
    for name in names:
        np.testing.assert_allclose(listed(got, name), listed(wanted, name), rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize(
    ("engine", "path"), [("compiled", Trajectory([0.1], np.zeros((1, 1, 3)))), slow("compiled", PATH)]
)
def test_each_of_a_batch_has_the_slopes_that_it_has_alone(engine: str, path: Trajectory) -> None:
    names, starts = ("velocity_gain", "inertia", "rotors.lag"), near(3)
    vehicles = [replace(QUAD, mass=QUAD.mass * (1.0 + 0.02 * k)) for k in range(3)]
    options = {"nominal": NOMINAL, "rate": RATE, "engine": engine}
    together = sensitivity(path, names, vehicles, start=starts, **options)
    assert together.mean_square_position_error.slopes["inertia"].shape == (3, 3, 3)
    for k in range(3):
        alone = sensitivity(path, names, vehicles[k], start=one(starts, k), **options)
        for name in names:
            np.testing.assert_array_equal(listed(together, name)[:, k], listed(alone, name))


def test_a_flight_at_its_rotors_limits_has_slopes_too() -> None:
    """Rotors are weaker than those of the nominal vehicle."""
    limit = 0.5 * QUAD.rotors[0].max_thrust
    weak = retrofitted(QUAD, "max_thrust", np.full(4, -limit))
    commands = fly(PATH, weak, controller=TIGHT, start=START, nominal=NOMINAL, rate=RATE).commands
    assert 0.01 < (commands > limit).any(axis=-1).mean() < 0.5
    names = ("mass", "rotors.max_thrust")
    got = sensitivity(PATH, names, weak, controller=TIGHT, start=START, nominal=NOMINAL, rate=RATE)

    def heavier(moves: Array) -> Array:
        return flown([replace(weak, mass=weak.mass + h) for h in moves])

    def stronger(moves: Array) -> Array:
        return flown([retrofitted(weak, "max_thrust", np.full(4, h)) for h in moves])

    assert_slopes(listed(got, "mass"), heavier, 1e-6, rtol=1e-6)
    assert_slopes(listed(got, "rotors.max_thrust").sum(axis=-1), stronger, 1e-6, rtol=1e-6)


def test_a_vehicle_that_diverges_has_no_final_error() -> None:
    falling = replace(START, velocity=np.array([0.0, 0.0, -60.0]))
    lost = sensitivity(PATH, "mass", QUAD, start=falling)
    assert np.isfinite(lost.mean_square_position_error.slopes["mass"])
    assert np.isnan(lost.final_square_position_error.value)


def test_answers_cannot_be_written_to(everything: Sensitivity) -> None:
    answer = everything.mean_square_position_error
    with pytest.raises(ValueError, match="read-only"):
        answer.slopes["inertia"][0, 0] = 1.0


@pytest.mark.parametrize(
    ("of", "message"),
    [
        ((), "of must name at least one quantity, such as 'position_gain' or 'mass'"),
        ("positon_gain", "no differentiable quantity named 'positon_gain'; did you mean 'position_gain'?"),
        (("mass", 3), "sensitivity: of[1] must be a name, got 3"),
        ("lead_time_constant", "lead_time_constant has no slope"),
        ("disturbance_filter", "disturbance_filter has no slope"),
        ("prioritize_tilt", "no differentiable quantity named 'prioritize_tilt'"),
    ],
)
def test_what_has_no_slope_is_refused(of: object, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        sensitivity(PATH, of, QUAD)
    assert str(caught.value).startswith(message)


def test_conditions_are_refused_in_one_sentence() -> None:
    with pytest.raises(SpecError, match="conditions draw what flies, which leaves no slopes"):
        sensitivity(PATH, "mass", QUAD, conditions="lab")
