"""The attitudes of a maneuver's stages, in the maneuver's plane (paper, Fig. 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.planning import Plan
from aerobat.planning.passages import as_passed
from aerobat.problem.gate import Gate
from aerobat.reporting.page import set_scale, size_of, spread_out
from aerobat.reporting.panels.keyframes import (
    Keyframe,
    Keyframes,
    ManeuverPlane,
    maneuver_plane,
    plan_keyframes,
)
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import enlargement, gate_section, span, vehicle_shapes
from aerobat.reporting.scene.shapes import draw_depth_sorted
from aerobat.reporting.style import BAND, BLUE, FAINT, INK, MUTED, NORMAL, SKY, SMALL
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VEHICLE = 0.6  # [in] about the size of a vehicle
MOST_STAGES = 11  # largest number of stages in a legible row
STAGE_ROW = 0.5  # [in] kept free for names at the foot of a wide panel
LETTER = 0.082  # [in] width of a letter of a stage's name
# [pt] from the end of a thin line to the text, by the alignment of the text
GAPS = {"right": (-2.88, 0.0), "left": (2.88, 0.0), "center": (0.0, -2.88)}
COMPONENTS = np.eye(2)  # lateral, vertical
KEYS = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0])  # [m/s²] thrusts that a key may show


def draw_stages(axes: Axes, plan: Plan, vehicle: Vehicle) -> str:
    """Draw the stages in the maneuver's plane; return a note on what is shown.

    Stages that would cover each other in that plane follow one another along the panel's longer side, each in
    the vertical plane of its own thrust. Maneuvers that stay in place or leave the plane have such stages.
    """
    width, height = size_of(axes)
    most = MOST_STAGES if height >= width else min(MOST_STAGES, int(width / 1.1))  # [in] with their names
    whole = plan_keyframes(plan, vehicle)
    letters = int(width / (3 if height >= width else min(len(whole.instants), most)) / LETTER)
    shots = whole.shortened(letters)
    plane = maneuver_plane(plan, shots.thrust)
    camera = plane.camera
    gates = as_passed(plan.problem.gates, plan.stages)
    column = _column(shots)
    frame = camera.project(np.concatenate([shots.position, *(gate.outline for gate in gates)]))
    inches = _fit(axes, frame, VEHICLE, span(vehicle), (column, column))  # per metre
    reach = enlargement(vehicle, VEHICLE / inches) * span(vehicle)  # [m]
    axes.set(xlabel=plane.label, ylabel="z [m]")
    if not _is_crowded(shots, camera, 0.5 * reach):
        shots = shots.only(_apart(shots, camera, 0.85 * reach))
        path = plan.trajectory.evaluate(np.linspace(0.0, plan.duration, 241))
        axes.plot(*camera.project(path).T, color=BAND, linewidth=1.6)
        scale = _draw(axes, shots, gates, plane, vehicle, (column, column))
        end = "segment" if plan.dt is None else "interval"
        note = f"a stage holds at the end of {end} n" if plan.stages else "equal steps of time"
    else:
        stages = whole.stages
        shown = sorted({round(k) for k in np.linspace(0, len(stages) - 1, most)})
        numbered = whole.only(stages).numbered().only(shown).shortened(letters)
        shots, gates = _storyboard(axes, numbered, gates, plane)
        beside = max(_column(shots), 1.0)  # [in] for what is told of each
        scale = _draw(axes, shots, gates, plane, vehicle, (0.0, beside), shrink=0.6)
        left_out = len(stages) - len(shown)
        some = f" but for {left_out} of {len(stages)}" if left_out else ""
        note = f"in order{some}, each seen across its thrust"
    return note if scale == 1.0 else f"{note}; vehicle {scale:g} times its size"


def _column(shots: Keyframes) -> float:
    """Return the width [in] of a name, at either side of a tall panel and in the row below a wide one."""
    return max(0.62, LETTER * max(len(keyframe.name) for keyframe in shots.instants))


def _is_crowded(shots: Keyframes, camera: Camera, distance: float) -> bool:
    """Return True where two stages are nearer to each other than `distance` [m] on the picture."""
    places = camera.project(shots.position[shots.stages])
    apart = np.linalg.norm(places[:, None] - places, axis=-1)
    return bool((apart[np.triu_indices(len(places), 1)] < distance).any())


def _apart(shots: Keyframes, camera: Camera, distance: float) -> list[int]:
    """Return the indices of the stages, and of the steps of time that lie clear of all others."""
    places = camera.project(shots.position)
    kept = shots.stages
    for k in range(len(places)):
        if k not in kept and all(np.linalg.norm(places[i] - places[k]) > distance for i in kept):
            kept.append(k)
    return sorted(kept)


def _storyboard(
    axes: Axes, shots: Keyframes, gates: Sequence[Gate], plane: ManeuverPlane
) -> tuple[Keyframes, tuple[Gate, ...]]:
    """Return stages in a row along the panel's longer side, and the gates that they pass."""
    size = size_of(axes)
    downward = bool(size[1] >= size[0])
    passed = [
        (k, gate, gate.position - shots.position[k])
        for k, each in enumerate(shots.instants)
        for gate in gates
        if gate.name == each.gate
    ]
    reaches = (gate.opening.circumradius + float(np.linalg.norm(offset)) for _, gate, offset in passed)
    largest = 2.0 * max(reaches, default=0.0)  # [m]
    pitch = max(1.0, 1.15 * largest)  # [m]
    if not downward:  # the row fills the panel
        tall = size[1] - STAGE_ROW
        pitch = max(pitch, largest * float(size[0] / max(len(shots.instants), 1) / tall))
    shown, turns = shots.storyboard(plane, downward, pitch)
    moved = []
    for k, gate, offset in passed:
        away, normal, up = (so3.rotate(turns[k], each) for each in (offset, gate.normal, gate.up))
        moved.append(replace(gate, position=shown.position[k] + away, normal=normal, up=up))
    axes.set(xticks=[], yticks=[], ylabel="stages in order, downward" if downward else "")
    axes.set(xlabel="h: horizontal, along each stage's own angle" if downward else "stages in order")
    return shown, tuple(moved)


