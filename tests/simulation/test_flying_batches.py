"""One and many, floats and arrays: the same flights; noise and outcomes."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aerobat import so3
from aerobat.control import Controller
from aerobat.engines import FLOATS, choose
from aerobat.environment import Dispersion
from aerobat.errors import BackendMissing, SpecError
from aerobat.simulation import Flight, Outcome, fly
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle
from looping_flights import HEXA, QUAD, assert_same, loops, near, one

EXACT = ("floats", "compiled", "jax")  # in float64
AT_REST = Trajectory(np.array([1.0]), np.zeros((1, 1, 3)))


@cache
def by_floats(vehicle: Vehicle, seconds: float) -> Flight:
    return fly(loops(seconds), vehicle, engine="floats")


def slow(*values: object) -> object:
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(("engine", "rotors"), [("compiled", 4), slow("compiled", 6), slow("jax", 6)])
def test_engines_agree_with_floats_to_rounding_over_3000_steps(engine: str, rotors: int) -> None:
    vehicle = {4: QUAD, 6: HEXA}[rotors]
    flights = [by_floats(vehicle, 6.0), fly(loops(6.0), vehicle, engine=engine)]
    assert len(flights[0].times) == 3001
    assert [flight.engine for flight in flights] == ["floats", engine]
    assert_same(*flights, atol=1e-12)


@cache
def alone(k: int, seconds: float) -> Flight:
    """One of the batch below by itself."""
    return fly(loops(seconds), others()[k], start=one(near(4), k), engine="floats")


@cache
def others() -> list[Vehicle]:
    rng = np.random.default_rng(3)
    return [replace(HEXA, name=f"no. {k}", mass=HEXA.mass * rng.uniform(0.9, 1.1)) for k in range(4)]


@pytest.mark.parametrize(
    ("engine", "seconds"),
    [
        *((engine, 1.0) for engine in EXACT if engine not in ("floats", "jax")),
        *(slow(engine, 4.0) for engine in ("floats", "compiled")),  # JAX's are scored as alone
    ],
)
def test_each_vehicle_of_a_batch_flies_as_it_would_alone(engine: str, seconds: float) -> None:
    """Different vehicles and starts, all in one call."""
    batch = fly(loops(seconds), others(), start=near(4), engine=engine)
    assert batch.states.position.shape == (4, 500 * seconds + 1, 3)
    for k in range(4):
        assert_same(batch[k], alone(k, seconds), atol=1e-12)


def test_one_vehicle_takes_many_starts() -> None:
    starts = near(3)
    batch = fly(AT_REST, QUAD, start=starts)
    assert batch.vehicles == ("agile-quad",) * 3
    assert len(batch) == len([*batch]) == 3
    assert len(batch[0]) == 1
    for k in range(3):
        assert_same(batch[k], fly(AT_REST, QUAD, start=one(starts, k)))


def test_quadrotors_of_any_size_fly_in_one_batch() -> None:
    crazyflie = replace(load_vehicle("crazyflie"), drag_body=np.zeros(3))
    batch = fly(loops(6.0), [QUAD, crazyflie])
    assert batch.outcomes == (Outcome.COMPLETE, Outcome.COMPLETE)
    assert_same(batch[1], fly(loops(6.0), crazyflie))
    np.testing.assert_array_equal(batch.max_thrusts, [QUAD.max_thrusts, crazyflie.max_thrusts])


def test_flights_are_flown_by_what_is_fastest_for_so_many_ticks(monkeypatch) -> None:
    assert choose("auto", 1, 200) is FLOATS
    assert choose("auto", 100, 1000).name == "compiled"
    assert fly(AT_REST, QUAD).engine == "compiled"
    monkeypatch.setattr("aerobat.engines.find_spec", lambda name: None)
    with pytest.raises(BackendMissing, match=r'pip install "aerobat\[jax\]"'):
        choose("jax", 1, 1000)


@pytest.mark.parametrize(
    ("engine", "seconds"),
    [
        *((engine, 1.0) for engine in EXACT if engine != "jax"),
        slow("jax", 6.0),  # as many ticks as above, which XLA has compiled
    ],
)
def test_divergence_is_an_outcome_and_ends_the_flight(engine: str, seconds: float) -> None:
    spinning = BodyState(
        np.zeros(3), np.array([20.0, 0.0, 0.0]), so3.exp([2.5, 0, 0]), np.array([30.0, 5.0, 0.0])
    )
    flight = fly(loops(seconds), HEXA, start=spinning, engine=engine)
    error = np.linalg.norm(flight.states.position - flight.setpoint.flat.position, axis=-1)
    assert flight.outcome is Outcome.DIVERGED
    assert flight.sentences[0] == f"diverged at {flight.times[-1]:.2f} s: position error above 5 m"
    assert flight.times[-1] == flight.ends < seconds
    assert error[-1] > 5.0 >= error[:-1].max()


def test_a_state_that_is_no_number_any_more_ends_the_flight_before_it() -> None:
    wild = BodyState(np.zeros(3), np.zeros(3), so3.IDENTITY, np.array([1e200, 1e200, 0.0]))
    flight = fly(AT_REST, HEXA, start=wild)
    assert flight.outcome is Outcome.STATE_NOT_FINITE
    assert flight.sentences[0] == "diverged at 0.00 s: its state is no longer a number"
    assert len(flight.times) == 1


def test_in_a_batch_a_diverged_vehicle_stays_where_it_ended() -> None:
    starts = BodyState(
        np.zeros((2, 3)),
        np.zeros((2, 3)),
        np.stack([so3.IDENTITY] * 2),
        np.array([[0, 0, 0], [1e200, 1e200, 0]]),
    )
    batch = fly(AT_REST, HEXA, start=starts)
    assert batch.outcomes[0] is Outcome.COMPLETE
    assert batch.outcomes[1] is Outcome.STATE_NOT_FINITE
    assert (batch.states.position[1] == batch.states.position[1, 0]).all()
    assert batch[0].outcome is Outcome.COMPLETE
    assert len(batch[0].times) == 501
    assert len(batch[1].times) == 1


def test_the_last_step_may_be_shorter_and_the_flight_ends_with_the_trajectory() -> None:
    flight = fly(loops(4.0007), QUAD)
    assert flight.times[-1] == pytest.approx(4.0007, abs=1e-12)
    assert np.diff(flight.times)[-1] == pytest.approx(0.0007, abs=1e-12)
    np.testing.assert_allclose(flight.states.position[-1], np.zeros(3), atol=0.005)


def test_a_slow_controller_does_not_coarsen_the_physics() -> None:
    falling = BodyState(np.zeros(3), np.zeros(3), so3.IDENTITY, np.array([4.0, -3.0, 2.0]))
    slow, fast = (fly(AT_REST, QUAD, start=falling, rate=rate) for rate in (250.0, 500.0))
    assert np.abs(slow.states.position - fast.states.position[::2]).max() < 0.01


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"vehicle": []}, "vehicle must be at least one"),
        ({"vehicle": [QUAD, HEXA]}, "need as many rotors"),
        ({"nominal": HEXA}, "need as many rotors"),
        ({"vehicle": [QUAD, replace(QUAD, drag_body=np.ones(3))]}, "differ in drag per mass"),
        ({"engine": "abacus"}, "engine must be one of auto, floats, compiled, jax, jax-float32"),
        ({"rate": 0.0}, r"^FlightConfig\.rate must be 1 or more, got "),
        ({"rate": np.nan}, r"^FlightConfig\.rate must be a finite number"),
        ({"seed": -1}, "seed must be"),
        ({"conditions": "lap"}, "conditions"),
        ({"conditions": 3}, "conditions must be a Dispersion or the name of one"),
        ({"conditions": "lab", "flights": 0}, "flights must be a whole number"),
        ({"conditions": "lab", "flights": range(-2, 1)}, "flights must be a whole number"),
        ({"flights": 3}, "flights are drawn from conditions"),
        ({"conditions": "lab", "start": near(1)}, "start comes of the conditions"),
        ({"conditions": "lab", "nominal": QUAD}, "nominal comes of the conditions"),
        ({"conditions": "lab", "vehicle": [QUAD] * 2}, "vehicle must be one where there are conditions"),
        ({"conditions": Dispersion(computation_delay=0.003)}, "computation_delay must be at most a period"),
        ({"vehicle": [QUAD] * 2, "start": near(3)}, "start must carry one leading axis of 2"),
        ({"start": replace(near(3), velocity=np.zeros((2, 3)))}, "same leading axis of 3"),
        ({"start": one(replace(near(1), q_world_body=np.array([[2.0, 0, 0, 0]])), 0)}, "unit quaternion"),
        (
            {"start": one(replace(near(1), position=np.full((1, 3), np.nan)), 0)},
            "start.position must be numbers",
        ),
    ],
)
def test_arguments_that_do_not_fit_are_refused_in_one_sentence(arguments: dict, sentence: str) -> None:
    with pytest.raises(SpecError, match=sentence) as caught:
        fly(**{"plan": AT_REST, "vehicle": QUAD, **arguments})
    assert "\n" not in str(caught.value)


def test_a_controller_of_its_own_is_flown() -> None:
    loose = fly(
        loops(3.0), QUAD, start=one(near(1), 0), controller=Controller(position_gain=4.0, velocity_gain=3.0)
    )
    tight = fly(loops(3.0), QUAD, start=one(near(1), 0))
    assert np.abs(loose.states.position - tight.states.position).max() > 0.01


def test_a_series_that_a_flight_has_not_is_answered_by_those_that_it_has() -> None:
    flight = fly(AT_REST, QUAD)
    with pytest.raises(AttributeError, match="no 'observed_position'; its series are ") as raised:
        flight.observed_position  # noqa: B018
    assert str(raised.value).partition("series are ")[2].split(", ") == list(flight.series)
