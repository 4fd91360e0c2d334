"""The path in space with the vehicle's attitude along it (paper, Fig. 5, upper part)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.planning import PlacedStage
from aerobat.problem.gate import Gate
from aerobat.reporting.page import HEADING, legend, size_of
from aerobat.reporting.panels.poses import PoseHistory
from aerobat.reporting.scene.axes_box import box_around, draw_axes_box
from aerobat.reporting.scene.camera import Camera, best_view
from aerobat.reporting.scene.glyphs import (
    drop_line,
    enlargement,
    gate_bars,
    gate_shapes,
    shadow,
    side_tint,
    span,
    thrust_axis_shape,
    vehicle_shapes,
)
from aerobat.reporting.scene.shapes import Shape, draw_depth_sorted, polyline
from aerobat.reporting.style import BAND, BLUE, HAIR, INK, RED
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POSES = 20  # time steps at which the vehicle is drawn, fewer where it would cover itself
SIZE = 0.085  # of the vehicle as drawn, relative to the path's extent
BELOW = 0.06  # by which a planned path is painted under a flown one, likewise
FLOWN_WIDTH, PLANNED_WIDTH = 1.3, 4.0  # [pt]
ALONE_WIDTH = 1.6  # [pt] of a planned path that nobody flew


def draw_path(
    axes: Axes,
    planned: PoseHistory,
    flown: Sequence[PoseHistory],
    vehicle: Vehicle,
    gate: Gate | None,
    stages: Sequence[PlacedStage] = (),
) -> str:
    """Draw planned and flown paths, the first vehicle along its path, the gate, other stages, start and end.

    Returns a note on how the vehicle is drawn.
    """
    scale = enlargement(vehicle, SIZE * planned.extent)
    reach = scale * span(vehicle)
    room = box_around(_everything(planned, flown, gate), 0.6 * reach)
    camera = best_view(planned.path, gate, room.corners, size_of(axes))
    draw_axes_box(axes, room, camera)
    poses = flown[0] if flown else planned
    samples, step = pose_samples(poses, reach, gate)
    shapes = [
        *_paths(planned, flown, float(room.lower[2])),
        *_gate(gate, float(room.lower[2])),
        *(shape for k in samples for shape in _pose(vehicle, poses, k, camera, scale)),
    ]
    draw_depth_sorted(axes, shapes, camera)
    _name_paths(axes, bool(flown))
    _mark_stages(axes, camera, planned, [stage for stage in stages if stage.gate is None])
    mark_ends(axes, camera.project(planned.position[[0, -1]]))
    size = "" if scale == 1.0 else f", {scale:g} times its size"
    return f"vehicle every {step:.2f} s{size}; blue seen from above, red from below"


def pose_samples(motion: PoseHistory, size: float, gate: Gate | None) -> tuple[list[int], float]:
    """At which samples to draw the vehicle: equal steps of time [s], one of them in the gate.

    Those at which it would cover one already drawn are left out.
    """
    step = float(np.ptp(motion.times)) / POSES
    passage = motion.passage(gate)
    asked = np.arange(passage % step, motion.times[-1] + 1e-9, step)
    kept = [int(np.abs(motion.times - passage).argmin())]
    for k in np.searchsorted(motion.times, asked - 1e-9).clip(0, len(motion.times) - 1).tolist():
        if np.linalg.norm(motion.position[kept] - motion.position[k], axis=-1).min() > 0.5 * size:
            kept.append(k)
    return sorted(kept), step


def _pose(vehicle: Vehicle, motion: PoseHistory, k: int, camera: Camera, scale: float) -> list[Shape]:
    q = motion.q_world_body[k]
    position, tint = motion.position[k], side_tint(q, camera)
    axis = thrust_axis_shape(vehicle, position, q, scale)
    return [axis, *vehicle_shapes(vehicle, position, q, scale, tint)]


def _paths(planned: PoseHistory, flown: Sequence[PoseHistory], floor: float) -> list[Shape]:
    """The planned path as a band with its shadow, the flown one as a line on it, many as thin lines."""
    course = planned.path
    shapes = [Shape(shadow(course, floor), edge=HAIR, width=3.0, depth_bias=-1e3)]
    width = PLANNED_WIDTH if flown else ALONE_WIDTH
    shapes += polyline(course, BAND, width, depth_bias=-BELOW * planned.extent)
    if len(flown) == 1:
        return shapes + polyline(flown[0].path, INK, FLOWN_WIDTH)
    opacity = max(0.08, len(flown) ** -0.5) if flown else 1.0
    return shapes + [s for motion in flown for s in polyline(motion.path, (INK, opacity), 0.6, piece=16)]


def _gate(gate: Gate | None, floor: float) -> list[Shape]:
    """The gate, with a line down to the floor from the middle of its lower edge."""
    if gate is None:
        return []
    lowest = np.sort(gate.corners[:, 2])[:2].mean()
    foot = gate.position + np.array([0.0, 0.0, lowest - gate.position[2]])
    return [*gate_shapes(gate), drop_line(foot, floor)]


def _everything(planned: PoseHistory, flown: Sequence[PoseHistory], gate: Gate | None) -> Array:
    """All that the room has to hold, (n, 3)."""
    points = [planned.path, *(motion.path for motion in flown)]
    if gate is not None:
        points.append(np.concatenate(gate_bars(gate)).reshape(-1, 3))
    return np.concatenate(points)


def _name_paths(axes: Axes, flown: bool) -> None:
    """What the band and the line are, for the legend."""
    axes.plot([], [], color=BAND, linewidth=PLANNED_WIDTH if flown else ALONE_WIDTH, label="planned")
    if flown:
        axes.plot([], [], color=INK, linewidth=FLOWN_WIDTH, label="flown")


def _mark_stages(axes: Axes, camera: Camera, planned: PoseHistory, stages: Sequence[PlacedStage]) -> None:
    """A diamond on the planned path at each stage; in the legend its name, or what many are."""
    if stages:
        rows = np.searchsorted(planned.times, [stage.time for stage in stages]).clip(
            0, len(planned.times) - 1
        )
        axes.plot(
            *camera.project(planned.position[rows]).T, "D", color="white", mec=INK, mew=1.1, markersize=5.5,
            label=stages[0].name if len(stages) == 1 else "stages", zorder=5.0,
        )  # fmt: skip


def mark_ends(axes: Axes, places: Array) -> None:
    """The end as a red disc, the start as a smaller blue one: both show where they coincide; and a legend."""
    for place, colour, size, name in ((places[0], BLUE, 5.5, "start"), (places[1], RED, 10.0, "end")):
        axes.plot(
            *place[:, None], "o", color=colour, mec="white", mew=0.8, markersize=size, label=name,
            zorder=6.0 - 0.1 * size,
        )  # fmt: skip
    legend(axes, above=HEADING)
