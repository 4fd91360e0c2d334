"""Sliders of live pages: each changes what it says, and nothing where it stands."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.states import STANDARD_GRAVITY
from aerobat.viewer.live.sliders import Setting, Slider, moved, sliders_of
from obstacle_cases import walled_cruise
from shared_plans import shared_plan

NAMES = ("flip-roll", "half-flip", "line", "flip-roll-translation")


def setting(name: str) -> Setting:
    plan = shared_plan(name)
    assert plan.vehicle is not None
    return Setting(plan.problem, ab.Miqp(), plan.vehicle, ab.load_dispersion("lab"))


@lru_cache
def sliders(name: str) -> dict[str, Slider]:
    return {slider.key: slider for slider in sliders_of(setting(name), shared_plan(name))}


def value(setting: Setting, key: str) -> float:
    """What a setting says, asked for in another way than the sliders."""
    gate = setting.problem.gates[0] if setting.problem.gates else None
    maneuver: Any = setting.problem.maneuver
    said = {
        "vehicle.thrust_to_weight": lambda: (
            setting.vehicle.max_thrusts.sum() / setting.vehicle.mass / STANDARD_GRAVITY
        ),
        "planner.order": lambda: setting.planner.order,
        "dispersion": lambda: setting.dispersion,
        "gates[0].position.x": lambda: gate.position[0],
        "gates[0].position.y": lambda: gate.position[1],
        "gates[0].position.z": lambda: gate.position[2],
        "gates[0].tilt": lambda: np.degrees(np.arctan2(-gate.up @ upright(gate), gate.up[2])),
        "maneuver.min_lateral_thrust": lambda: maneuver.min_lateral_thrust,
        "maneuver.min_inverted_thrust": lambda: maneuver.min_inverted_thrust,
    }
    return float(said[key]())


def upright(gate: ab.Gate) -> np.ndarray:
    """What is to the left of who passes an upright gate of this direction."""
    return np.cross([0.0, 0.0, 1.0], gate.normal)


@pytest.mark.parametrize("name", NAMES)
def test_sliders_that_stand_as_at_first_change_no_gate_order_or_vehicle(name: str) -> None:
    begun = setting(name)
    stand = {key: slider.value for key, slider in sliders(name).items() if "thrust" not in key}
    same = moved(begun, list(sliders(name).values()), stand)
    for gate, was in zip(same.problem.gates, begun.problem.gates, strict=True):
        for name in ("position", "normal", "up"):
            np.testing.assert_allclose(getattr(gate, name), getattr(was, name), atol=1e-12)
    assert replace(same.planner, order=None) == begun.planner
    assert same.vehicle == begun.vehicle


@given(name=st.sampled_from(NAMES[1:3]), data=st.data())
def test_a_slider_changes_what_it_says_and_nothing_else(name: str, data: st.DataObject) -> None:
    known = sliders(name)
    key = data.draw(st.sampled_from(sorted(known)))
    slider = known[key]
    low = max(slider.low, -90.0) if key.endswith("tilt") else slider.low
    high = min(slider.high, 90.0) if key.endswith("tilt") else slider.high
    to = data.draw(st.floats(low, high))
    if key == "planner.order":
        to = round(to)
    begun = setting(name)
    changed = moved(begun, list(known.values()), {key: to})
    assert value(changed, key) == pytest.approx(to, abs=1e-6)
    kept = {"vehicle": "vehicle", "planner": "planner", "dispersion": "dispersion"}.get(
        key.split(".")[0], "problem"
    )
    for field in fields(Setting):
        if field.name != kept:
            assert getattr(changed, field.name) == getattr(begun, field.name)


def test_the_gate_of_a_flip_turns_with_it() -> None:
    """About the axis of the turn: whatever its tilt, the flip comes by it."""
    begun = setting("flip-roll")
    for tilt in (100.0, 150.0, 230.0):
        turned = moved(begun, list(sliders("flip-roll").values()), {"gates[0].tilt": tilt}).problem.gates[0]
        axis = begun.problem.maneuver.turn_axis
        assert axis is not None
        assert turned.up @ axis == pytest.approx(0.0, abs=1e-12)
        assert turned.up[2] == pytest.approx(np.cos(np.radians(tilt)), abs=1e-12)


@pytest.mark.parametrize(
    "values", [{"gates[0].position.z": 1e9}, {"gates[7].position.z": 0.0}, {"order": 4.0}]
)
def test_what_no_slider_says_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(ab.SpecError, match="there is no slider that stands at"):
        moved(setting("half-flip"), list(sliders("half-flip").values()), values)


@given(first=st.floats(0.0, 1.5), second=st.floats(0.0, 1.5))
def test_conditions_are_scaled_as_numbers_are(first: float, second: float) -> None:
    lab = ab.load_dispersion("lab")
    twice, once = lab.scaled(first).scaled(second), lab.scaled(first * second)
    assert np.allclose(numbers(twice), numbers(once), rtol=1e-12, atol=1e-300)
    assert lab.scaled(1.0) == lab


def test_scaled_to_nothing_no_number_of_a_spread_noise_or_gust_is_left() -> None:
    still = ab.load_dispersion("lab").scaled(0.0)
    assert (still.mass, still.lag, still.drag, still.start_attitude) == (0.0,) * 4
    assert still.imu is not None
    assert (still.imu.gyro_noise, still.imu.gyro_bias_walk, still.imu.rate) == (0.0, 0.0, 1000.0)
    assert still.motion_capture is not None
    assert (still.motion_capture.position_noise, still.motion_capture.rate) == (0.0, 100.0)
    assert still.motion_capture.hand_off is not None
    assert still.motion_capture.hand_off.warp == 0.0
    assert still.gusts is not None
    assert (still.gusts.intensity, still.gusts.length) == (0.0, 1.0)
    with pytest.raises(ab.SpecError, match="mass"):
        ab.load_dispersion("lab").scaled(40.0)


def numbers(value: Any) -> list[float]:
    """All numbers of conditions."""
    if isinstance(value, bool | str) or value is None:
        return []
    if isinstance(value, float | int):
        return [float(value)]
    if isinstance(value, np.ndarray):
        return [float(x) for x in value.ravel()]
    return [x for field in fields(value) for x in numbers(getattr(value, field.name))]


PLACED = (
    ab.Box((1.0, 2.0, 1.0), (0.5, 0.5, 0.5), tilt=0.3),
    ab.Cylinder((1.0, -2.0, 0.0), (1.0, -2.0, 2.0), 0.3),
    ab.Polytope(np.eye(4)[:, :3] + [0.5, 2.0, 1.0]),
    ab.Grid(((0, 0, 0, 1, 1, 1),), 0.5, (1.0, 3.0, 0.0)),
    ab.Mesh((np.eye(4)[:, :3],), (0.5, -3.0, 1.0)),
    ab.Sphere((1.0, 4.0, 1.0), 0.5),
    ab.Sphere((2.0, 4.0, 1.0), 0.5),
)


@pytest.mark.parametrize("k", range(len(PLACED)))
def test_an_obstacle_is_moved_as_a_whole_by_its_sliders_and_no_other_is(k: int) -> None:
    plan = walled_cruise(PLACED)
    assert plan.vehicle is not None
    begun = Setting(plan.problem, ab.Miqp(), plan.vehicle, ab.load_dispersion("lab"))
    known = sliders_of(begun, plan)
    shift = {
        f"environment.obstacles[{k}].{axis}": by for axis, by in zip("xyz", (0.2, -0.1, 0.3), strict=True)
    }
    stands = {slider.key: slider.value for slider in known}
    after = moved(begun, known, {key: stands[key] + by for key, by in shift.items()}).problem.environment
    for j, (obstacle, was) in enumerate(zip(after.obstacles, PLACED, strict=True)):
        moves = list(shift.values()) if j == k else np.zeros(3)
        for piece, before in zip(obstacle.pieces, was.pieces, strict=True):
            np.testing.assert_allclose(piece.points, before.points + moves, atol=1e-12)


def test_obstacles_of_one_name_have_groups_of_their_own() -> None:
    plan = walled_cruise(PLACED)
    assert plan.vehicle is not None
    known = sliders_of(Setting(plan.problem, ab.Miqp(), plan.vehicle, ab.load_dispersion("lab")), plan)
    groups = {slider.group for slider in known if slider.key.startswith("environment")}
    assert groups == {"box", "cylinder", "polytope", "grid", "mesh", "sphere 5", "sphere 6"}
