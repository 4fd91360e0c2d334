"""The attitude of an obstacle by three angles, as files give them."""

from __future__ import annotations

from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import in_degrees, in_radians

ANGLES = ("heading", "elevation", "tilt")
ATTITUDE = {f"{angle}_deg": f"[deg] `{angle}` in degrees" for angle in ANGLES}


def axes_of(heading: float, elevation: float, tilt: float) -> Array:
    """Return an obstacle's own axes in the world, unit vectors as columns, (3, 3).

    Args:
        heading: Of its x axis from the world's x toward y [rad].
        elevation: Climb of its x axis [rad].
        tilt: Roll about its x axis, right-handed [rad].
    """
    x, y, z = np.eye(3)
    climb = so3.multiply(so3.about_axis(y, -elevation), so3.about_axis(x, tilt))
    return so3.axes(so3.multiply(so3.about_axis(z, heading), climb))


def angles_in_radians(table: dict[str, Any]) -> dict[str, Any]:
    """Replace the angles in degrees."""
    for angle in ANGLES:
        table = in_radians(table, angle)
    return table


def angles_in_degrees(table: dict[str, Any]) -> dict[str, Any]:
    """Write the angles in degrees where those say exactly the same."""
    for angle in ANGLES:
        table = in_degrees(table, angle)
    return table
