"""The ellipsoid that encloses a vehicle, its propellers included: the body that passes through a gate.

The body is an ellipsoid and not a box for three reasons. The section of an ellipsoid by a plane, and the
reach of that section, are known in closed form. An ellipsoid has no corners where nothing is: a flip turns
the body about its thrust axis by as much as its path asks, and a box drawn about round frames would touch
with its corners. An ellipsoid costs a flight little at every tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from math import cos, hypot, pi
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import AfterValidator

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import FieldError, Vector3, declared
from aerobat.vehicle.rotor import Rotor

# [-] half the height over half the width: Bitcraze's Crazyflie 2.x 29 mm of 139 mm, the Iris of PX4's models
# 11 cm of 77 cm
FLATNESS = 0.2
ENCLOSING = 1e-3  # [-] of the semi-axes, by which a propeller may stick out: what files are rounded to
_CORNERS = 96  # of the polygon about a propeller's disc: 0.05 % of its radius too large


def _positive(value: Array) -> Array:
    if (value <= 0.0).any():
        raise FieldError("", f"must be positive, got {value.tolist()}")
    return value


@declared
class Ellipsoid:
    """An ellipsoid along the body's axes that encloses a vehicle with its propellers.

    Raises SpecError, naming the field, for semi-axes that are not positive.
    """

    semi_axes: Annotated[Vector3, AfterValidator(_positive)]  # [m] half its length, width and height
    # [m] from the centre of mass; in a file, from where `centre_of_mass` is counted
    centre: Vector3 = field(default_factory=lambda: np.zeros(3))

    def turned(self, q_world_body: Array) -> tuple[Array, Array]:
        """Return where it is and how it lies in attitudes (..., 4).

        Returns:
            Its centre from the centre of mass [m], world, (..., 3), and L, with which its points are its
            centre and L y, |y| ≤ 1 [m], (..., 3, 3).
        """
        return so3.rotate(q_world_body, self.centre), so3.axes(q_world_body) * self.semi_axes

    @property
    def revolved(self) -> Revolved:
        """The body that encloses the ellipsoid however that is turned about its thrust axis."""
        x, y, up = self.centre.tolist()
        return Revolved(float(self.semi_axes[:2].max()), float(self.semi_axes[2]), up, hypot(x, y))

    def sticking_out(self, rotor: Rotor) -> float:
        """The scale [-] by which it would enclose a rotor with its propeller, about its centre."""
        with np.errstate(over="ignore"):  # of an ellipsoid as flat as none, infinite
            return float(np.linalg.norm((_rim(rotor) - self.centre) / self.semi_axes, axis=-1).max())


class Revolved(NamedTuple):
    """An ellipsoid of revolution about the thrust axis, with all that is within `aside` of it."""

    wide: float  # [m] its semi-axis across the thrust axis
    high: float  # [m] along it
    up: float  # [m] its centre along the thrust axis from the centre of mass
    aside: float  # [m]

    @property
    def reach(self) -> float:
        """The farthest that it reaches from the centre of mass, in whichever direction, at most [m]."""
        return max(self.wide, self.high) + abs(self.up) + self.aside

    def turned(self, thrust_axes: Array) -> tuple[Array, Array]:
        """Return its centre from the centre of mass [m] and L [m] for unit thrust axes (..., 3).

        Its points are its centre and L y with |y| ≤ 1, and all within `aside` of these.
        """
        along = thrust_axes[..., :, None] * thrust_axes[..., None, :]
        return self.up * thrust_axes, self.wide * np.eye(3) + (self.high - self.wide) * along


def about_rotors(rotors: Sequence[Rotor]) -> Ellipsoid:
    """The flat ellipsoid that encloses rotors with their propellers, in the middle between them.

    As long to as wide as they are together; its half height is FLATNESS of the larger half width, more by
    what it lies above or below the centre of mass, where the body is.
    """
    rims = np.concatenate([_rim(rotor) for rotor in rotors])
    low, high = rims.min(axis=0), rims.max(axis=0)
    centre, half = (low + high) / 2, (high - low) / 2
    half[2] += FLATNESS * half[:2].max() + abs(centre[2])
    scale = np.linalg.norm((rims - centre) / half, axis=-1).max()
    return Ellipsoid(semi_axes=scale * half, centre=centre)


def _rim(rotor: Rotor) -> Array:
    """Corners of a polygon about a propeller's disc [m], body axes, (corners, 3)."""
    angle = np.linspace(0.0, 2 * pi, _CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_CORNERS)])
    return np.asarray(rotor.position_body + rotor.radius / cos(pi / _CORNERS) * circle)
