"""MuJoCo as a plant: rigid-body physics with contacts, in a MuJoCo model generated from vehicle and scene.

The vehicle is a free body with an ellipsoid as its hull. Each rotor is an actuator with a first-order lag at
a site in the centre of mass; its gear is the rotor's column of the allocation (thrust along +z and moments).
Drag is applied as an external force, evaluated at the middle of each step and held over the step. Gates are
frames of bars, or walls if they have walls; the ground is a plane. Obstacles are MuJoCo's own shapes where
MuJoCo has them, and otherwise the meshes of their convex pieces.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import TYPE_CHECKING, Annotated, Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from pydantic import Field

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles import ConvexPiece, Obstacle
from aerobat.environment.obstacles.convex_piece import ObstacleMotion
from aerobat.environment.obstacles.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere
from aerobat.environment.obstacles.surface import surface_of
from aerobat.errors import import_extra
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.rigid_body import Body
from aerobat.problem.gate import Gate
from aerobat.simulation.outcome import Contact
from aerobat.simulation.plants.plant import PLANTS, Actuation, Plant, PlantScene

if TYPE_CHECKING:
    import mujoco

FRAME_WIDTH = 0.05  # [m] width of the bars of a gate's frame
FRAME_DEPTH = 0.02  # [m] depth of the bars along the direction of passage
_VEHICLE, _GROUND, _GATE, _OBSTACLE = "vehicle", "ground", "gate", "obstacle"
_KINDS = {
    _VEHICLE: Contact.NOTHING,
    _GROUND: Contact.GROUND,
    _GATE: Contact.GATE,
    _OBSTACLE: Contact.OBSTACLE,
}
_NO_LAG_RATE = 1e4  # [1/s] a rotor whose inverse time constant is at least this is simulated without lag


class Mujoco(Plant):
    """MuJoCo's rigid bodies and contacts; needs the extra mujoco."""

    contacts: bool = True  # with gates, obstacles and ground; false: the vehicle passes through them
    max_step: Annotated[float, Field(gt=0, le=0.01)] = 0.001  # [s] of its Runge-Kutta steps

    def begin(self, scene: PlantScene, motion: VehicleState) -> MujocoRun:
        """Return the vehicle of a scene at its start. Raises BackendMissing without MuJoCo."""
        return MujocoRun(scene, motion, self.contacts, self.max_step)


PLANTS.add("mujoco", Mujoco)


