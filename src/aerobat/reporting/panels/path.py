"""The path in space with the vehicle's attitude along it (paper, Fig. 5, upper part)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.evaluation.subject import Subject
from aerobat.planning import PlacedStage
from aerobat.planning.passages import as_passed
from aerobat.problem.gate import Gate
from aerobat.reporting.page import HEADING, legend
from aerobat.reporting.panels.poses import PoseHistory
from aerobat.reporting.scene.axes_box import draw_box_around
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import (
    direction_marks,
    drop_line,
    enlargement,
    gate_corners,
    gate_shapes,
    pose_shapes,
    shadow,
    span,
)
from aerobat.reporting.scene.obstacles import obstacle_shapes, surfaces_beside
from aerobat.reporting.scene.shapes import Shape, draw_depth_sorted, polyline
from aerobat.reporting.style import BAND, BLUE, HAIR, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POSES = 20  # time steps at which the vehicle is drawn, fewer where it would cover itself
SIZE = 0.085  # size of the drawn vehicle, relative to the extent of the path
BELOW = 0.06  # depth of a reference path under an actual one, relative to its extent
ACTUAL_WIDTH, REFERENCE_WIDTH = 1.3, 4.0  # [pt]
ALONE_WIDTH = 1.6  # [pt] of a reference path without a flight


def draw_path(
    axes: Axes,
    subject: Subject,
    reference: PoseHistory,
    actual: Sequence[PoseHistory],
    size: float = SIZE,
) -> str:
    """Draw paths, the first vehicle along its path, the gates, obstacles, other stages, start and end.

    Only near obstacles are drawn, and moving ones at the times of some drawn vehicles. Stages without a gate
    are marked by diamonds.

    Args:
        axes: The axes.
        subject: The subject; the picture holds all of its gates.
        reference: The planned poses.
        actual: The poses of each flight; empty for a plan that is not flown.
        size: The size of the vehicle as drawn, relative to the path's extent.

    Returns:
        A note on how the vehicle is drawn.
    """
    vehicle, stages = subject.vehicle, subject.stages
    gates, poses = as_passed(subject.gates, stages), actual[0] if actual else reference
    largest = min(size * reference.extent, 0.5 * _least_distance(gates))  # in each gate a vehicle is drawn
    scale = enlargement(vehicle, largest)
    reach = scale * span(vehicle)
    rows, step = pose_samples(poses, reach, gates)
    paths = [each.path for each in (reference, *actual)]
    times = poses.times[rows[::6]]  # at which moving obstacles are drawn
    surfaces, points = surfaces_beside(subject.pieces, [*paths, gate_corners(gates)], times)
    box, camera = draw_box_around(axes, points, 0.6 * reach, reference.path, gates)
    floor = float(box.lower[2])
    shapes = _path_shapes(reference, actual, floor) + obstacle_shapes(surfaces, camera)
    for gate in gates:
        lowest = np.sort(gate.outline[:, 2])[:2].mean()  # the middle of the lower edge
        foot = gate.position + np.array([0.0, 0.0, lowest - gate.position[2]])
        shapes += [*gate_shapes(gate), drop_line(foot, floor)]
    for k in rows:
        shapes += pose_shapes(vehicle, poses.position[k], poses.q_world_body[k], scale, camera)
    between = [(a + b) // 2 for a, b in pairwise(rows)]
    shapes += direction_marks(poses.position, between[1::3], camera, 0.03 * reference.extent)
    draw_depth_sorted(axes, shapes, camera)
    axes.plot([], [], color=BAND, linewidth=REFERENCE_WIDTH if actual else ALONE_WIDTH, label="reference")
    if actual:
        axes.plot([], [], color=INK, linewidth=ACTUAL_WIDTH, label="actual")
    _mark_stages(axes, camera, reference, [stage for stage in stages if stage.gate is None])
    mark_ends(axes, camera.project(reference.position[[0, -1]]))
    enlarged = "" if scale == 1.0 else f", {scale:g} times its size"
    return f"vehicle every {step:.2f} s{enlarged}; blue seen from above, white from below"


def _least_distance(gates: Sequence[Gate]) -> float:
    """Return the least distance between the centres of two gates at different places [m]."""
    centres = np.array([gate.position for gate in gates]).reshape(-1, 3)
    apart = np.linalg.norm(centres[:, None] - centres, axis=-1)
    return float(apart[apart > 0.0].min(initial=np.inf))


def pose_samples(poses: PoseHistory, size: float, gates: Sequence[Gate]) -> tuple[list[int], float]:
    """Return the rows at which the vehicle is drawn, in gates and at equal steps of time, and the step [s].

    Rows at which the vehicle would cover one already drawn are left out.
    """
    step = float(np.ptp(poses.times)) / POSES
    kept = poses.rows_at_gates(gates) or [0]
    if not step:  # a flight that is over as it begins
        return [0], step
    for k in poses.rows(np.arange(poses.times[kept[0]] % step, poses.times[-1] + 1e-9, step)):
        if np.linalg.norm(poses.position[kept] - poses.position[k], axis=-1).min() > size:
            kept.append(k)
    return sorted(kept), step


def _path_shapes(reference: PoseHistory, actual: Sequence[PoseHistory], floor: float) -> list[Shape]:
    """Return the reference path as a band with its shadow, an actual path as a line, several as thin ones."""
    shapes = [Shape(shadow(reference.path, floor), edge=HAIR, width=3.0, depth_bias=-1e3)]
    width = REFERENCE_WIDTH if actual else ALONE_WIDTH
    shapes += polyline(reference.path, BAND, width, depth_bias=-BELOW * reference.extent)
    if len(actual) == 1:
        return shapes + polyline(actual[0].path, INK, ACTUAL_WIDTH)
    opacity = max(0.08, len(actual) ** -0.5) if actual else 1.0
    for poses in actual:
        shapes += polyline(poses.path, (INK, opacity), 0.6, piece=16)
    return shapes


def _mark_stages(axes: Axes, camera: Camera, reference: PoseHistory, stages: Sequence[PlacedStage]) -> None:
    """Draw a diamond on the reference path at each stage, and name it in the legend; several are "stages"."""
    if stages:
        rows = reference.rows([stage.time for stage in stages])
        axes.plot(
            *camera.project(reference.position[rows]).T, "D", color="white", mec=INK, mew=1.1, markersize=5.5,
            label=stages[0].name if len(stages) == 1 else "stages", zorder=5.0,
        )  # fmt: skip


def mark_ends(axes: Axes, places: Array) -> None:
    """Mark the end by a dark disc and the start by a smaller blue one, which shows on it; add a legend."""
    for place, colour, size, name in ((places[0], BLUE, 5.5, "start"), (places[1], INK, 10.0, "end")):
        axes.plot(
            *place[:, None], "o", color=colour, mec="white", mew=0.8, markersize=size, label=name,
            zorder=6.0 - 0.1 * size,
        )  # fmt: skip
    legend(axes, above=HEADING)
