"""Obstacles in exports: what other programs show of them is where they are, and the loss says how nearly."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import mujoco
import numpy as np
import pytest
from pygltflib import GLTF2

import aerobat as ab
from aerobat.environment.obstacles import ConvexPiece
from export_readers import bag_messages
from flight_package import read_flight_package
from obstacle_cases import open_cruise, walled_cruise
from places import ROOT

NAMES = {"trunk", "sphere", "box", "the wall of gate"}


def through_a_moving_gate() -> ab.Plan:
    gate = replace(ab.tilted_gate((4.0, 1.0, 1.5)), velocity=np.array([0.0, -0.5, 0.2]))
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((8.0, 0.0, 1.5))
    problem = ab.Problem("moving", *ends, ab.Line(), (gate,))
    return ab.plan(problem, ab.Miqp(order=5), "agile-quad")


def directions() -> np.ndarray:
    made = np.random.default_rng(0).normal(size=(500, 3))
    return made / np.linalg.norm(made, axis=1, keepdims=True)


def pieces_of(name: str) -> list[ConvexPiece]:
    return [piece for piece in walled_cruise().problem.surroundings.pieces.pieces if piece.name == name]


def lack(name: str, corners: np.ndarray) -> np.ndarray:
    """How far the hull of an obstacle reaches beyond that of corners, in many directions [m]."""
    whole = np.max([piece.support(directions()) for piece in pieces_of(name)], axis=0)
    return whole - (directions() @ corners.T).max(axis=1)


def test_a_scene_has_each_obstacle_within_the_loss_that_is_said(tmp_path: Path) -> None:
    made = ab.export(walled_cruise(), tmp_path / "walled.glb", "blender")
    scene = GLTF2().load(str(tmp_path / "walled.glb"))
    blob, found = scene.binary_blob(), {}
    for node in scene.nodes:
        primitive = scene.meshes[node.mesh].primitives[0]
        place = scene.bufferViews[scene.accessors[primitive.attributes.POSITION].bufferView]
        corners = np.frombuffer(blob, "<f4", place.byteLength // 4, place.byteOffset).reshape(-1, 3)
        found.setdefault(node.name, []).append(corners[:, [0, 2, 1]] * [1.0, -1.0, 1.0])
        glass = scene.materials[primitive.material].alphaMode == "BLEND"
        assert glass == (node.name in NAMES)
    assert set(found) >= NAMES
    lacks = np.array([lack(name, np.concatenate(found[name])) for name in NAMES])
    assert lacks.min() > -1e-6
    assert lacks.max() <= made.loss.obstacles + 1e-6
    assert 0.001 < made.loss.obstacles < 0.01
    assert "round obstacles drawn up to" in str(made)


def test_in_a_model_for_mujoco_the_body_is_as_far_from_obstacles_as_it_is_here(tmp_path: Path) -> None:
    plan = walled_cruise()
    ab.export(plan, tmp_path / "walled.xml", "mujoco", rate=10.0)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "walled.xml"))
    data = mujoco.MjData(model)
    kinds = [model.geom(k).name.partition(" ")[0] for k in range(model.ngeom)]
    around = [k for k, kind in enumerate(kinds) if kind == "obstacle"]
    pieces = plan.problem.surroundings.pieces
    for key in range(model.nkey):
        mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_forward(model, data)
        there = min(
            mujoco.mj_geomDistance(model, data, kinds.index("vehicle"), k, 100.0, None) for k in around
        )
        offset, shapes = plan.vehicle.bounding_ellipsoid.turned(data.qpos[None, 3:7])
        bodies, beside = pieces.near(data.qpos[None, :3] + offset, plan.vehicle.body_radius, 100.0)
        here = pieces.separated(beside, (data.qpos[None, :3] + offset)[bodies], shapes[bodies]).gaps.min()
        assert there == pytest.approx(here, abs=0.005)


@pytest.mark.slow
def test_a_model_for_mujoco_moves_gates_and_plays_the_plan_by_its_commands(tmp_path: Path) -> None:
    plan = through_a_moving_gate()
    made = ab.export(plan, tmp_path / "moving.xml", "mujoco", rate=1000.0)
    assert "no place for the vehicle's drag" not in str(made)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "moving.xml"))
    gate = plan.problem.gates[0]
    np.testing.assert_allclose(model.key_mpos, model.key_time[:, None] * gate.velocity, atol=1e-9)
    data = mujoco.MjData(model)
    model.opt.timestep = 0.001
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for ctrl in model.key_ctrl[:200]:
        data.ctrl[:] = ctrl
        mujoco.mj_step(model, data)
    assert np.linalg.norm(data.qpos[:3] - plan.trajectory.evaluate(0.2)) < 0.03  # 0.07 m by thrusts alone


@pytest.mark.parametrize(("to", "name"), [("ros1-bag", "walled.bag"), ("mcap", "walled.mcap")])
def test_bags_mark_each_obstacle(to: str, name: str, tmp_path: Path) -> None:
    made = ab.export(walled_cruise(), tmp_path / name, to, rate=20.0)
    markers = next(m for topic, _, m in bag_messages(tmp_path / name) if topic == "/aerobat/markers").markers
    found: dict[str, list[np.ndarray]] = {}
    for marker in (each for each in markers if each.type == 11):
        assert 0.0 < marker.color.a < 1.0
        found.setdefault(marker.ns, []).append(np.array([[p.x, p.y, p.z] for p in marker.points]))
    assert set(found) == NAMES
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers), "none takes another's place"
    assert max(lack(each, np.concatenate(found[each])).max() for each in NAMES) <= made.loss.obstacles + 1e-9


def test_the_flight_package_holds_obstacles_exactly_and_by_its_schema(tmp_path: Path) -> None:
    walled_cruise().save(tmp_path / "walled.plan")
    package = read_flight_package(tmp_path / "walled.plan")
    for (name, points, rounding), piece in zip(
        package.obstacles, walled_cruise().problem.surroundings.pieces.pieces, strict=True
    ):
        assert name == piece.name
        np.testing.assert_array_equal(points, piece.points)
        np.testing.assert_array_equal(rounding, piece.rounding)
    schema = json.loads((ROOT / "docs" / "plan.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator(schema).validate(package.document)


def test_exports_without_obstacles_lose_none(tmp_path: Path) -> None:
    made = ab.export(open_cruise(), tmp_path / "open.glb", "blender")
    assert made.loss.obstacles == 0.0
    assert "obstacles" not in str(made).partition(": ")[2]
