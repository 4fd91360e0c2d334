"""The ellipsoid that encloses a vehicle with its propellers: the body that passes through a gate.

The body is an ellipsoid and not a box for three reasons. The section of an ellipsoid by a plane, and the
extent of this section, are known in closed form. A box about round propellers would touch frames with empty
corners, in whichever yaw a flip happens to have. An ellipsoid is cheap to evaluate at every tick.
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

# [-] half the height over half the width: Bitcraze's Crazyflie 2.x has 29 mm of 139 mm, the Iris of PX4's
# models 11 cm of 77 cm
FLATNESS = 0.2
ENCLOSING_TOLERANCE = 1e-3  # [-] relative to the semi-axes, of enclosed propellers: the rounding of files
_CORNERS = 96  # of the polygon about a propeller's disc, which is 0.05 % of the radius too large


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
        """Return the ellipsoid's centre and shape in attitudes (..., 4).

        Returns:
            The centre from the centre of mass [m], world, (..., 3), and L [m], (..., 3, 3): the ellipsoid's
            points are the centre plus L y with |y| ≤ 1.
        """
        return so3.rotate(q_world_body, self.centre), so3.axes(q_world_body) * self.semi_axes

    @property
    def revolved(self) -> Revolved:
        """The body of revolution that encloses the ellipsoid in every yaw about its thrust axis."""
        x, y, up = self.centre.tolist()
        return Revolved(float(self.semi_axes[:2].max()), float(self.semi_axes[2]), up, hypot(x, y))

    def enclosing_scale(self, rotor: Rotor) -> float:
        """Return the factor [-] on the semi-axes with which the ellipsoid encloses a rotor's propeller."""
        with np.errstate(over="ignore"):  # infinite for a flat ellipsoid
            return float(np.linalg.norm((_rim(rotor) - self.centre) / self.semi_axes, axis=-1).max())


class Revolved(NamedTuple):
    """An ellipsoid of revolution about the thrust axis, enlarged by a distance `aside` in all directions."""

    wide: float  # [m] semi-axis across the thrust axis
    high: float  # [m] semi-axis along the thrust axis
    up: float  # [m] centre along the thrust axis, from the centre of mass
    aside: float  # [m] distance by which the ellipsoid is enlarged

    @property
    def reach(self) -> float:
        """An upper bound of the body's extent from the centre of mass in any direction [m]."""
        return max(self.wide, self.high) + abs(self.up) + self.aside

    def turned(self, thrust_axes: Array) -> tuple[Array, Array]:
        """Return the centre from the centre of mass [m] and L [m] for unit thrust axes (..., 3).

        The body's points are within `aside` of the centre plus L y with |y| ≤ 1.
        """
        along = thrust_axes[..., :, None] * thrust_axes[..., None, :]
        return self.up * thrust_axes, self.wide * np.eye(3) + (self.high - self.wide) * along


def about_rotors(rotors: Sequence[Rotor]) -> Ellipsoid:
    """Return the flat ellipsoid that encloses rotors with their propellers, centred between them.

    Its length and width have the ratio of the rotors' extents. Its half height is FLATNESS of the larger half
    width, plus the height offset between rotors and centre of mass, where the body is.
    """
    rims = np.concatenate([_rim(rotor) for rotor in rotors])
    low, high = rims.min(axis=0), rims.max(axis=0)
    centre, half = (low + high) / 2, (high - low) / 2
    half[2] += FLATNESS * half[:2].max() + abs(centre[2])
    scale = np.linalg.norm((rims - centre) / half, axis=-1).max()
    return Ellipsoid(semi_axes=scale * half, centre=centre)


def _rim(rotor: Rotor) -> Array:
    """Return corners of a polygon about a propeller's disc [m], body axes, (corners, 3)."""
    angle = np.linspace(0.0, 2 * pi, _CORNERS, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_CORNERS)])
    return np.asarray(rotor.position_body + rotor.radius / cos(pi / _CORNERS) * circle)
