"""A plan as a MuJoCo model, an .xml file: the vehicle, gates, obstacles, ground, and a keyframe for each row.

A simulation may begin at any keyframe. A keyframe has the pose, the velocity, the rotor thrusts and the
commands of an instant, and the places of moving gates and obstacles. A command leads the thrust by the lag.
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

DIFFERENCE_STEP = 1e-5  # [s] to both sides of an instant, for the derivatives of thrusts


def mujoco_scene(plan: Plan, rate: float) -> Content:
    """Return the model of a plan with a vehicle, with keyframes at `rate` [1/s] and at the end.

    The plan between keyframes is lost, and the vehicle's drag, for which MuJoCo has no element.
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
    return Content((tostring(root, encoding="utf-8"),), loss)


def _commands(plan: Plan, vehicle: Vehicle, found: Reference) -> Array:
    """Return the commands f + τ f' of all rotors [N] at a reference's times, (T, n)."""
    beside = np.clip(found.times[:, None] + [-DIFFERENCE_STEP, DIFFERENCE_STEP], 0.0, plan.duration)
    thrusts = reference(plan, times=beside.ravel()).rotor_thrusts.reshape(*beside.shape, -1)
    slopes = np.diff(thrusts, axis=1)[:, 0] / np.diff(beside, axis=1)
    return np.asarray(found.rotor_thrusts + vehicle.lags * slopes)
