"""Gates: poses that people type and poses that the programs use are the same."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.problem import Gate, tilted_gate

angle = st.floats(-np.pi, np.pi)
steep = st.floats(-1.5, 1.5)


@given(angle, steep, angle)
def test_a_gate_gives_back_the_angles_that_made_it(heading: float, elevation: float, tilt: float) -> None:
    gate = tilted_gate(np.array([1.0, 2.0, 3.0]), heading, elevation, tilt)
    again = tilted_gate(gate.position, *gate.angles)
    np.testing.assert_allclose(again.normal, gate.normal, atol=1e-9)
    np.testing.assert_allclose(again.up, gate.up, atol=1e-9)


@given(angle, steep, angle)
def test_the_opening_is_a_rectangle_of_its_size_across_the_passage(
    heading: float, elevation: float, tilt: float
) -> None:
    gate = tilted_gate(np.zeros(3), heading, elevation, tilt, width=1.2, height=0.5)
    corners = gate.outline
    sides = np.linalg.norm(np.diff(np.vstack([corners, corners[:1]]), axis=0), axis=1)
    np.testing.assert_allclose(sides, [1.2, 0.5, 1.2, 0.5])
    np.testing.assert_allclose((corners - gate.position) @ gate.normal, 0.0, atol=1e-12)


def test_the_papers_gate_at_90_degrees_asks_thrust_sideways() -> None:
    gate = tilted_gate(np.zeros(3), tilt=np.pi / 2)
    np.testing.assert_array_equal(gate.normal, [1.0, 0.0, 0.0])
    np.testing.assert_array_equal(gate.up, [0.0, -1.0, 0.0])


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"normal": (0, 0, 0)}, "Gate.normal"),
        ({"up": (1, 0, 0)}, "Gate.up"),
        ({"width": 0.0}, "Gate.width"),
        ({"height": np.nan}, "Gate.height"),
        ({"position": (0, np.nan, 0)}, "Gate.position"),
        ({"position": (0, 0)}, "Gate.position"),
    ],
)
def test_a_gate_that_cannot_be_is_refused_by_the_field_at_fault(changes: dict, field: str) -> None:
    with pytest.raises(SpecError, match=field):
        Gate(**({"position": (0, 0, 0), "normal": (1, 0, 0), "up": (0, 0, 1)} | changes))
