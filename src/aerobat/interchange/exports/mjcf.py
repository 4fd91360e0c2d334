"""A plan as a MuJoCo model, an .xml file: the vehicle, gates, obstacles and ground, and a keyframe a row.

A keyframe holds pose, velocity, rotor thrusts and commands of an instant, at which a simulation may begin,
and where gates and obstacles that move are then. A command leads the thrust by the rotor's lag.
"""

from __future__ import annotations

from dataclasses import replace
from xml.etree.ElementTree import SubElement, fromstring, indent, tostring

import numpy as np

from aerobat.arrays import Array
from aerobat.control.parameters import airframe_parameters
from aerobat.engines.floats import first_numbers
from aerobat.flatness import Reference, reference
from aerobat.interchange.exports.loss import Content, ExportRows
from aerobat.planning import Plan
from aerobat.simulation.plants.mujoco import moving_bodies, mujoco_model
from aerobat.simulation.plants.plant import PlantScene
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

BESIDE = 1e-5  # [s] of an instant: thrusts there tell how fast they change


def mujoco_scene(plan: Plan, rate: float) -> Content:
    """The model of a plan with a vehicle, keyframes at `rate` [1/s] and at the end.

    Lost is what lies between them, and the vehicle's drag, which MuJoCo has no element for.
    """
    assert plan.vehicle is not None, "exports are of plans with a vehicle"
    problem, vehicle = plan.problem, plan.vehicle
    airframe = first_numbers(airframe_parameters(Fleet.of([vehicle])))
    place, body = problem.surroundings, vehicle.bounding_ellipsoid
    scene = PlantScene(airframe, place.gravity, place.ground, body, problem.gates, place.obstacles)
    root = fromstring(mujoco_model(scene))
    found = reference(plan, rate=rate)
    flat, lagging = found.setpoint.flat, [rotor.lag > 0.0 for rotor in vehicle.rotors]
    keys = SubElement(root, "keyframe")
    poses = np.hstack([flat.position, found.setpoint.q_world_body])
    rates = np.hstack([flat.velocity, found.setpoint.omega_body])
    commands, motions = _commands(plan, vehicle, found), moving_bodies(scene)
    series = (found.times, poses, rates, found.rotor_thrusts, commands)
    for time, pose, velocity, thrusts, command in zip(*series, strict=True):
        state = {"time": time, "qpos": pose, "qvel": velocity, "ctrl": command, "act": thrusts[lagging]}
        state |= {"mpos": [motion.moved(np.array(time)) for motion in motions]}
        words = {name: " ".join(map(repr, np.ravel(x).tolist())) for name, x in state.items()}
        SubElement(keys, "key", {name: numbers for name, numbers in words.items() if numbers})
    indent(root)
    without = "the vehicle's drag" if vehicle.drag_body.any() else ""
    loss = replace(ExportRows.of(found).loss(plan), without=without)
    return Content({"plan.xml": tostring(root, encoding="utf-8")}, loss)


def _commands(plan: Plan, vehicle: Vehicle, found: Reference) -> Array:
    """The commands f + τ f' of all rotors [N] at a reference's times, (T, n)."""
    beside = np.clip(found.times[:, None] + [-BESIDE, BESIDE], 0.0, plan.duration)
    thrusts = reference(plan, times=beside.ravel()).rotor_thrusts.reshape(*beside.shape, -1)
    slopes = np.diff(thrusts, axis=1)[:, 0] / np.diff(beside, axis=1)
    return np.asarray(found.rotor_thrusts + vehicle.lags * slopes)
