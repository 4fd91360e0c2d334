"""A limit is one thing, whichever program holds it: search, refinements, the look between samples, proof."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.certification import Side, certify
from aerobat.environment import Environment
from aerobat.flatness import Reference, reference
from aerobat.limits import Limit, limits_along
from aerobat.limits.limit import size_of
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.refinement.limit_values import Frames, LimitValues
from aerobat.planning.refinement.refine import knots_at_stages
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem import Condition, Limits, Problem, load_problem
from aerobat.problem.condition import Quantity
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle
from collocation.optimal_control.bounds import LOOKS, Bounds
from shared_plans import shared_plan
from suites import examples

CONDITION = Condition(Quantity.SPECIFIC_THRUST, [0.3, -0.5, 1.0], lower=-40.0, upper=90.0)
NEAR = 1e-6  # [s]
WIND = Environment(wind=[1.0, -2.0, 0.5], ground=-5.0)
BOX = Limits(
    lower=[-11.0] * 3, upper=[11.0] * 3, velocity=30.0, acceleration=120.0, jerk=900.0, snap=2e4, max_tilt=3.1
)


@pytest.fixture(scope="module")
def flown() -> Trajectory:
    """A flip, cut into many parts: body axes are exact where places are near each other."""
    whole = WarmStart(shared_plan("flip-roll-translation").trajectory, (), ())
    return knots_at_stages(whole, 40).trajectory


@pytest.fixture(scope="module", params=[0.0, 0.06], ids=["equal drag", "unequal drag"])
def craft(request: pytest.FixtureRequest) -> Vehicle:
    drag = np.array([0.2 + request.param, 0.2 - request.param, 0.1])
    return replace(load_vehicle("agile-quad"), drag_body=drag, max_body_rate=40.0)


def asked(craft: Vehicle) -> Task:
    """A task with a limit of every family."""
    task = Task.of(replace(load_problem("flip-roll"), limits=BOX, environment=WIND), craft)
    return replace(task, stages=replace(task.stages, path_constraints=(CONDITION,)))


def sampled(flown: Trajectory, craft: Vehicle, times: np.ndarray) -> tuple[LimitValues, np.ndarray, Frames]:
    rows = LimitValues(asked(craft))
    derivatives = np.stack([flown.evaluate(times, k) for k in range(6)], axis=1)
    return rows, derivatives, rows.frames(times, derivatives)


@lru_cache(maxsize=2)  # of many limits
def references(flown: Trajectory, craft: Vehicle, times: tuple[float, ...]) -> list[Reference]:
    """References at some times, and a moment after and before each."""
    return [reference(flown, craft, np.array(times) + h, environment=WIND) for h in (0.0, NEAR, -NEAR)]


def by_flatness(
    flown: Trajectory, craft: Vehicle, times: np.ndarray, limit: Limit, along_b3: bool = False
) -> np.ndarray:
    """What a limit is about, by flatness and differences of it in time.

    Of the specific thrust it is that of the mean drag, or what of it is along b3.
    """
    here, ahead, behind = references(flown, craft, tuple(times))
    if limit.rotor is not None:
        thrust = here.rotor_thrusts[:, limit.rotor]
        if limit.name == "thrust":
            return thrust
        rate = (ahead.rotor_thrusts - behind.rotor_thrusts)[:, limit.rotor] / (2 * NEAR)
        return np.asarray(thrust + craft.rotors[limit.rotor].lag * rate)
    if limit.name == "body rate":
        return np.linalg.norm(here.setpoint.omega_body, axis=-1)
    if limit.name == "tilt":
        return so3.thrust_axis(here.setpoint.q_world_body)[:, 2]
    airspeed, acceleration = flown.evaluate(times, 1) - WIND.wind, flown.evaluate(times, 2)
    thrust = acceleration + 0.2 / craft.mass * airspeed + WIND.weight
    if limit.name == "specific thrust":
        return np.sum(so3.thrust_axis(here.setpoint.q_world_body) * thrust, axis=-1)
    if limit.name == CONDITION.name and along_b3:
        axis = so3.thrust_axis(here.setpoint.q_world_body)
        return np.asarray(np.sum(axis * thrust, axis=-1) * (axis @ CONDITION.direction))
    if limit.name == CONDITION.name:
        return np.asarray(thrust @ CONDITION.direction)
    derivative, axis = limit.name.split()
    order = ("position", "velocity", "acceleration", "jerk", "snap").index(derivative)
    return flown.evaluate(times, order)[:, "xyz".index(axis)]


def test_the_refinement_holds_what_flatness_says_of_every_limit(flown: Trajectory, craft: Vehicle) -> None:
    times = flown.knots[:-1] + 0.3 * flown.durations
    rows, derivatives, frames = sampled(flown, craft, times)
    for (limit, sign), excess in zip(rows.sides, rows.values(derivatives, frames).T, strict=True):
        end = limit.upper if sign > 0.0 else limit.lower
        expected = sign * (by_flatness(flown, craft, times, limit) - end) / limit.size
        np.testing.assert_allclose(excess, expected, atol=1e-3, err_msg=limit.name)


def test_slopes_of_every_limit_are_its_differences(flown: Trajectory, craft: Vehicle) -> None:
    times = flown.knots[2:6] + 0.4 * flown.durations[2:6]
    rows, derivatives, frames = sampled(flown, craft, times)
    slopes = rows.slopes(derivatives, frames)
    rng = np.random.default_rng(0)
    step = rng.normal(size=derivatives.shape) * np.abs(derivatives).max(axis=(0, 2))[:, None]
    ahead, behind = (rows.values(derivatives + h * step, frames) for h in (1e-6, -1e-6))
    expected = (ahead - behind) / 2e-6
    found = slopes.along(step)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * np.abs(expected).max())


def test_second_derivatives_of_every_limit_are_differences_of_its_slopes(
    flown: Trajectory, craft: Vehicle
) -> None:
    times = flown.knots[2:6] + 0.4 * flown.durations[2:6]
    rows, derivatives, frames = sampled(flown, craft, times)
    rng = np.random.default_rng(0)
    weights = rng.normal(size=(len(times), len(rows.sides)))
    step = rng.normal(size=derivatives.shape) * np.abs(derivatives).max(axis=(0, 2))[:, None]
    second = rows.curvature(derivatives, frames, weights, 0.0 * weights)
    moved = (rows.slopes(derivatives + h * step, frames) for h in (1e-6, -1e-6))
    ahead, behind = (slopes.weighted(weights) for slopes in moved)
    found = (second @ step.reshape(len(times), -1, 1)).reshape(len(times), 6, 3)[:, 1:]
    change = (ahead - behind)[:, 1:] / 2e-6
    scale = np.abs(change).max(axis=(0, 2), keepdims=True)
    np.testing.assert_allclose(found / scale, change / scale, atol=1e-4)


def test_weighted_slopes_and_squares_are_those_of_changes_along_a_step(
    flown: Trajectory, craft: Vehicle
) -> None:
    times = flown.knots[2:6] + 0.4 * flown.durations[2:6]
    rows, derivatives, frames = sampled(flown, craft, times)
    slopes, rng = rows.slopes(derivatives, frames), np.random.default_rng(0)
    weights, step = rng.uniform(size=(len(times), len(rows.sides))), rng.normal(size=derivatives.shape)
    moved = slopes.along(step)
    expected = np.sum(weights * moved, axis=1)
    np.testing.assert_allclose(np.sum(slopes.weighted(weights) * step, axis=(1, 2)), expected, rtol=1e-9)
    second = rows.curvature(derivatives, frames, 0.0 * weights, weights)
    flat = step.reshape(len(times), -1)
    found = np.einsum("mi,mij,mj->m", flat, second, flat)
    np.testing.assert_allclose(found, np.sum(weights * moved**2, axis=1), rtol=1e-9)


def test_collocation_looks_at_what_flatness_says_of_every_limit(flown: Trajectory, craft: Vehicle) -> None:
    bounds = Bounds.of(asked(craft))
    times = flown.knots[:-1, None] + LOOKS * flown.durations[:, None]
    inner = times[:, 6:-6].ravel()  # differences in time know nothing of knots
    found = bounds.along(flown)[:, 6:-6].reshape(len(inner), -1)
    limits = [*bounds.path, *bounds.driven, bounds.rate]
    for limit, values in zip(limits, found.T, strict=True):
        assert limit is not None
        expected = by_flatness(flown, craft, inner, limit) - limit.quantity.constant
        np.testing.assert_allclose(values, expected, atol=3e-3 * limit.size, err_msg=limit.name)


def test_a_certificate_states_every_limit_as_far_as_samples_reach_and_little_further(
    flown: Trajectory, craft: Vehicle
) -> None:
    times = np.linspace(1e-5, flown.duration - 1e-5, 1500)
    findings = certify(flown, craft, WIND, asked(craft).envelope()).findings
    for limit in asked(craft).limits:
        if not limit.is_proven:
            continue
        values = by_flatness(flown, craft, times, limit, along_b3=True)
        ends = [(Side.MIN, limit.lower, values.min()), (Side.MAX, limit.upper, values.max())]
        if limit.name == "tilt":  # told as an angle, held by its cosine
            ends = [(Side.MAX, np.arccos(limit.lower), np.arccos(values.min()))]
        for side, end, reached in ends:
            if np.isfinite(end):
                (finding,) = (
                    f for f in findings if (f.quantity, f.side, f.rotor) == (limit.name, side, limit.rotor)
                )
                assert (finding.rotor, finding.size) == (limit.rotor, limit.size)
                assert finding.limit == pytest.approx(end)
                assert finding.field == limit.fields[side is Side.MAX]
                beyond = (finding.bound - reached) * (1.0 if side is Side.MAX else -1.0)
                assert -1e-4 * limit.size <= beyond <= 0.06 * limit.size, limit.name


def test_the_search_holds_the_linear_limits_and_no_other(craft: Vehicle) -> None:
    problem = replace(load_problem("line"), limits=replace(BOX, snap=np.inf), environment=WIND)
    free = formulate(Task.of(replace(problem, limits=Limits()), craft), 4, 10)
    held = formulate(Task.of(problem, craft), 4, 10)
    assert all(limit.quantity.is_of_path for limit in held.task.limits if limit.linear)
    lower, upper = held.program(0.2).lower, held.program(0.2).upper
    assert np.isfinite([*lower, *upper]).sum() > np.isfinite([*free.program(0.2).lower]).sum()


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3))
@examples(60)
def test_an_excess_is_told_in_parts_of_what_lies_between_the_ends(lower: float, upper: float) -> None:
    lower, upper = sorted((lower, upper))
    assert size_of(lower, upper) > 0.0
    if upper > lower:
        assert size_of(lower, upper) == upper - lower


def test_problems_without_a_vehicle_have_limits_on_the_path_alone() -> None:
    problem: Problem = replace(load_problem("line"), limits=BOX)
    limits = limits_along(None, WIND, problem.path_limits, (CONDITION,))
    assert limits
    assert {limit.name for limit in limits if not limit.quantity.is_of_path} == {"tilt"}
