"""Links of a robot as one rigid body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError


class RigidTransform(NamedTuple):
    """A frame in an outer frame: its point x is at `rotation` x + `origin` in the outer frame."""

    rotation: Array  # (3, 3)
    origin: Array  # [m], (3,)

    @classmethod
    def of(cls, origin: Array, roll_pitch_yaw: Array) -> RigidTransform:
        """Return the frame at an origin, turned by roll, pitch and yaw [rad] about the outer x, y, z axes."""
        (cr, cp, cy), (sr, sp, sy) = np.cos(roll_pitch_yaw), np.sin(roll_pitch_yaw)
        about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        return cls(about_z @ about_y @ about_x, origin)

    def then(self, inner: RigidTransform) -> RigidTransform:
        """Return a frame that is given in this one, in the outer frame."""
        return RigidTransform(self.rotation @ inner.rotation, self.rotation @ inner.origin + self.origin)


MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")  # as both formats name them, in the order of `link_of`
IDENTITY = RigidTransform(np.eye(3), np.zeros(3))


@dataclass(frozen=True)
class Link:
    """A link in the frame of its model."""

    name: str
    pose: RigidTransform
    mass: float  # [kg]
    centre: Array  # [m] of mass, (3,)
    inertia: Array  # [kg·m²] about the centre of mass, the model's axes, (3, 3)
    radius: float | None  # [m] of its collision shape about its z axis
    axis: Array | None  # of its joint, the model's axes, (3,); None where none is given


@dataclass(frozen=True)
class Motor:
    """A rotor whose motor is described."""

    link: str  # name of the link that turns
    spin: int  # 1 counter-clockwise seen from above
    k_f: float  # [N/(rad/s)²]
    torque_coefficient: float  # [m]
    max_speed: float  # [rad/s]
    lag: float  # [s]
    drag: float  # [N/(rad/s · m/s)] perpendicular to its axis


@dataclass(frozen=True)
class Robot:
    """A robot's links and motors; `rotor_defaults` are the values that a file gives for all rotors."""

    name: str
    links: tuple[Link, ...]
    motors: tuple[Motor, ...]
    rotor_defaults: dict[str, float]
    notes: tuple[str, ...]


def link_of(
    name: str,
    pose: RigidTransform,
    radius: float | None,
    axis: Array | None,
    inertial: RigidTransform = IDENTITY,
    mass: float = 0.0,
    moments: Sequence[float] = (0.0,) * len(MOMENTS),
) -> Link:
    """Return a link with the values in its file, by default massless. Raises SpecError for a mass below zero.

    Args:
        name: of the link.
        pose: its frame in that of the model.
        radius: [m] of its collision shape.
        axis: of its joint, the model's axes, (3,).
        inertial: the frame of its inertia in the link's, with its origin at the centre of mass.
        mass: [kg].
        moments: MOMENTS [kg·m²].
    """
    if mass < 0.0:
        raise SpecError(f"link '{name}': mass must be 0 or more, got {mass:g} kg")
    xx, yy, zz, xy, xz, yz = moments
    at = pose.then(inertial)
    inertia = at.rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ at.rotation.T
    return Link(name, pose, mass, at.origin, (inertia + inertia.T) / 2, radius, axis)


def merged(links: Iterable[Link]) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass [m] (3,) and inertia [kg·m²] about it (3, 3) of links as one body.

    By the parallel-axis theorem, J = Σ J_i + m_i (|r_i|² 1 − r_i r_iᵀ) with r_i from the common centre.
    """
    links = tuple(links)
    mass = sum(link.mass for link in links)
    if mass <= 0.0:
        raise SpecError("no link has a mass; give each its <inertial>")
    centre = sum((link.mass * link.centre for link in links), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for link in links:
        arm = link.centre - centre
        inertia += link.inertia + link.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia
