"""The attitude of an obstacle by three angles, as files give them."""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array

ATTITUDE = {f"{angle}_deg": f"[deg] `{angle}` in degrees" for angle in ("heading", "elevation", "tilt")}


def axes_of(heading: float, elevation: float, tilt: float) -> Array:
    """Return an obstacle's own axes in the world, unit vectors as columns, (3, 3).

    Args:
        heading: Angle of its x axis from the world's x towards y [rad].
        elevation: Climb of its x axis [rad].
        tilt: Roll about its x axis, right-handed [rad].
    """
    x, y, z = np.eye(3)
    climb = so3.multiply(so3.about_axis(y, -elevation), so3.about_axis(x, tilt))
    return so3.axes(so3.multiply(so3.about_axis(z, heading), climb))
