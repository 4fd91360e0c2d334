"""What a figure of a maneuver's stages shows: which moments, in which plane, with what thrust."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness import reference
from aerobat.planning import Plan
from aerobat.problem import Flip
from aerobat.reporting.scene.camera import Camera
from aerobat.vehicle import Vehicle

FEWEST = 5  # moments shown; where a maneuver has fewer stages, equal steps of time join them
STEPS = 8
ROUND_HEADING = 15.0  # [deg]
THIN = 0.02  # of a path's extent: what spreads less to its sides lies in a plane


@dataclass(frozen=True)
class ManeuverPlane:
    """The vertical plane in which the specific thrust turns, at a heading [deg] of its horizontal axis."""

    heading_deg: float

    @property
    def camera(self) -> Camera:
        """The view straight onto the plane, its horizontal axis to the right."""
        return Camera(float(np.deg2rad(self.heading_deg - 90.0)))

    @property
    def name(self) -> str:
        """What the horizontal axis is called: x, y, or h (a heading that is then to be told)."""
        return {0.0: "x", 90.0: "y"}.get(self.heading_deg, "h")

    @property
    def label(self) -> str:
        """The horizontal axis' label with its unit."""
        return f"{self.name} [m]" if self.name != "h" else f"h [m], horizontal at {self.heading_deg:.4g}°"


@dataclass(frozen=True)
class Keyframe:
    """One instant of a maneuver: a stage, or a step of time between stages (no interval)."""

    name: str
    time: float  # [s]
    interval: int | None = None


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Keyframe of a plan with what the vehicle is asked there."""

    moments: tuple[Keyframe, ...]
    position: Array  # [m], (k, 3)
    q_world_body: Array  # (k, 4)
    thrust: Array  # [m/s²] specific thrust a + g e3, (k, 3)

    def only(self, kept: list[int]) -> Keyframes:
        """Some of the moments."""
        moments = tuple(self.moments[k] for k in kept)
        return Keyframes(moments, self.position[kept], self.q_world_body[kept], self.thrust[kept])


def keyframes(plan: Plan, vehicle: Vehicle) -> Keyframes:
    """What `plan` asks of `vehicle` at its stages, and where those are few, at equal steps of time."""
    shown = [Keyframe(stage.name, stage.time, stage.interval) for stage in plan.stages]
    if len(shown) < FEWEST:
        steps = np.linspace(0.0, plan.duration, STEPS + 1).tolist()
        shown += [Keyframe("", t) for t in steps if all(abs(t - m.time) > 0.5 * steps[1] for m in shown)]
    shown.sort(key=lambda moment: moment.time)  # stages may come in any order
    times = [moment.time for moment in shown]
    setpoint = reference(plan.trajectory, vehicle, times=times, environment=plan.problem.environment).setpoint
    thrust = setpoint.flat.acceleration + plan.problem.environment.weight
    return Keyframes(tuple(shown), setpoint.flat.position, setpoint.q_world_body, thrust)


def maneuver_plane(plan: Plan, thrust: Array) -> ManeuverPlane:
    """The plane square to a flip's axis; else that in which the specific thrust (k, 3) varies most."""
    if isinstance(plan.problem.maneuver, Flip):
        return ManeuverPlane(_as_line(plan.problem.maneuver.axis_deg - 90.0))
    level = thrust[:, :2] - thrust[:, :2].mean(axis=0)
    _, _, directions = np.linalg.svd(level)
    heading = np.rad2deg(np.arctan2(directions[0, 1], directions[0, 0]))
    return ManeuverPlane(_as_line(ROUND_HEADING * round(heading / ROUND_HEADING)))


def plane_of(points: Array) -> ManeuverPlane | None:
    """The vertical plane in which points (n, 3) lie; None where they spread to its sides."""
    level = points[:, :2] - points[:, :2].mean(axis=0)
    _, _, directions = np.linalg.svd(level, full_matrices=False)
    if np.ptp(level @ directions[1]) > THIN * np.ptp(points, axis=0).max():
        return None
    along = directions[0] if np.ptp(level) > 0.0 else np.array([1.0, 0.0])
    return ManeuverPlane(_as_line(round(float(np.rad2deg(np.arctan2(along[1], along[0]))), 1)))


def _as_line(heading_deg: float) -> float:
    """A heading without a sense of direction, from -45° up to 135°, so that x and y point right."""
    return float((heading_deg + 45.0) % 180.0 - 45.0)
