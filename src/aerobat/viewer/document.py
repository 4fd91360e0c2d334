"""The HTML of a replay page: a scene as numbers, and what draws them, in one file."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.environment.obstacles.surface import Surface
from aerobat.problem.gate import Gate
from aerobat.viewer.scene import Scene, Track

PAGE = files("aerobat.viewer") / "page"
SCRIPTS = ("arrays.js", "models.js", "world.js", "cameras.js", "plots.js", "player.js")  # in this order
MARK = '<meta name="generator" content="aerobat replay">'  # identifies a replay page
PLACE = re.compile("@@([a-z]+)@@")
DIGITS = 32767.0  # of 16-bit integers: attitudes to 0.004°


@dataclass
class Blob:
    """Arrays of a page one after the other, each beginning at a multiple of four bytes."""

    content: bytearray = field(default_factory=bytearray)

    def add(self, values: NDArray[Any], kind: str, scale: float = 1.0) -> dict[str, Any]:
        """Append values / scale as little-endian numbers of a NumPy kind, and return where they are."""
        numbers = values / scale
        packed = (np.rint(numbers) if kind != "f4" else numbers).astype(f"<{kind}").tobytes()
        place = {"kind": kind, "offset": len(self.content), "length": values.size, "scale": scale}
        self.content += packed + bytes(-len(packed) % 4)
        return place


def packed(scene: Scene) -> dict[str, Any]:
    """Return the scene as its page reads it: its arrays in Base64, and a header with all else."""
    blob = Blob()
    return {"header": _header(scene, blob), "arrays": b64encode(blob.content).decode()}


def document(scene: Scene, controls: Any = None) -> str:
    """Return the page that replays a scene; with controls a live page, which asks its server for plans."""
    content, is_live = packed(scene), controls is not None
    parts = {
        "title": escape(scene.title),
        "policy": "; connect-src 'self'; img-src 'self' data:" if is_live else "; img-src data:",
        "style": _text("replay.css") + (_text("live.css") if is_live else ""),
        "panel": _text("live.html").replace("@@controls@@", _embedded(controls)) if is_live else "",
        "header": _embedded(content["header"]),
        "arrays": content["arrays"],
        "three": _text("three.min.js"),
        "script": "\n".join(map(_text, (*SCRIPTS, "live.js") if is_live else SCRIPTS)),
    }
    return PLACE.sub(lambda place: parts[place[1]], _text("replay.html"))


def _embedded(value: Any) -> str:
    """Return the value as JSON that cannot end the script element around it."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")


def _text(name: str) -> str:
    return (PAGE / name).read_text(encoding="utf-8")


def _header(scene: Scene, blob: Blob) -> dict[str, Any]:
    """Return the scene as plain data; its arrays are appended to the blob."""
    vehicle = scene.vehicle
    body = vehicle.bounding_ellipsoid
    top = float(max(np.abs([track.thrusts for track in scene.tracks]).max(), 1e-9))
    return {
        "title": scene.title,
        "facts": scene.facts,
        "isWell": scene.is_well,
        "weight": vehicle.mass * scene.gravity,
        "ground": scene.ground,
        "body": {"semiAxes": body.semi_axes.tolist(), "centre": body.centre.tolist()},
        "rotors": [
            {
                "position": rotor.position_body.tolist(),
                "radius": rotor.radius,
                "spin": rotor.spin,
                "min": rotor.min_thrust,
                "max": rotor.max_thrust,
            }
            for rotor in vehicle.rotors
        ],
        "gates": [_gate(gate, blob, scene.times) for gate in scene.gates],
        "obstacles": _obstacles([each for each in scene.surfaces if each.motion is None], blob),
        "moving": [
            _obstacles([each], blob) | {"places": blob.add(each.motion.moved(scene.times), "f4")}
            for each in scene.surfaces
            if each.motion is not None
        ],
        "stages": [{"name": s.name, "time": s.time, "gate": s.gate} for s in scene.stages],
        "ghosts": [
            {"name": g.name, "position": _rounded(g.position), "attitude": _rounded(g.q_world_body)}
            for g in scene.ghosts
        ],
        "times": blob.add(scene.times, "f4"),
        "planned": blob.add(scene.planned, "f4"),
        "tracks": [_track(track, blob, top) for track in scene.tracks],
        "curves": [
            {"name": curve.name, "unit": curve.unit, "values": blob.add(curve.values, "f4")}
            for curve in scene.curves
        ],
    }


def _gate(gate: Gate, blob: Blob, times: Array) -> dict[str, Any]:
    width, height = gate.opening.size.tolist()
    moved = {} if gate.motion is None else {"places": blob.add(gate.motion.moved(times), "f4")}
    return moved | {
        "name": gate.name,
        "position": gate.position.tolist(),
        "normal": gate.normal.tolist(),
        "up": gate.up.tolist(),
        "width": width,
        "height": height,
        "outline": [_rounded(point) for point in gate.opening.outline],
    }


def _obstacles(surfaces: Sequence[Surface], blob: Blob) -> dict[str, Any]:
    """Return the triangles of obstacles, and the edges between their faces."""
    triangles = [surface.triangles for surface in surfaces]
    edges = [surface.edges for surface in surfaces]
    return {
        "triangles": blob.add(np.concatenate([*triangles, np.zeros((0, 3, 3))]), "f4"),
        "edges": blob.add(np.concatenate([*edges, np.zeros((0, 2, 3))]), "f4"),
    }


def _track(track: Track, blob: Blob, top: float) -> dict[str, Any]:
    """Return a track as plain data; the magnitudes of its thrusts are at most `top` [N]."""
    return {
        "name": track.name,
        "end": track.end,
        "failed": track.failed,
        "sentence": track.sentence,
        "position": blob.add(track.position, "f4"),
        "attitude": blob.add(track.q_world_body, "i2", 1.0 / DIGITS),
        "thrusts": blob.add(track.thrusts, "i2", top / DIGITS),
    }


def _rounded(values: Array) -> list[float]:
    return [round(value, 6) for value in values.tolist()]
