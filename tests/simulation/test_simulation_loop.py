"""A flight is a loop of components: cut, stepped, resumed or branched it is the same flight; periods hold."""

import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

import aerobat as ab
from aerobat.engines import ENGINE_NAMES, choose, run_whole
from aerobat.engines.pytree import tree_leaves, tree_map
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.kernels.rigid_body import Body
from aerobat.simulation import FlightConfig, fly, prepare
from aerobat.simulation.loop import Due, LoopInput, LoopParameters, StepClock, compose
from aerobat.simulation.reference_source import _block
from aerobat.simulation.setup import FlightSetup
from aerobat.vehicle import load_vehicle
from looping_flights import HEXA, QUAD, assert_same, loops, near
from shared_plans import shared_plan


def flight_of(engine: str, vehicles: Any = QUAD, duration: float = 1.0) -> FlightSetup:
    return prepare(loops(duration), vehicles, config=FlightConfig(engine=engine))


def with_observer_period(setup: FlightSetup, period: int) -> FlightSetup:
    return replace(setup, parts=(replace(setup.parts[0], period=period), *setup.parts[1:]))


def assert_equal(a: Any, b: Any) -> None:
    for x, y in zip(tree_leaves(a), tree_leaves(b), strict=True):
        np.testing.assert_array_equal(x, y)


FLEETS = {"one": (QUAD, 7), "six": ([QUAD] * 6, 1)}  # vehicles and the period of their observers
AT_ONCE = [name for name in ENGINE_NAMES if not name.startswith("jax")]


@pytest.mark.parametrize(
    ("engine", "fleet"),
    [
        *((engine, fleet) for fleet in FLEETS for engine in AT_ONCE),
        pytest.param("jax", "one", marks=pytest.mark.slow),  # in float32 too: test_engines_stepping.py
    ],
)
def test_stepped_cut_and_resumed_a_flight_is_the_same_to_the_last_bit(engine: str, fleet: str) -> None:
    vehicles, observer_period = FLEETS[fleet]
    setup = with_observer_period(flight_of(engine, vehicles), observer_period)
    # XLA compiles a scan of up to 16 ticks, and of up to 8: whole and in parts
    loop, (kept_at, cut, ticks) = setup.compile(), (20, 33, 40) if engine in AT_ONCE else (5, 9, 12)
    whole, rows = loop.scan(loop.init(setup.first_tick), setup.inputs(0, ticks))
    carry = loop.init(setup.first_tick)
    for tick in range(kept_at):
        carry, row = loop.step(carry, setup.tick(tick))
        assert_equal(row, tree_map(lambda leaf, k=tick: leaf[:, k], rows))
    kept = pickle.loads(pickle.dumps(carry))
    again = with_observer_period(flight_of(engine, vehicles), observer_period).compile()
    carry, row = again.scan(kept, setup.inputs(kept_at, cut))
    assert_equal(row, tree_map(lambda leaf: leaf[:, kept_at:cut], rows))
    carry, _ = loop.scan(carry, setup.inputs(cut, ticks))
    assert_equal(carry, whole)


def test_a_flight_branched_in_the_air_goes_both_ways() -> None:
    setup = flight_of("compiled")
    loop = setup.compile()
    carry, _ = loop.scan(loop.init(setup.first_tick), setup.inputs(0, 200))
    observer, controller, plant = carry
    velocity = tuple(v + 0.5 for v in plant.body.velocity)
    gust = (observer, controller, plant._replace(body=plant.body._replace(velocity=velocity)))
    rest = setup.inputs(200, 501)
    calm, pushed = loop.scan(carry, rest)[1], loop.scan(gust, rest)[1]
    gap = np.abs(np.array(calm.motion.body.position) - np.array(pushed.motion.body.position))
    assert gap[..., 0].max() == 0.0
    assert gap.max() > 0.005
    assert_equal(calm, loop.scan(carry, rest)[1])


@pytest.fixture
def no_known_blocks() -> Iterator[None]:
    """Blocks of set-points made anew, then forgotten, for the test makes others of the same plan."""
    _block.cache_clear()
    yield
    _block.cache_clear()


@pytest.mark.usefixtures("no_known_blocks")
@pytest.mark.parametrize(
    "log_rate", [100.0, *(pytest.param(rate, marks=pytest.mark.slow) for rate in (None, 3.125))]
)
def test_neither_blocks_of_references_nor_chunks_of_noise_change_a_flight(
    monkeypatch, log_rate: float | None
) -> None:
    path = loops(2.0)
    options = {"conditions": "lab", "flights": 3, "seed": 3, "log_rate": log_rate, "engine": "compiled"}
    whole = fly(path, HEXA, **options)
    monkeypatch.setattr("aerobat.simulation.setup._VEHICLE_TICKS", 3 * 37)
    assert_same(fly(path, HEXA, **options), whole)
    for module in ("setup", "reference_source"):
        monkeypatch.setattr(f"aerobat.simulation.{module}.BLOCK", 130)
    _block.cache_clear()
    assert_same(fly(path, HEXA, **options), whole, atol=1e-12)