class MujocoRun:
    """A vehicle that flies in MuJoCo; see `PlantRun`."""

    def __init__(self, scene: PlantScene, motion: VehicleState, contacts: bool, max_step: float) -> None:
        self._mujoco = import_extra("mujoco", "the plant mujoco needs MuJoCo", "aerobat[mujoco]")
        self._airframe = scene.airframe
        rates = [rate for rate in scene.airframe.rotors.inverse_time_constant if rate < _NO_LAG_RATE]
        self._max_step = min([max_step, *(1.0 / rate for rate in rates)])  # RK4 is stable to 2.8 times that
        self._model: mujoco.MjModel = self._mujoco.MjModel.from_xml_string(mujoco_model(scene, contacts))
        self._data: mujoco.MjData = self._mujoco.MjData(self._model)
        self._lagging = np.flatnonzero(self._model.actuator_dyntype != self._mujoco.mjtDyn.mjDYN_NONE)
        names = [self._model.geom(k).name for k in range(self._model.ngeom)]
        self._kinds = [_KINDS[name.partition(" ")[0]] for name in names]
        self._contact = Contact.NOTHING
        self._motions = moving_bodies(scene)
        self._begin(motion)

    def _begin(self, motion: VehicleState) -> None:
        data, body = self._data, motion.body
        data.qpos[:] = [*body.position, *body.q_world_body]
        data.qvel[:] = [*body.velocity, *body.omega_body]
        data.ctrl[:] = motion.thrusts
        data.act[:] = np.array(motion.thrusts)[self._lagging]
        self._last_velocity = np.array(body.velocity)  # [m/s] velocity at the previous step
        self._mujoco.mj_forward(self._model, data)
        self._detect_contact()

    @property
    def motion(self) -> VehicleState:
        """See `PlantRun.motion`."""
        position, q = self._data.qpos[:3].tolist(), self._data.qpos[3:7].tolist()
        velocity, omega = self._data.qvel[:3].tolist(), self._data.qvel[3:6].tolist()
        thrusts = np.clip(self._data.ctrl, *self._model.actuator_ctrlrange.T)
        thrusts[self._lagging] = self._data.act
        body = Body(tuple(position), tuple(velocity), tuple(q), tuple(omega))
        return VehicleState(body, tuple(thrusts.tolist()))

    @property
    def contact(self) -> Contact:
        """See `PlantRun.contact`."""
        seen, self._contact = self._contact, Contact.NOTHING
        return seen

    def advance(self, actuation: Actuation, duration: float) -> None:
        """See `PlantRun.advance`."""
        steps = ceil(duration / self._max_step - 1e-9)
        self._model.opt.timestep = duration / max(steps, 1)
        self._data.ctrl[:] = np.clip(actuation.commands, self._airframe.rotors.min_thrust, actuation.ceilings)
        drag = np.array(self._airframe.mass_properties.drag_body)
        for _ in range(steps):
            now, omega = self._data.qvel[:3].copy(), self._data.qvel[3:6]
            q = so3.multiply(self._data.qpos[3:7], so3.exp(0.5 * self._model.opt.timestep * omega))
            airspeed = now + 0.5 * (now - self._last_velocity) - np.array(actuation.wind)
            self._data.xfrc_applied[1, :3] = -so3.rotate(q, drag * so3.unrotate(q, airspeed))
            self._last_velocity = now
            self._mujoco.mj_step(self._model, self._data)
            for place, motion in zip(self._data.mocap_pos, self._motions, strict=True):
                place[:] = motion.moved(np.array(self._data.time))
            self._detect_contact()

    def _detect_contact(self) -> None:
        touched = self._data.contact.geom[: self._data.ncon].ravel().tolist()
        self._contact = max((self._contact, *(self._kinds[geom] for geom in touched)))


def moving_bodies(scene: PlantScene) -> list[ObstacleMotion]:
    """Return the motions of the model's mocap bodies, moving obstacles and then gates, in their order."""
    moving = [each.motion for each in scene.obstacles for _ in _shapes(each)]
    moving += [gate.motion for gate in scene.gates if gate.wall is None]
    return [motion for motion in moving if motion is not None]


def mujoco_model(scene: PlantScene, contacts: bool = True) -> str:
    """Return the MuJoCo model (MJCF) of a vehicle among gates, obstacles and ground, with contacts or not."""
    root = Element("mujoco", model="aerobat")
    SubElement(root, "option", integrator="RK4", gravity=f"0 0 {-scene.gravity!r}", density="0")
    shapes = [(each.motion, shape) for each in scene.obstacles for shape in _shapes(each)]
    assets = SubElement(root, "asset")
    world = SubElement(root, "worldbody")
    SubElement(world, "light", pos="0 0 20", dir="0 0 -1", directional="true")
    meets = "1" if contacts else "0"
    if scene.ground is not None:
        SubElement(
            world, "geom", name=_GROUND, type="plane", size="50 50 1", pos=f"0 0 {scene.ground!r}",
            rgba="0.9 0.9 0.9 1", contype="0", conaffinity=meets,
        )  # fmt: skip
    _add_vehicle(world, scene)
    for number, (motion, shape) in enumerate(shapes):
        name = f"{_OBSTACLE} {number}"
        if "vertex" in shape:
            SubElement(assets, "mesh", name=name, vertex=shape.pop("vertex"))
            shape["mesh"] = name
        holder = world if motion is None else SubElement(world, "body", name=name, mocap="true")
        SubElement(holder, "geom", shape, name=name, rgba="0.5 0.5 0.5 1", contype="0", conaffinity=meets)
    for number, gate in enumerate(scene.gates):
        if gate.wall is not None:
            continue
        name = f"{_GATE} {number}"
        holder = world if gate.motion is None else SubElement(world, "body", name=name, mocap="true")
        for side, (centre, outward, half_size) in enumerate(_frame_bars(gate)):
            SubElement(
                holder, "geom", name=f"{name} {side}", type="box", pos=_text(centre),
                size=_text(half_size), xyaxes=_text((*gate.normal, *outward)), rgba="0.85 0.4 0.1 1",
                contype="0", conaffinity=meets,
            )  # fmt: skip
    actuators = SubElement(root, "actuator")
    for actuator in _actuators(scene.airframe):
        SubElement(actuators, "general", actuator)
    return tostring(root, encoding="unicode")