def _draw(
    axes: Axes,
    shots: Keyframes,
    gates: Sequence[Gate],
    plane: ManeuverPlane,
    vehicle: Vehicle,
    columns: tuple[float, float],
    shrink: float = 1.0,
) -> float:
    """Draw vehicles, gates, arrows of thrust and names; return by how much vehicles are enlarged.

    Names take columns [in] left and right; vehicles and arrows are `shrink` times as large as usual.
    """
    camera = plane.camera
    frame = camera.project(np.concatenate([shots.position, *(gate.outline for gate in gates)]))
    inches = _fit(axes, frame, shrink * VEHICLE, span(vehicle), columns)  # per metre
    scale = enlargement(vehicle, shrink * VEHICLE / inches)
    places, thrust = camera.project(shots.position), camera.project(shots.thrust)
    step = float(np.linalg.norm(np.diff(places, axis=0), axis=1).min(initial=np.inf))  # [m]
    longest = min(shrink, 0.8 * step * inches)  # [in] the longest arrow
    arrow = longest / max(float(np.abs(thrust).max()), 1e-9)  # [in] per m/s²
    tips = places + thrust * arrow / inches
    pad = 0.6 * inches * scale * span(vehicle)
    inches = _fit(axes, np.concatenate([frame, tips]), pad, span(vehicle), columns)
    for gate in gates:
        draw_depth_sorted(axes, gate_section(gate, camera), camera, zorder=1.5)
    vehicles = []
    for position, q in zip(shots.position, shots.q_world_body, strict=True):
        vehicles += vehicle_shapes(vehicle, position, q, scale, weight=1.5)
    draw_depth_sorted(axes, vehicles, camera, zorder=2.2)
    _draw_sums(axes, places, thrust * arrow / inches)
    _draw_components(axes, places, thrust * arrow, arrow, plane)
    _draw_names(axes, shots.instants, places, thrust, 0.55 * scale * span(vehicle), columns)
    return scale


def _fit(axes: Axes, points: Array, pad: float, min_side: float, columns: tuple[float, float]) -> float:
    """Fit points (n, 2) [m], `pad` [in] around, and names beside them; return both axes' scale [in/m].

    Names take columns [in] left and right of a tall panel. What is shorter than `min_side` [m] is shown that
    long.
    """
    size = size_of(axes)
    (left, right), foot = (columns, 0.0) if size[1] >= size[0] else ((0.0, 0.0), STAGE_ROW)
    free = size - (left + right, foot)
    low, high = points.min(axis=0), points.max(axis=0)
    inches = float(((free - np.minimum(2 * pad, 0.5 * free)) / np.maximum(high - low, min_side)).min())
    set_scale(axes, (low + high) / 2 + np.array([right - left, -foot]) / 2 / inches, 1.0 / inches)
    return inches


def _draw_sums(axes: Axes, places: Array, sums: Array) -> None:
    """Draw the thrust in the plane (k, 2) [m] as a line from each vehicle, the diagonal of its components."""
    from matplotlib.collections import LineCollection

    tips = places + sums
    sides = np.concatenate([np.stack([places + sums * part, tips], axis=1) for part in COMPONENTS])
    for lines, style in (
        (np.stack([places, tips], axis=1), {"colors": INK, "linewidths": 0.9}),
        (sides, {"colors": FAINT, "linewidths": 0.8, "linestyles": [(0, (2, 2))]}),
    ):
        axes.add_collection(LineCollection(list(lines), zorder=2.1, **style), autolim=False)


