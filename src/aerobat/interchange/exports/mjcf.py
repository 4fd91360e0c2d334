"""A plan as a MuJoCo model, an .xml file: the vehicle, gates, obstacles and ground, and a keyframe a row.

A keyframe holds pose, velocity and rotor thrusts of an instant, at which a simulation may begin.
"""

from __future__ import annotations

from xml.etree.ElementTree import SubElement, fromstring, indent, tostring

import numpy as np

from aerobat.control.parameters import airframe_parameters
from aerobat.engines.floats import first_numbers
from aerobat.flatness import reference
from aerobat.interchange.exports.loss import Content, ExportRows
from aerobat.planning import Plan
from aerobat.simulation.plants.mujoco import mujoco_model
from aerobat.simulation.plants.plant import PlantScene
from aerobat.vehicle.fleet import Fleet


def mujoco_scene(plan: Plan, rate: float) -> Content:
    """The model of a plan with a vehicle, keyframes at `rate` [1/s] and at the end.

    Lost is what lies between them.
    """
    assert plan.vehicle is not None, "exports are of plans with a vehicle"
    problem, vehicle = plan.problem, plan.vehicle
    airframe = first_numbers(airframe_parameters(Fleet.of([vehicle])))
    scene = PlantScene.of(problem.surroundings, problem.gates, airframe, vehicle.bounding_ellipsoid)
    root = fromstring(mujoco_model(scene))
    found = reference(plan, rate=rate)
    flat, lagging = found.setpoint.flat, [rotor.lag > 0.0 for rotor in vehicle.rotors]
    keys = SubElement(root, "keyframe")
    poses = np.hstack([flat.position, found.setpoint.q_world_body])
    rates = np.hstack([flat.velocity, found.setpoint.omega_body])
    for time, pose, velocity, thrusts in zip(found.times, poses, rates, found.rotor_thrusts, strict=True):
        state = {"time": time, "qpos": pose, "qvel": velocity, "ctrl": thrusts, "act": thrusts[lagging]}
        words = {name: " ".join(map(repr, np.ravel(x).tolist())) for name, x in state.items()}
        SubElement(keys, "key", {name: numbers for name, numbers in words.items() if numbers})
    indent(root)
    return Content({"plan.xml": tostring(root, encoding="utf-8")}, ExportRows.of(found).loss(plan))