class Slow(NamedTuple):
    steps: Any
    elapsed: Any


class Plain(NamedTuple):
    steps: Any
    elapsed: Any


class Seen(NamedTuple):
    steps: Any


Count = Slow | Plain


@dataclass(frozen=True)
class Counter:
    """Counts its steps and the time between them."""

    kind: type[Count]
    feedthrough: bool = True

    def init(self, parameters: Any, signals: Any) -> Count:
        return self.kind(0.0, 0.0)

    def step(self, parameters: Any, state: Count, signals: Any) -> Count:
        return self.kind(state.steps + 1.0, signals.clock.elapsed)


@dataclass(frozen=True)
class Follower:
    """Shows what it sees of another."""

    of: type[Count]
    feedthrough: bool = True

    def init(self, parameters: Any, signals: Any) -> Seen:
        return Seen(0.0)

    def step(self, parameters: Any, state: Seen, signals: Any) -> Seen:
        return Seen(signals.of(self.of).steps)


def log(signals: Any) -> Any:
    return signals.of(Slow), signals.of(Plain), signals.of(Seen)


@pytest.mark.parametrize("engine", ["floats", "compiled", pytest.param("jax", marks=pytest.mark.slow)])
def test_a_component_steps_at_its_own_period_and_holds_between(engine: str) -> None:
    """And one without feedthrough is seen a tick later, wherever in the order it stands."""
    components = (Counter(Slow), Counter(Plain, feedthrough=False), Follower(Plain))
    start = Body(*((np.zeros(2),) * n for n in (3, 3, 4, 3)))
    parameters = LoopParameters(start, ((), (), ()))
    times = np.full(11, 0.01)
    due = Due((np.arange(11) % 4 == 0).astype(float), StepClock(4 * times, 4 * times))
    inputs = LoopInput(StepClock(times, times), (due, (), ()), (), ((), (), ()))
    slow, plant, follower = run_whole(choose(engine, 2, 11), *compose(components, log), parameters, inputs)
    assert slow[0][1].tolist() == [1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3]
    np.testing.assert_allclose(slow[1][1], 0.04, rtol=1e-15)
    assert plant[0][1].tolist() == list(range(11))
    assert follower.steps[1].tolist() == list(range(11))


def test_a_slower_observer_makes_a_worse_flight_and_touches_nothing_else() -> None:
    setup = flight_of("compiled", duration=6.0)
    errors = []
    for period in (1, 10):
        slower = with_observer_period(setup, period)
        inputs = slower.inputs(0, len(setup.times))
        functions = compose(slower.components, lambda signals: signals.plant.body)
        flown = run_whole(setup.engine(), *functions, setup.parameters, inputs).position
        path = np.array(inputs.reference.position)[:, None]
        errors.append(np.linalg.norm(np.array(flown) - path, axis=0).max())
    assert errors[0] < 0.02 < errors[1] < 1.0


def test_where_it_flies_is_the_problems_matter_unless_said_otherwise() -> None:
    windy = Environment(wind=[2.0, 0.0, 0.0])
    crazyflie = load_vehicle("crazyflie")
    calm, blown = fly(loops(8.0), crazyflie), fly(loops(8.0), crazyflie, environment=windy)
    assert blown.environment is windy
    assert np.abs(calm.thrusts - blown.thrusts).max() > 1e-4
    assert np.abs(calm.states.position - blown.states.position).max() < 0.02  # the controller knows


@pytest.mark.parametrize(
    ("vehicle", "environment", "sentence"),
    [(None, None, "vehicle is missing"), (QUAD, Environment(gravity=90.0), "rotors cannot")],
)
def test_what_cannot_fly_is_refused(vehicle: Any, environment: Any, sentence: str) -> None:
    with pytest.raises(SpecError, match=sentence):
        fly(loops(1.0), vehicle, environment=environment)


def test_starts_of_a_batch_are_its_vehicles() -> None:
    batch = fly(loops(1.0), QUAD, start=near(3))
    assert batch.states.position.shape[0] == len(batch.vehicles) == 3


@pytest.mark.parametrize("tick", [-1, 10**6])
def test_a_tick_that_a_flight_has_not_is_refused(tick: int) -> None:
    setup = ab.prepare(shared_plan("line"))
    with pytest.raises(ab.SpecError, match="tick must be from 0 to"):
        setup.tick(tick)
