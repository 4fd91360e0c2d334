"""Conditions in the loop: the same numbers in every engine, chunk and batch; none where nothing is asked."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from aerobat.engines.engine import expanded
from aerobat.engines.pytree import tree_leaves
from aerobat.environment import Battery, Dispersion, Gusts, HandOff, Imu, MotionCapture, load_dispersion
from aerobat.kernels.battery import BatteryState
from aerobat.kernels.imu import ImuSample, ImuState
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.wind import WindState
from aerobat.simulation import Outcome, fly
from aerobat.simulation.components import log_row
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.conditions.random_source import InputNumber, RandomSource
from aerobat.simulation.conditions.sensors import MocapState
from aerobat.simulation.loop import LoopPart
from aerobat.trajectory import Trajectory
from dispersed_loops import dispersed_setup, drawn, rows_of
from looping_flights import HEXA, assert_same, loops
from suites import examples

SEAM = HandOff((0.3, 0.0, 0.0), (1.0, 0.0, 0.0), 0.05, 0.03, 0.01)
LAB = load_dispersion("lab")
ALL = replace(LAB, motion_capture=replace(LAB.motion_capture, hand_off=SEAM, outlier=0.1, dropout=0.1))
TICKS = 120
TWO_NORMALS_AND_A_UNIFORM = (InputNumber.NORMAL, InputNumber.NORMAL, InputNumber.UNIFORM)


def position(signals: Any) -> Any:
    return signals.plant.body.position


def everything(signals: Any) -> Any:
    kinds = (WindState, BatteryState, ImuSample, ImuState, MocapState, VehicleState)
    return tuple(map(signals.of, kinds))


@cache
def rows(engine: str, flights: int = 3) -> list[np.ndarray]:
    setup = dispersed_setup(loops(1.0), HEXA, ALL, drawn(ALL, HEXA, flights), engine=engine)
    return tree_leaves(rows_of(setup, everything, TICKS))


@dataclass(frozen=True)
class HeldPlant:
    """A body that stands still at its start, so that there is little to compile."""

    feedthrough: bool = False

    def init(self, thrusts: Any, signals: Any) -> VehicleState:
        return VehicleState(signals.start, thrusts)

    def step(self, thrusts: Any, motion: VehicleState, signals: Any) -> VehicleState:
        return motion


def test_a_last_tick_shorter_than_the_delay_of_rotors_without_lag_is_flown_alike_by_all_engines() -> None:
    gentle = loops(0.2015)
    path = Trajectory(gentle.durations, 0.02 * gentle.coefficients)
    flights = [
        fly(path, "section-v", conditions=LAB, flights=1, engine=engine) for engine in ("floats", "compiled")
    ]
    for flight in flights:
        assert flight.outcomes == (Outcome.COMPLETE,)
        assert_same(flight, flights[0], atol=1e-9)


@cache
def held_rows(engine: str) -> list[np.ndarray]:
    setup = dispersed_setup(loops(1.0), HEXA, ALL, drawn(ALL, HEXA, 3), engine=engine)
    thrusts = tuple(np.linspace(1.0, 2.0, 3) for _ in range(6))
    setup = replace(setup, parts=(*setup.parts[:-3], LoopPart(HeldPlant(), thrusts)))
    return tree_leaves(rows_of(setup, everything, TICKS))


@pytest.mark.parametrize("engine", ["floats", "compiled", pytest.param("jax", marks=pytest.mark.slow)])
def test_engines_agree_with_floats_on_all_that_sensors_and_disturbances_show(engine: str) -> None:
    for one, other in zip(held_rows("floats"), held_rows(engine), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("engine", ["floats", "compiled"])
def test_engines_agree_with_floats_on_flights_under_conditions(engine: str) -> None:
    for one, other in zip(rows("floats"), rows(engine), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-11)


def test_a_flight_of_a_batch_is_the_flight_alone() -> None:
    batch, draws = rows("floats", 5), Draws(ALL, 6, 7, [3])
    setup = dispersed_setup(loops(1.0), HEXA, ALL, draws, engine="floats")
    alone = tree_leaves(rows_of(setup, everything, TICKS))
    for one, other in zip(batch, alone, strict=True):
        np.testing.assert_array_equal(one[3], other[0])


def test_conditions_that_change_nothing_change_no_bit_of_a_flight() -> None:
    idle = Dispersion(
        imu=Imu(), motion_capture=MotionCapture(), gusts=Gusts(), battery=Battery(endurance=1e9)
    )
    with_them, without = (
        tree_leaves(rows_of(dispersed_setup(loops(1.0), HEXA, d, drawn(d, HEXA, 2)), log_row))
        for d in (idle, Dispersion())
    )
    for one, other in zip(with_them, without, strict=True):
        np.testing.assert_array_equal(one, other)


def test_wind_weak_rotors_and_an_empty_battery_each_change_a_flight() -> None:
    changes = (
        {"gusts": Gusts(mean_wind=2.0), "drag": 0.2},
        {"rotor": 0.05},
        {"mass": 0.05},
        {"lag": 0.3},
        {"battery": Battery(endurance=0.5, sag=0.8)},
    )
    still, *others = (
        rows_of(
            dispersed_setup(loops(1.0), HEXA, each, drawn(each, HEXA, 1), engine="compiled"), position, 700
        )
        for each in (Dispersion(), *(Dispersion(**change) for change in changes))
    )
    for other in others:
        assert np.abs(np.subtract(other, still)).max() > 1e-3


def numbers(source: RandomSource, begin: int, end: int) -> np.ndarray:
    """Those of every tick, (numbers, ticks, vehicles)."""
    return np.array(expanded(source.chunk(begin, end)))


@examples(30)
@given(st.lists(st.integers(0, 300), min_size=2, max_size=6), st.sampled_from([1, 3, 10]))
def test_random_numbers_are_the_same_however_they_are_asked_for(cuts: list[int], period: int) -> None:
    """Forward in chunks of any size, over gaps, and back again; between samples stands the last one."""
    seeds = [np.random.SeedSequence(5, spawn_key=(k,)) for k in range(3)]

    def source() -> RandomSource:
        return RandomSource(seeds, TWO_NORMALS_AND_A_UNIFORM, period=period, block=8)

    whole, cut = numbers(source(), 0, 302), source()
    for begin, end in pairwise(cuts):
        begin, end = min(begin, end), max(begin, end) + 1
        np.testing.assert_array_equal(numbers(cut, begin, end), whole[:, begin:end])
    one = RandomSource(seeds[1:2], TWO_NORMALS_AND_A_UNIFORM, period=period, block=8)
    alone = numbers(one, 0, 302)
    np.testing.assert_array_equal(alone[..., 0], whole[..., 1])
    samples = whole[:, ::period]
    np.testing.assert_array_equal(whole, np.repeat(samples, period, axis=1)[:, :302])
    assert len(np.unique(samples[2])) == samples[2].size


def test_random_numbers_are_normal_and_uniform() -> None:
    seeds = [np.random.SeedSequence(5, spawn_key=(k,)) for k in range(70)]
    normal, other, uniform = numbers(RandomSource(seeds, TWO_NORMALS_AND_A_UNIFORM), 0, 500)
    for values, law in ((normal, "norm"), (other, "norm"), (uniform, "uniform")):
        assert stats.kstest(values.ravel(), law).pvalue > 1e-3
    assert abs(np.corrcoef(normal.ravel(), other.ravel())[0, 1]) < 0.02
    assert abs(np.corrcoef(normal[1:].ravel(), normal[:-1].ravel())[0, 1]) < 0.02
    assert 0.0 < uniform.min() < 1e-3 < 0.999 < uniform.max() < 1.0
