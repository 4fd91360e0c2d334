"""Plans in the files of other systems: what others' readers find there is the plan within the stated loss."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pygltflib import GLTF2
from scipy.spatial.transform import Rotation

import aerobat as ab
from aerobat.interchange.exports import FORMATS
from aerobat.interchange.exports.loss import HELD, peak_difference
from export_readers import READERS, bag_messages
from shared_plans import shared_plan
from suites import examples

SUFFIXES = {name: form.suffix for name, form in FORMATS.items()}


@pytest.fixture(scope="module")
def flip() -> ab.Plan:
    """A flip with translation, its heading turned, for a vehicle with drag."""
    found = shared_plan("flip-roll-translation", "hexarotor")
    vehicle = replace(found.vehicle, drag_body=(0.3, 0.3, 0.1))
    return replace(found, vehicle=vehicle, trajectory=replace(found.trajectory, heading=0.7))


@pytest.mark.parametrize("to", READERS)
def test_what_is_read_back_is_the_plan_within_the_stated_loss_and_that_is_no_larger_than_it_is(
    to: str, flip: ab.Plan, tmp_path: Path
) -> None:
    path = tmp_path / f"flip{SUFFIXES[to]}"
    made = ab.export(flip, path, to, rate=61.0)
    read = READERS[to](path)
    times = np.sort(np.random.default_rng(3).uniform(0.0, read.times[-1] - 1e-9, 20_000))
    position, velocity, attitude = read.at(times, made.loss.reading == HELD)
    if to == "blender":  # a line's slope holds until the next key
        velocity = read.velocity[np.searchsorted(read.times, times, side="right") - 1]
    planned = ab.reference(flip, times=times).setpoint
    turns = Rotation.from_quat(planned.q_world_body[:, [1, 2, 3, 0]])
    up = np.array([0.0, 0.0, 1.0])
    between = np.linalg.norm(np.cross(turns.apply(up), attitude.apply(up)), axis=1)
    found = {
        "position": np.linalg.norm(position - planned.flat.position, axis=1).max(),
        "velocity": np.linalg.norm(velocity - planned.flat.velocity, axis=1).max(),
        "attitude": (turns.inv() * attitude).magnitude().max(),
        "thrust_axis": np.arcsin(between).max(),
    }
    assert read.times[-1] == pytest.approx(flip.duration, abs=1e-6)
    for name, largest in found.items():
        stated = getattr(made.loss, name)
        assert largest <= stated * (1.0 + 1e-9) + 1e-9, name
        assert largest >= 0.9 * stated, name


@examples(30)
@given(seed=st.integers(0, 2**32 - 1), derivative=st.integers(0, 2))
def test_the_peak_of_a_difference_is_that_of_its_densest_samples(seed: int, derivative: int) -> None:
    rng = np.random.default_rng(seed)
    ends = rng.uniform(0.05, 1.0, size=(2, 4))
    ends *= 2.0 / ends.sum(axis=1, keepdims=True)
    one, other = (
        ab.Trajectory(each, rng.normal(size=(4, n, 3))) for each, n in zip(ends, (6, 3), strict=True)
    )
    times = np.linspace(0.0, min(one.duration, other.duration), 20_001)
    sampled = np.linalg.norm(one.evaluate(times, derivative) - other.evaluate(times), axis=1).max()
    peak = peak_difference(one, derivative, other)
    assert sampled <= peak * (1.0 + 1e-9)
    assert peak <= 1.01 * sampled


def test_px4_hangs_in_the_air_by_the_thrust_that_it_is_told_of(flip: ab.Plan, tmp_path: Path) -> None:
    """Newton's law in NED: thrust along the body's -z makes the acceleration set-point, drag aside."""
    calm = replace(flip, vehicle=replace(flip.vehicle, drag_body=(0.0, 0.0, 0.0)))
    ab.export(calm, tmp_path / "px4", "px4")
    attitude, rates, path = (
        pd.read_csv(tmp_path / "px4" / f"{name}_setpoint_0.csv")
        for name in ("vehicle_attitude", "vehicle_rates", "trajectory")
    )
    most = calm.vehicle.max_thrusts.sum() / calm.vehicle.mass
    turns = Rotation.from_quat(attitude[[f"q_d[{i}]" for i in (1, 2, 3, 0)]].to_numpy())
    thrust = turns.apply(most * attitude[[f"thrust_body[{i}]" for i in range(3)]].to_numpy())
    told = path[[f"acceleration[{i}]" for i in range(3)]].to_numpy()
    gravity = [0.0, 0.0, calm.problem.environment.gravity]
    np.testing.assert_allclose(thrust + gravity, told, atol=1e-4)
    assert (attitude["thrust_body[2]"] == rates["thrust_body[2]"]).all()
    step = np.diff(attitude["timestamp"]).mean() / 1e6
    turned = (turns[:-1].inv() * turns[1:]).as_rotvec() / step
    commanded = rates[["roll", "pitch", "yaw"]].to_numpy()
    np.testing.assert_allclose(turned[:-1], (commanded[1:-1] + commanded[:-2]) / 2.0, atol=0.1)


@pytest.mark.parametrize("to", ["ros1-bag", "ros2-bag", "mcap"])
def test_bags_hold_path_trajectory_poses_and_markers_at_their_times(
    to: str, flip: ab.Plan, tmp_path: Path
) -> None:
    path = tmp_path / f"flip{SUFFIXES[to]}"
    ab.export(flip, path, to, rate=50.0)
    found: dict[str, list[tuple[float, Any]]] = defaultdict(list)
    stamps = []
    for topic, stamp, message in bag_messages(path):
        found[topic].append((stamp / 1e9 - 1.0, message))
        stamps.append(stamp)
    assert stamps == sorted(stamps)
    times = flip.trajectory.sample(50.0)
    planned = ab.reference(flip, times=times).setpoint
    assert len(found["/aerobat/pose"]) == len(found["/aerobat/odometry"]) == len(times)
    ((_, whole),) = found["/aerobat/path"]
    ((begin, trajectory),) = found["/aerobat/trajectory"]
    assert begin == 0.0
    for pose, (_, single), point, i in zip(
        whole.poses, found["/aerobat/pose"], trajectory.points, range(len(times)), strict=True
    ):
        transform, twist = point.transforms[0], point.velocities[0]
        for place in (pose.pose.position, single.pose.position, transform.translation):
            np.testing.assert_allclose([place.x, place.y, place.z], planned.flat.position[i], atol=1e-7)
        speed = [twist.linear.x, twist.linear.y, twist.linear.z]
        np.testing.assert_allclose(speed, planned.flat.velocity[i], atol=1e-7)
        push = point.accelerations[0].linear
        np.testing.assert_allclose([push.x, push.y, push.z], planned.flat.acceleration[i], atol=1e-6)
    markers = found["/aerobat/markers"]
    names = {marker.ns for _, array in markers for marker in array.markers}
    assert names == {
        "path",
        "gate",
        *(f"vehicle: {s.name}" for s in flip.stages),
        "vehicle: start",
        "vehicle: end",
    }
    shown = {array.markers[0].ns: (time, array.markers) for time, array in markers}
    for stage in flip.stages:
        time, discs = shown[f"vehicle: {stage.name}"]
        assert time == pytest.approx(stage.time, abs=1e-8)
        middle = np.mean([[d.pose.position.x, d.pose.position.y, d.pose.position.z] for d in discs], axis=0)
        np.testing.assert_allclose(middle, flip.trajectory.evaluate(stage.time), atol=1e-6)


def test_a_scene_shows_the_vehicle_the_path_and_each_gate_around_its_opening(
    flip: ab.Plan, tmp_path: Path
) -> None:
    ab.export(flip, tmp_path / "flip.glb", "blender")
    scene = GLTF2().load(str(tmp_path / "flip.glb"))
    assert [node.name for node in scene.nodes] == ["hexarotor", "path", "gate"]
    primitive = scene.meshes[scene.nodes[2].mesh].primitives[0]
    bounds = scene.accessors[primitive.attributes.POSITION]
    middle = (np.array(bounds.max) + bounds.min) / 2.0
    np.testing.assert_allclose(middle[[0, 2, 1]] * [1, -1, 1], flip.problem.gates[0].position, atol=1e-6)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda plan, at: ab.export(plan, at / "x.csv", "cvs"), "did you mean 'csv'"),
        (lambda plan, at: ab.export(plan, at / "x.txt", "csv"), "ends in .csv"),
        (lambda plan, at: ab.export(plan, at / "x", "crazyflie", 50.0), "rate"),
        (lambda plan, at: ab.export(replace(plan, vehicle=None), at / "x.csv", "csv"), "vehicle is missing"),
        (lambda plan, at: ab.export(plan, at, "px4"), "thesis.tex"),
        (lambda plan, at: ab.export(plan, at / "thesis.tex", "crazyflie"), "cannot write"),
        (lambda plan, at: ab.export(plan, at / "thesis.tex" / "x.csv", "csv"), "cannot write"),
        (lambda plan, at: ab.export(plan, at / "x.csv", "csv", rate=1e9), "rate"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_a_sentence_with_nothing_written(
    make: Callable[[ab.Plan, Path], Any], named: str, flip: ab.Plan, tmp_path: Path
) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ab.SpecError, match=named) as refused:
        make(flip, tmp_path)
    assert "\n" not in str(refused.value)
    assert [file.read_text() for file in tmp_path.iterdir()] == ["years of work"]


def test_an_earlier_export_is_replaced(flip: ab.Plan, tmp_path: Path) -> None:
    for to in ("csv", "crazyflie", "ros2-bag"):
        for _ in range(2):
            made = ab.export(flip, tmp_path / f"flip-{to}{SUFFIXES[to]}", to)
        assert all(file.stat().st_size > 0 for file in made.files)
