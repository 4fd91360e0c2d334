"""A plan as an animated scene, a .glb file of glTF 2.0: Blender and other 3D programs import its keyframes.

The vehicle's node has a position and an attitude at each key, joined by straight lines and turns at constant
rates, the format's interpolation LINEAR. The format's y axis is up, and our y axis is its -z axis, for the
world and for bodies. Programs whose z axis is up, such as Blender, turn all back to our axes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles.convex_piece import ObstacleMotion
from aerobat.flatness import reference
from aerobat.interchange.exports.loss import Content, ExportRows
from aerobat.interchange.solids import flattened, solid_surfaces
from aerobat.planning import Plan
from aerobat.problem.gate import Gate
from aerobat.vehicle import Vehicle

Floats = NDArray[np.float32]
FLOAT, LINES, LINE_STRIP, TRIANGLES = 5126, 1, 3, 4  # as the format numbers them
COLORS: Mapping[str, Sequence[float]] = {  # red, green, blue, opacity
    "rotor": (0.05, 0.2, 0.6, 1.0),
    "arm": (0.1, 0.1, 0.1, 1.0),
    "gate": (0.85, 0.35, 0.05, 1.0),
    "path": (0.4, 0.4, 0.4, 1.0),
    "obstacle": (0.4, 0.47, 0.54, 0.35),
}


def blender_scene(plan: Plan, rate: float) -> Content:
    """Return the scene of a plan with a vehicle, with keys at `rate` [1/s] and at the end.

    The differences from straight lines between keys are lost, and digits beyond float32.
    """
    assert plan.vehicle is not None, "exports are of plans with a vehicle"
    times = plan.trajectory.sample(rate).astype(np.float32)
    times = np.unique(np.minimum(times, np.nextafter(np.float32(plan.duration), np.float32(0.0))))
    found = reference(plan, times=times.astype(float))
    position = found.setpoint.flat.position.astype(np.float32)
    q = found.setpoint.q_world_body.astype(np.float32)
    scene = _Scene()
    vehicle = scene.node(plan.vehicle.name, scene.mesh("vehicle", _vehicle(scene, plan.vehicle)))
    scene.node("path", scene.mesh("path", [scene.primitive(position, LINE_STRIP, "path")]))

    def moved(node: int, motion: ObstacleMotion | None) -> None:
        if motion is not None:
            away = motion.moved(found.times).astype(np.float32)
            scene.animate(node, times, {"translation": _y_up(away)})

    for gate in plan.problem.gates:
        frame = scene.primitive(_frame(gate), TRIANGLES, "gate")
        moved(scene.node(gate.name, scene.mesh(gate.name, [frame])), gate.motion)
    for solid in solid_surfaces(plan):
        corners = solid.triangles.reshape(-1, 3)
        node = scene.node(
            solid.name, scene.mesh(solid.name, [scene.primitive(corners, TRIANGLES, "obstacle")])
        )
        moved(node, solid.motion)
    rotation = np.concatenate([_y_up(q[:, 1:]), q[:, :1]], axis=1)
    scene.animate(vehicle, times, {"translation": _y_up(position), "rotation": rotation})
    rows = ExportRows(found.times, position.astype(float), None, so3.normalize(q))
    loss = replace(rows.loss(plan), obstacles=flattened(plan))
    return Content((scene.binary(plan.problem.name),), loss)


@dataclass
class _Scene:
    """The content of a file under construction."""

    nodes: list[dict[str, Any]] = field(default_factory=list)
    meshes: list[dict[str, Any]] = field(default_factory=list)
    animations: list[dict[str, Any]] = field(default_factory=list)
    accessors: list[dict[str, Any]] = field(default_factory=list)
    views: list[dict[str, Any]] = field(default_factory=list)
    buffer: bytearray = field(default_factory=bytearray)

    def accessor(self, values: Floats, kind: str) -> int:
        """Add an array of float32, with its bounds, and return its number."""
        columns = values.reshape(len(values), -1)
        self.views.append({"buffer": 0, "byteOffset": len(self.buffer), "byteLength": values.nbytes})
        self.buffer += values.tobytes()
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": FLOAT,
                "count": len(values),
                "type": kind,
                "min": columns.min(axis=0).tolist(),
                "max": columns.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def primitive(self, points: Array | Floats, mode: int, color: str) -> dict[str, Any]:
        """Return points (n, 3) in our axes, joined as lines or triangles."""
        position = self.accessor(_y_up(np.asarray(points, dtype=np.float32)), "VEC3")
        return {"attributes": {"POSITION": position}, "mode": mode, "material": list(COLORS).index(color)}

    def mesh(self, name: str, primitives: Sequence[dict[str, Any]]) -> int:
        """Add a mesh and return its number."""
        self.meshes.append({"name": name, "primitives": list(primitives)})
        return len(self.meshes) - 1

    def node(self, name: str, mesh: int) -> int:
        """Add a node that shows a mesh, and return its number."""
        self.nodes.append({"name": name, "mesh": mesh})
        return len(self.nodes) - 1

    def animate(self, node: int, times: Floats, curves: Mapping[str, Floats]) -> None:
        """Move a node by curves, (T, 3) or (T, 4), by the names of its properties."""
        key = self.accessor(times, "SCALAR")
        outputs = [self.accessor(curve, f"VEC{curve.shape[1]}") for curve in curves.values()]
        self.animations.append(
            {
                "name": "plan",
                "samplers": [{"input": key, "output": o, "interpolation": "LINEAR"} for o in outputs],
                "channels": [
                    {"sampler": i, "target": {"node": node, "path": path}} for i, path in enumerate(curves)
                ],
            }
        )

    def binary(self, name: str) -> bytes:
        """Return the file: a header, the description as JSON, and the buffer."""
        description = {
            "asset": {"version": "2.0", "generator": "aerobat"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": list(range(len(self.nodes)))}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": [_material(color) for color in COLORS],
            "animations": self.animations,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.buffer)}],
        }
        text = json.dumps(description, ensure_ascii=False).encode()
        chunks = _chunk(b"JSON", text, b" ") + _chunk(b"BIN\0", bytes(self.buffer), b"\0")
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def _y_up(vectors: Floats) -> Floats:
    """Return vectors in our axes, (n, 3), in the format's axes."""
    return np.ascontiguousarray(vectors[:, [0, 2, 1]] * np.array([1, 1, -1], dtype=np.float32))


