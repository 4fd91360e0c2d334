"""The least height of a slit is the thickness of the body that passes it, whatever the slit's tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat.studies.feasibility.quantities import QUANTITIES
from aerobat.studies.lens import Scenario

QUAD = ab.load_vehicle("agile-quad")
HALL = ab.Limits(lower=np.array([-2.0, -4.0, 0.2]), upper=np.array([10.0, 4.0, 3.8]))
THICKNESS = 2.0 * QUAD.bounding_ellipsoid.semi_axes[2]


def slit(tilt: float, height: float) -> ab.Problem:
    """Eight metres through a slit in a wall, tilted by degrees, of a height [m]."""
    gate = ab.tilted_gate((4.0, 0.0, 1.6), tilt=np.radians(tilt), width=0.7, height=height)
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((8.0, 0.0, 1.5))
    return ab.Problem("slit", *ends, gates=(replace(gate, wall=ab.Wall(border=4.0)),), limits=HALL)


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [0.0, 45.0, 90.0])
def test_a_slit_hardly_higher_than_the_body_is_thick_is_passed(tilt: float) -> None:
    plan = ab.plan(slit(tilt, 1.05 * THICKNESS), vehicle=QUAD)
    assert plan.certified
    assert plan.flies


@pytest.mark.parametrize("tilt", [0.0, 45.0, 90.0])
def test_a_slit_lower_than_the_body_is_thick_is_refused_at_sight(tilt: float) -> None:
    with pytest.raises(ab.SpecError, match="even edgewise"):
        ab.plan(slit(tilt, 0.99 * THICKNESS), vehicle=QUAD)


def test_a_need_of_a_gates_height_leaves_its_width() -> None:
    lower = QUANTITIES["gate-height"].set(Scenario(slit(30.0, 0.2), QUAD, None, None), 0.5)
    assert lower.problem.gates[0].opening.size == pytest.approx([0.7, 0.1])