def _draw_components(axes: Axes, places: Array, arrows: Array, unit: float, plane: ManeuverPlane) -> None:
    """Draw the thrust's components (k, 2) [in] as arrows, with keys; 1 m/s² is `unit` [in] long."""
    size = size_of(axes)
    key = max(KEYS[KEYS * unit <= 0.4], default=KEYS[0])  # [m/s²] of the longest arrow within 0.4 in
    names = (f"thrust along {plane.name}", "thrust along z")
    for part, colour, name, place in zip(COMPONENTS, (SKY, BLUE), names, (1.3, 3.05), strict=True):
        quiver = axes.quiver(
            *places.T, *(arrows * part).T, color=colour, units="inches", scale_units="inches", angles="uv",
            scale=1.0, width=0.024, headwidth=4.2, headlength=4.6, headaxislength=4.2, minlength=0, zorder=3,
        )  # fmt: skip
        axes.quiverkey(
            quiver, 1.0 - place / size[0], 1.0 + 0.38 / size[1], key * unit, f"{name}  {key:g} m/s²",
            labelpos="E", labelsep=0.06, labelcolor=INK, fontproperties={"size": SMALL}, coordinates="axes",
        )  # fmt: skip


def _draw_names(
    axes: Axes,
    instants: tuple[Keyframe, ...],
    places: Array,
    thrust: Array,
    clear: float,
    columns: tuple[float, float],
) -> None:
    """Write names, times and intervals beside the vehicles or below them, with a thin line to each."""
    from matplotlib.collections import LineCollection

    size = size_of(axes)
    inches = size[0] / float(np.ptp(axes.get_xlim()))  # per metre
    corner = np.array([axes.get_xlim()[0], axes.get_ylim()[0]])
    beside = size[1] >= size[0]
    on_page = (places - corner) * inches
    names = _names_beside(on_page, thrust, size, columns) if beside else _names_below(on_page, size, columns)
    anchors = names / inches + corner
    away = anchors - places
    reach = np.linalg.norm(away, axis=1, keepdims=True)
    starts = places + away * np.minimum(clear / np.maximum(reach, 1e-9), 1.0)
    lines = np.stack([starts, anchors], axis=1)[reach[:, 0] > clear + 0.12 / inches]
    axes.add_collection(LineCollection(list(lines), colors=FAINT, linewidths=0.7, zorder=2.0), autolim=False)
    for keyframe, anchor, direction in zip(instants, anchors, away, strict=True):
        side = "center" if not beside else "right" if direction[0] < 0 else "left"
        _write_name(axes, keyframe, anchor, side)


def _write_name(axes: Axes, keyframe: Keyframe, anchor: Array, side: str) -> None:
    """Write a stage's name in bold over its time and interval; of a step between stages only the time."""
    below = side == "center"
    place: dict[str, Any] = {"xy": anchor, "xytext": GAPS[side], "textcoords": "offset points", "ha": side}
    if keyframe.interval is None:
        up = "top" if below else "center"
        axes.annotate(f"{keyframe.time:.2f} s", size=SMALL, color=MUTED, va=up, **place)
        return
    axes.annotate(keyframe.name, size=NORMAL, weight="bold", va="top" if below else "bottom", **place)
    shown = f"n = {keyframe.interval}" if keyframe.along is None else f"h along {keyframe.along:g}°"
    place["xytext"] = (GAPS[side][0], GAPS[side][1] - 1.35 * SMALL * below)
    facts = f"{keyframe.time:.2f} s\n{shown}"
    axes.annotate(facts, size=SMALL, color=MUTED, linespacing=1.15, va="top", **place)


def _names_beside(places: Array, thrust: Array, size: Array, columns: tuple[float, float]) -> Array:
    """Return the places of names in columns left and right of a picture, each opposite to the thrust there.

    All lengths are in inches from the lower left corner of a picture of `size` (2,). Names are as wide as
    their columns, and none stands in a column of no width; (k, 2) -> (k, 2).
    """
    lateral = np.where(np.abs(thrust[:, 0]) > 0.2 * np.abs(thrust).max(), thrust[:, 0], 0.0)
    off_centre = places[:, 0] - places[:, 0].mean()
    left = np.where(lateral == 0.0, off_centre < -1e-3 * size[0], lateral > 0.0) & (columns[0] > 0.0)
    anchors = np.where(left[:, None], [columns[0], 0.0], [size[0] - columns[1], 0.0])
    for side in (left, ~left):
        anchors[side, 1] = spread_out(places[side, 1], 0.5, 0.3, size[1] - 0.3)
    return anchors


def _names_below(places: Array, size: Array, columns: tuple[float, float]) -> Array:
    """Return the places of names in a row at the foot of a picture, in inches, as in `_names_beside`."""
    width = max(columns)
    across = spread_out(places[:, 0], width, 0.5 * width, size[0] - 0.5 * width)
    return np.stack([across, np.full_like(across, STAGE_ROW)], axis=1)