def _chunk(kind: bytes, content: bytes, padding: bytes) -> bytes:
    padded = content + padding * (-len(content) % 4)
    return struct.pack("<I", len(padded)) + kind + padded


def _material(color: str) -> dict[str, Any]:
    surface = {"baseColorFactor": COLORS[color], "metallicFactor": 0.0}
    glass = {"alphaMode": "BLEND"} if COLORS[color][3] < 1.0 else {}
    return {"name": color, "doubleSided": True, "pbrMetallicRoughness": surface} | glass


def _vehicle(scene: _Scene, vehicle: Vehicle) -> Sequence[dict[str, Any]]:
    """Return discs of the rotors, and lines to each of them and forward."""
    angles = np.linspace(0.0, 2.0 * np.pi, 24 + 1)  # of a disc's corners; the last is the first
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
    fan = np.stack([np.zeros_like(rim[1:]), rim[:-1], rim[1:]], axis=1).reshape(-1, 3)
    centres = np.array([rotor.position_body for rotor in vehicle.rotors])
    radii = np.array([rotor.radius for rotor in vehicle.rotors])
    discs = centres[:, None] + radii[:, None, None] * fan
    tips = np.concatenate([centres, [[np.abs(centres).max(), 0.0, 0.0]]])
    arms = np.stack([np.zeros_like(tips), tips], axis=1)
    return [
        scene.primitive(discs.reshape(-1, 3), TRIANGLES, "rotor"),
        scene.primitive(arms.reshape(-1, 3), LINES, "arm"),
    ]


def _frame(gate: Gate) -> Array:
    """Return triangles of a gate's frame, two for each side of its opening, (6 sides, 3)."""
    inner = gate.outline
    outer = gate.frame(0.05)  # [m] wide
    inner_next, outer_next = np.roll(inner, -1, axis=0), np.roll(outer, -1, axis=0)
    sides = np.stack([inner, outer, outer_next, inner, outer_next, inner_next], axis=1)
    return np.asarray(sides.reshape(-1, 3))
