"""The least height of a slit is the thickness of the body that passes it, whatever the slit's tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab

QUAD = ab.load_vehicle("agile-quad")
HALL = ab.Limits(lower=np.array([-2.0, -4.0, 0.2]), upper=np.array([10.0, 4.0, 3.8]))


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 45.0, 90.0])
def test_the_least_slit_is_as_high_as_the_body_is_thick(tilt: float) -> None:
    thickness = 2.0 * QUAD.bounding_ellipsoid.semi_axes[2]
    gate = ab.tilted_gate((4.0, 0.0, 1.6), tilt=np.radians(tilt), width=0.7, height=1.6 * thickness)
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((8.0, 0.0, 1.5))
    slit = ab.Problem("slit", *ends, gates=(replace(gate, wall=ab.Wall(border=4.0)),), limits=HALL)
    (found,) = ab.min_requirements(slit, QUAD, of=["gate-height"], tolerance=0.02, workers=1)
    assert found.value * gate.opening.size[1] == pytest.approx(thickness, rel=0.05)
