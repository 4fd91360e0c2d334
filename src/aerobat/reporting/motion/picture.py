"""The picture of a flight at an instant: the vehicle on its path, and timelines with a cursor."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from aerobat.evaluation.subject import Subject
from aerobat.planning import Plan
from aerobat.reporting.page import AXIS, Place, house_style, panel, write
from aerobat.reporting.panels import timelines
from aerobat.reporting.panels.path import BELOW
from aerobat.reporting.panels.poses import actual_poses, plan_reference, reference_poses
from aerobat.reporting.scene.axes_box import draw_box_around
from aerobat.reporting.scene.camera import Camera
from aerobat.reporting.scene.glyphs import (
    enlargement,
    gate_corners,
    gate_shapes,
    pose_shapes,
    shadow,
    side_face,
    span,
    vehicle_shapes,
)
from aerobat.reporting.scene.obstacles import obstacle_shapes, surfaces_beside
from aerobat.reporting.scene.shapes import Shape, draw_depth_sorted, polyline
from aerobat.reporting.style import BAND, BLUE, FAINT, HAIR, INK, MUTED, NORMAL, TITLE
from aerobat.simulation import Flight

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = (7.2, 4.8)  # [in] of a picture
PASSED_OPACITY = 0.35  # [-] of the vehicle at stages that are passed
SCENE: Place = (0.0, 0.0, 4.0, 4.5)
LINES: tuple[Place, ...] = tuple((4.78, AXIS + 1.38 * k, 2.28, 1.0) for k in (2, 1, 0))


class MovingPicture:
    """The picture of a subject at any instant; the parts that do not move are drawn once.

    Args:
        subject: The subject.
        dpi: The resolution [pixels/in].
    """

    def __init__(self, subject: Subject, dpi: int) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        shown, vehicle = subject.shown, subject.vehicle
        self._subject = subject
        if isinstance(shown, Plan):
            planned = plan_reference(shown, vehicle)
            self._reference, self._thrusts = reference_poses(planned), planned.rotor_thrusts
            self._moved = [self._reference]
        else:
            self._reference, self._thrusts = reference_poses(shown), shown.thrusts
            self._moved = actual_poses(shown)
        self._scale = enlargement(vehicle, 0.18 * self._reference.extent)
        title = f"{subject.name} · {vehicle.name}"
        with house_style():
            self._figure = Figure(figsize=SIZE, dpi=dpi)
            self._canvas = cast(Any, FigureCanvasAgg(self._figure))  # parts of it have no types
            write(self._figure, 0.2, SIZE[1] - 0.3, title, size=TITLE + 2, weight="bold", va="center")
            self._scene = panel(self._figure, *SCENE)
            self._camera = self._draw_scene()
            self._timelines = self._draw_timelines()
            self._cursors = [axes.axvline(0.0, color=INK, linewidth=1.0) for axes in self._timelines]
            x, y = 3.9 / SIZE[0], 1.0 - 0.3 / SIZE[1]
            self._clock = self._figure.text(x, y, "", size=NORMAL + 1, color=MUTED, ha="right", va="center")
            for artist in (*self._cursors, self._clock):
                artist.set_animated(True)
            self._canvas.draw()
            self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    @property
    def duration(self) -> float:
        """The duration of the plan, or of the flight [s]."""
        return float(self._reference.times[-1])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = self._canvas.get_width_height()
        return width, height

    def at(self, time: float) -> NDArray[np.uint8]:
        """The pixels at an instant [s], (height, width, 3)."""
        with house_style():
            self._canvas.restore_region(self._still)
            moving = draw_depth_sorted(self._scene, [*self._standing, *self._moving(time)], self._camera)
            self._scene.draw_artist(moving)
            moving.remove()
            self._clock.set_text(f"{time:.2f} s")
            self._figure.draw_artist(self._clock)
            for axes, cursor in zip(self._timelines, self._cursors, strict=True):
                cursor.set_xdata([time, time])
                axes.draw_artist(cursor)
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _draw_scene(self) -> Camera:
        """Draw the box around the scene, and return the camera."""
        subject, path = self._subject, self._reference.path
        points = [path, *(poses.path for poses in self._moved), gate_corners(subject.gates)]
        self._surfaces, held = surfaces_beside(subject.pieces, points)
        pad = 0.6 * self._scale * span(subject.vehicle)
        box, camera = draw_box_around(self._scene, held, pad, path, subject.gates)
        self._floor = float(box.lower[2])
        return camera

    def _draw_timelines(self) -> list[Axes]:
        """Draw rotor thrusts over time, and a flight's errors above them; return the axes."""
        subject = self._subject
        column = [panel(self._figure, *LINES[-1])]
        if isinstance(subject.shown, Flight):
            column = [*(panel(self._figure, *place) for place in LINES[:-1]), *column]
            timelines.draw_errors(column, subject.shown)
        timelines.draw_rotor_thrusts(column[-1], self._reference.times, self._thrusts, subject.vehicle)
        stages = subject.stages if len(subject.stages) <= 6 else ()  # whose names have room
        timelines.finish_column(column, "", stages, self.duration)
        for axes in column:
            if (legend := axes.get_legend()) is not None:
                legend.remove()
        return column

    @cached_property
    def _standing(self) -> list[Shape]:
        """The shapes that stand still: gates, obstacles and the reference path."""
        path = self._reference.path
        shapes = [Shape(shadow(path, self._floor), edge=HAIR, width=2.5, depth_bias=-1e3)]
        shapes += polyline(path, BAND, 3.2, depth_bias=-BELOW * self._reference.extent)
        shapes += obstacle_shapes([each for each in self._surfaces if each.motion is None], self._camera)
        still = [gate for gate in self._subject.gates if gate.motion is None]
        return shapes + [shape for gate in still for shape in gate_shapes(gate)]

    def _moving(self, time: float) -> list[Shape]:
        """Return the shapes of vehicles at an instant, their paths until then, and the stages passed."""
        moved = [each.at(time) for each in self._surfaces if each.motion is not None]
        shapes = [*obstacle_shapes(moved, self._camera), *self._passed(time)]
        gates = [gate.at(time) for gate in self._subject.gates if gate.motion is not None]
        shapes += [shape for gate in gates for shape in gate_shapes(gate)]
        many = len(self._moved) > 1
        line: Any = (BLUE, 0.3) if many else BLUE
        for poses in self._moved:
            k = poses.rows([time])[0]
            position, q = poses.position[k], poses.q_world_body[k]
            flown = poses.position[: k + 1 : max(1, k // 80)]
            if len(flown) > 1:
                shapes += polyline(np.concatenate([flown, position[None]]), line, 1.0 if many else 1.8)
            shapes += pose_shapes(self._subject.vehicle, position, q, self._scale, self._camera)
            foot = shadow(position, self._floor)
            shapes.append(Shape(np.array([position, foot]), edge=FAINT, width=0.6, depth_bias=-1e3))
        return shapes

    def _passed(self, time: float) -> list[Shape]:
        """Return the first vehicle at the stages until an instant, nearly transparent."""
        poses = self._moved[0]
        rows = poses.rows([stage.time for stage in self._subject.stages if stage.time <= time])
        shapes: list[Shape] = []
        for position, q in zip(poses.position[rows], poses.q_world_body[rows], strict=True):
            colour, opacity = side_face(q, self._camera)
            face = colour, PASSED_OPACITY * opacity
            shapes += vehicle_shapes(self._subject.vehicle, position, q, self._scale, face)
        return [replace(each, edge=(INK, PASSED_OPACITY), width=0.7 * each.width) for each in shapes]