def _shapes(obstacle: Obstacle) -> Iterator[dict[str, str]]:
    """Yield the attributes of an obstacle's geoms; a convex piece is a mesh of its vertices."""
    match obstacle:
        case Box():
            length, width = obstacle.axes.T[:2]
            half = _text(obstacle.size / 2.0)
            yield {
                "type": "box",
                "pos": _text(obstacle.position),
                "size": half,
                "xyaxes": _text((*length, *width)),
            }
        case Sphere():
            yield {"type": "sphere", "pos": _text(obstacle.position), "size": _text([obstacle.radius])}
        case HalfSpace():
            normal = _text(obstacle.normal)
            yield {"type": "plane", "pos": _text(obstacle.position), "zaxis": normal, "size": "50 50 1"}
        case Capsule() | Cylinder() if (obstacle.start != obstacle.end).any():
            ends = _text((*obstacle.start, *obstacle.end))
            yield {"type": obstacle.kind, "fromto": ends, "size": _text([obstacle.radius])}
        case _:
            yield from ({"type": "mesh", "vertex": _text(_hull(piece).ravel())} for piece in obstacle.pieces)


def _hull(piece: ConvexPiece) -> Array:
    """Return points [m] whose convex hull is the piece; of a rounded piece, points all over its surface."""
    return surface_of(piece).points if piece.rounding.any() else piece.points


def _frame_bars(gate: Gate) -> Iterator[tuple[Array, Array, tuple[float, float, float]]]:
    """Yield the bars about a gate's opening: the centre [m], the direction outward and the half sizes [m].

    The half sizes are along the gate's normal, outward and along the bar, which extends over the corners.
    """
    half = FRAME_WIDTH / 2
    for middle, normal, half_length in gate.opening.edges:
        outward = normal @ gate.plane_axes
        centre = gate.position + middle @ gate.plane_axes + half * outward
        yield centre, outward, (FRAME_DEPTH / 2, half, half_length + FRAME_WIDTH)


def _add_vehicle(world: Element, scene: PlantScene) -> None:
    properties = scene.airframe.mass_properties
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = properties.inertia
    body = SubElement(world, "body", name=_VEHICLE)
    SubElement(body, "freejoint")
    SubElement(
        body, "inertial", pos="0 0 0", mass=repr(float(properties.mass)),
        fullinertia=_text((xx, yy, zz, xy, xz, yz)),
    )  # fmt: skip
    SubElement(
        body, "geom", name=_VEHICLE, type="ellipsoid", pos=_text(scene.body.centre),
        size=_text(scene.body.semi_axes), rgba="0.2 0.4 0.7 1", contype="1", conaffinity="0",
    )  # fmt: skip
    SubElement(body, "site", name="centre of mass")


def _actuators(airframe: Airframe) -> Iterator[dict[str, str]]:
    """Yield an actuator for each rotor: its wrench per newton of thrust, its limits and its lag."""
    rotors = airframe.rotors
    for low, high, rate, *column in zip(
        rotors.min_thrust, rotors.max_thrust, rotors.inverse_time_constant, *rotors.allocation, strict=True
    ):
        collective, *moments = column
        actuator = {
            "site": "centre of mass",
            "gear": _text((0.0, 0.0, collective, *moments)),
            "ctrllimited": "true",
            "ctrlrange": _text((low, max(high, low + 1e-9))),  # MuJoCo accepts no empty range (failed rotor)
        }
        if rate < _NO_LAG_RATE:
            actuator |= {"dyntype": "filter", "dynprm": repr(1.0 / float(rate))}
        yield actuator


def _text(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)
