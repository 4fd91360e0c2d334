"""Obstacles and walls of own problems, as a newcomer writes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from own_files import Pen

Table = dict[str, Any]
BESIDE = 8.0  # [m] from the origin, at most
KINDS = ("box", "sphere", "capsule", "cylinder", "half-space", "polytope", "mesh", "grid")


def wall(pen: Pen) -> Any:
    """A wall around a gate's opening."""
    return pen.one_of(True, {"border": pen.number(0.1, 2.0), "thickness": pen.size(0.02, 0.3)})


def obstacles(pen: Pen) -> list[Table]:
    """One obstacle or more of any kind."""
    return [_obstacle(pen, pen.one_of(*KINDS)) for _ in range(pen.one_of(1, 2, 3))]


def _obstacle(pen: Pen, kind: str) -> Table:
    place, size = pen.vector(BESIDE), pen.size(0.1, 1.0)
    corners = [pen.vector(1.0) for _ in range(6)]
    shapes: dict[str, Table] = {
        "box": {"position": place, "size": [size, pen.size(0.1, 2.0), pen.size(0.1, 4.0)]} | _attitude(pen),
        "sphere": {"position": place, "radius": size},
        "capsule": {"start": place, "end": pen.vector(BESIDE), "radius": size},
        "cylinder": {"start": place, "end": [*place[:2], round(place[2] + 3.0, 2)], "radius": size},
        "half-space": {
            "position": [0.0, 0.0, pen.number(5.0, 9.0)],
            "normal": [0.0, pen.number(-0.3, 0.3), -1.0],
        },
        "polytope": {"points": [np.round(np.add(place, corner), 3).tolist() for corner in corners]},
        "mesh": {"position": place} | pen.one_of({"parts": [corners]}, {"file": "hall.stl", "scale": size}),
        "grid": {"cell": size, "origin": place}
        | pen.one_of({"boxes": [[0, 0, 0, 3, 2, 1], [0, 0, 1, 1, 1, 4]]}, {"file": "scan.npy"}),
    }
    turned = _attitude(pen) if kind == "mesh" else {}
    motion = {
        "velocity": lambda p: p.vector(1.0),
        "path": lambda p: [[0.0, *place], [4.0, *p.vector(BESIDE)]],
    }
    return {"kind": kind} | shapes[kind] | turned | pen.some({"name": lambda _: f"a {kind}"} | motion, 0.15)


def _attitude(pen: Pen) -> Table:
    """Some of the angles, in degrees or in radians."""
    angles = {name: pen.number(-3.0, 3.0) for name in ("heading", "elevation", "tilt") if pen.chance(0.5)}
    if pen.chance(0.5):
        return angles
    return {f"{name}_deg": round(np.degrees(angle), 1) for name, angle in angles.items()}
