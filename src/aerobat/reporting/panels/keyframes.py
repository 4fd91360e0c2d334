"""Keyframes of a maneuver and the plane in which they are shown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import force_balance, reference
from aerobat.planning import Plan
from aerobat.reporting.scene.camera import Camera
from aerobat.vehicle import Vehicle

FEWEST = 5  # stages; if a maneuver has fewer, equal steps of time are added
STEPS = 8


@dataclass(frozen=True)
class ManeuverPlane:
    """The vertical plane in which the specific thrust turns, at a heading [deg] of its horizontal axis."""

    heading_deg: float  # without a sense of direction: from -45 up to 135, so that x and y point right

    def __post_init__(self) -> None:
        """Turn the heading so that x and y point right."""
        object.__setattr__(self, "heading_deg", float((self.heading_deg + 45.0) % 180.0 - 45.0))

    @property
    def camera(self) -> Camera:
        """The view perpendicular to the plane, with its horizontal axis to the right."""
        return Camera(float(np.deg2rad(self.heading_deg - 90.0)))

    def of_thrust(self, thrust: Array) -> ManeuverPlane:
        """Return the vertical plane that holds a specific thrust (3,); for a vertical thrust, this one."""
        if np.linalg.norm(thrust[:2]) < 0.1 * np.linalg.norm(thrust):
            return self
        return ManeuverPlane(round(float(np.rad2deg(np.arctan2(thrust[1], thrust[0]))), 0))

    @property
    def name(self) -> str:
        """The name of the horizontal axis: x, y, or h for another heading, which the label has."""
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
    gate: str | None = None  # the name of the gate that is passed then
    along: float | None = None  # [deg] the heading of its own plane, where it is shown in one


@dataclass(frozen=True, eq=False)
class Keyframes:
    """Instants of a plan with the planned poses and thrusts."""

    instants: tuple[Keyframe, ...]
    position: Array  # [m], (k, 3)
    q_world_body: Array  # (k, 4)
    thrust: Array  # [m/s²] specific thrust, drag counted, (k, 3)

    @property
    def stages(self) -> list[int]:
        """The indices of the stages among the instants."""
        return [k for k, keyframe in enumerate(self.instants) if keyframe.interval is not None]

    def only(self, kept: list[int]) -> Keyframes:
        """Return the keyframes with these indices."""
        instants = tuple(self.instants[k] for k in kept)
        return Keyframes(instants, self.position[kept], self.q_world_body[kept], self.thrust[kept])

    def numbered(self) -> Keyframes:
        """Return the keyframes with numbers before their names, as timelines count stages."""
        instants = tuple(replace(each, name=f"{k} {each.name}") for k, each in enumerate(self.instants, 1))
        return replace(self, instants=instants)

    def shortened(self, letters: int) -> Keyframes:
        """Return the keyframes with names of at most this many letters."""
        names = [k.name if len(k.name) <= letters else f"{k.name[: letters - 1]}…" for k in self.instants]
        instants = tuple(replace(k, name=name) for k, name in zip(self.instants, names, strict=True))
        return replace(self, instants=instants)

    def storyboard(self, plane: ManeuverPlane, downward: bool, pitch: float) -> tuple[Keyframes, Array]:
        """Lay the keyframes out in a row, each turned about the vertical until its thrust lies in the plane.

        Args:
            plane: The plane of the picture.
            downward: True for a column, false for a row to the right.
            pitch: The distance from one to the next [m].

        Returns:
            The keyframes, each with the heading of its own plane, and their turns, (k, 4).
        """
        headings = [plane.of_thrust(thrust) for thrust in self.thrust]
        angles = np.deg2rad([plane.heading_deg - own.heading_deg for own in headings])
        turns = np.stack([so3.about_axis(so3.UP, angle) for angle in angles])
        direction = -plane.camera.screen[1] if downward else plane.camera.screen[0]
        shown = Keyframes(
            tuple(replace(k, along=own.heading_deg) for k, own in zip(self.instants, headings, strict=True)),
            pitch * np.arange(len(turns))[:, None] * direction,
            so3.multiply(turns, self.q_world_body),
            so3.rotate(turns, self.thrust),
        )
        return shown, turns


def plan_keyframes(plan: Plan, vehicle: Vehicle) -> Keyframes:
    """Return keyframes of a plan at its stages and, if these are few, at equal steps of time between them."""
    shown = [Keyframe(stage.name, stage.time, stage.interval, stage.gate) for stage in plan.stages]
    if len(shown) < FEWEST:
        steps = np.linspace(0.0, plan.duration, STEPS + 1).tolist()
        shown += [Keyframe("", t) for t in steps if all(abs(t - k.time) > 0.5 * steps[1] for k in shown)]
    shown.sort(key=lambda keyframe: keyframe.time)  # stages may come in any order
    times = [keyframe.time for keyframe in shown]
    environment = plan.problem.environment
    setpoint = reference(plan.trajectory, vehicle, times=times, environment=environment).setpoint
    flat = setpoint.flat
    thrust = force_balance(environment, vehicle).specific_thrust(flat.velocity, flat.acceleration)
    return Keyframes(tuple(shown), flat.position, setpoint.q_world_body, thrust)


def maneuver_plane(plan: Plan, thrust: Array) -> ManeuverPlane:
    """Return the plane normal to the maneuver's axis, or else that in which the thrust (k, 3) varies most."""
    axis = plan.problem.maneuver.turn_axis
    if axis is not None:
        axis_deg = round(float(np.rad2deg(np.arctan2(axis[1], axis[0]))), 9)
        return ManeuverPlane(axis_deg - 90.0)
    heading_deg, _ = _main_direction(thrust)
    return ManeuverPlane(15.0 * round(heading_deg / 15.0))


def plane_of(points: Array) -> ManeuverPlane | None:
    """Return the vertical plane that holds points (n, 3); None where there is no such plane."""
    heading_deg, spread = _main_direction(points)
    if spread > 0.02 * np.ptp(points, axis=0).max():
        return None
    return ManeuverPlane(round(heading_deg, 1))


def _main_direction(points: Array) -> tuple[float, float]:
    """Return the heading [deg] along which points (n, 3) spread most, and their spread across it."""
    level = points[:, :2] - points[:, :2].mean(axis=0)
    if not level.any():
        return 0.0, 0.0
    _, _, directions = np.linalg.svd(level, full_matrices=False)
    along, across = directions[0], np.array([-directions[0, 1], directions[0, 0]])
    return float(np.rad2deg(np.arctan2(along[1], along[0]))), float(np.ptp(level @ across))
