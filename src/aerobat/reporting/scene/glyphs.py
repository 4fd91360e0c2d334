"""Glyphs of vehicles in their attitudes, and of gates as frames around their openings."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.problem.gate import Gate
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.shapes import Colour, Shape
from aerobat.reporting.style import BLUE, FAINT, INK, MUTED, YELLOW
from aerobat.vehicle import Vehicle

TURN = np.linspace(0.0, 2.0 * np.pi, 19)
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN), np.zeros_like(TURN)], axis=-1)
LIGHT = np.array([0.3, -0.5, 0.81])  # direction toward the light in shaded pictures
# corners of an arrowhead, forward and left, relative to its length
ARROWHEAD = np.array([[0.6, 0.0], [-0.4, 0.38], [-0.2, 0.0], [-0.4, -0.38], [0.6, 0.0]])
ENLARGEMENTS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0, 50.0, 100.0)


def span(vehicle: Vehicle) -> float:
    """Return the largest distance between rotor tips through the centre [m]."""
    return 2.0 * max(float(np.linalg.norm(r.position_body[:2])) + r.radius for r in vehicle.rotors)


def enlargement(vehicle: Vehicle, size: float) -> float:
    """Return the round factor by which a vehicle is enlarged in a picture, to span about `size` [m]."""
    return min(
        (step for step in ENLARGEMENTS if step * span(vehicle) >= 0.85 * size), default=ENLARGEMENTS[-1]
    )


def vehicle_shapes(
    vehicle: Vehicle,
    position: Array,
    q_world_body: Array,
    scale: float,
    face: Colour = (INK, 0.35),
    weight: float = 1.0,
) -> list[Shape]:
    """Return a vehicle at a position (3,) in an attitude (4,): arms and masts, then a disc for each rotor.

    Args:
        vehicle: The vehicle.
        position: The position of its centre of mass [m], world, (3,).
        q_world_body: Its attitude, (4,).
        scale: The factor by which it is drawn larger than it is.
        face: The colour of the discs.
        weight: The width of all lines, relative to the usual one.
    """
    shapes, discs = [], []
    for rotor in vehicle.rotors:
        top = rotor.position_body + np.array([0.0, 0.0, 0.35 * rotor.radius])  # of a mast
        arm = np.array([[0.0, 0.0, 0.0], rotor.position_body, top])
        disc = top + rotor.radius * CIRCLE
        arm, disc = (position + scale * so3.rotate(q_world_body, part) for part in (arm, disc))
        shapes.append(Shape(arm, edge=INK, width=1.3 * weight))
        discs.append(Shape(disc, face=face, edge=INK, width=0.7 * weight))
    return shapes + discs


def pose_shapes(
    vehicle: Vehicle, position: Array, q_world_body: Array, scale: float, camera: Camera
) -> list[Shape]:
    """Return a vehicle as `vehicle_shapes` whose discs tell their sides, with a line along its thrust axis.

    The line is somewhat shorter than half of the vehicle's span.
    """
    tip = position + 0.45 * scale * span(vehicle) * so3.thrust_axis(q_world_body)
    axis = Shape(np.array([position, tip]), edge=INK, width=0.9)
    return [axis, *vehicle_shapes(vehicle, position, q_world_body, scale, side_face(q_world_body, camera))]


def side_face(q_world_body: Array, camera: Camera) -> tuple[str, float]:
    """Return the face of discs: blue seen from above, white from below, which shows inverted flight."""
    is_from_above = float(so3.thrust_axis(q_world_body) @ camera.toward) >= 0.0
    return (BLUE, 0.45) if is_from_above else ("white", 0.9)  # with their opacities


def direction_marks(path: Array, rows: Sequence[int], camera: Camera, size: float) -> list[Shape]:
    """Return arrowheads along a path, in the direction of travel.

    Args:
        path: Positions [m], (T, 3).
        rows: The rows of the arrowheads; none where the path runs toward the viewer, or stands still.
        camera: The camera that they face.
        size: The length of an arrowhead [m].
    """
    shapes = []
    for k in rows:
        ahead = camera.project(path[min(k + 1, len(path) - 1)] - path[max(k - 1, 0)])
        length = float(np.linalg.norm(ahead))
        if length > 0.0:
            right, up = ahead / length
            forward, left = np.array([[right, up], [-up, right]]) @ camera.screen
            corners = path[k] + size * (ARROWHEAD[:, :1] * forward + ARROWHEAD[:, 1:] * left)
            shapes.append(Shape(corners, face=MUTED, edge="white", width=0.5, depth_bias=size))
    return shapes


def gate_bars(gate: Gate) -> list[Array]:
    """Return the bars of a gate's frame, each by the corners of its faces [m], (4 faces, 4, 3).

    The inner edges of the frame are the opening, `Gate.outline`; the bars lie outside it and are as deep
    as they are thick, half before the gate's plane and half behind.
    """
    thickness = 0.12 * float(gate.opening.size.min())  # [m]
    inner, outer = gate.outline, gate.frame(thickness)
    depth = gate.normal * thickness / 2
    bars = []
    for a, b in pairwise([*range(len(inner)), 0]):
        section = [(inner, depth), (outer, depth), (outer, -depth), (inner, -depth)]
        rims = [np.array([ring[a] + shift, ring[b] + shift]) for ring, shift in section]
        faces = zip(rims, [*rims[1:], rims[0]], strict=True)
        bars.append(np.array([[*first, *second[::-1]] for first, second in faces]))
    return bars


def gate_corners(gates: Sequence[Gate]) -> Array:
    """Return all corners of all bars of gates [m], (n, 3), for a picture that must hold them."""
    return np.array([bar for gate in gates for bar in gate_bars(gate)]).reshape(-1, 3)


def gate_shapes(gate: Gate) -> list[Shape]:
    """Return a gate as a shaded frame around its opening."""
    return [
        Shape(face, face=_shade(face), edge=_shade(face), width=0.4)
        for bar in gate_bars(gate)
        for face in bar
    ]


def gate_section(gate: Gate, camera: Camera) -> list[Shape]:
    """Return a gate as `gate_shapes`; seen edge-on, bars that would cover the opening are pale."""
    if abs(float(gate.normal @ camera.toward)) > 0.2:
        return gate_shapes(gate)
    shapes = []
    for bar in gate_bars(gate):
        ends = bar[0, 1] - bar[0, 0]
        across = float(np.linalg.norm(camera.project(ends))) > 0.5 * float(np.linalg.norm(ends))
        shapes += [Shape(face, face=(YELLOW, 0.12) if across else _shade(face)) for face in bar]
    return sorted(shapes, key=lambda shape: isinstance(shape.face, str))


def _shade(face: Array) -> Colour:
    """Return the colour of a face (4, 3) in the light of the scene."""
    from matplotlib.colors import to_hex, to_rgb

    normal = np.cross(face[1] - face[0], face[3] - face[0])
    light = abs(float(normal @ LIGHT)) / max(float(np.linalg.norm(normal)), 1e-12)
    dark, bright = (np.array(to_rgb(colour)) for colour in ("#8f6a12", "#f0c964"))
    return to_hex(dark + min(light, 1.0) * (bright - dark))


def shadow(points: Array, floor: float) -> Array:
    """Return the points on the floor straight below others [m], (..., 3)."""
    return np.concatenate([points[..., :2], np.full((*points.shape[:-1], 1), floor)], axis=-1)


def drop_line(point: Array, floor: float) -> Shape:
    """Return a thin line from a point down to the floor."""
    return Shape(np.array([point, shadow(point, floor)]), edge=FAINT, width=0.7)
