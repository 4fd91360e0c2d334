"""What a vehicle must be to exist, and what it says of itself."""

import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, vehicle_names

QUAD = load_vehicle("agile-quad")


def changed_rotor(**changes: object) -> Rotor:
    return dataclasses.replace(QUAD.rotors[0], **changes)


def shifted(rotor: Rotor) -> Rotor:
    """The rotor on a vehicle whose centre of mass lies outside its frame."""
    return dataclasses.replace(rotor, position_body=np.add(rotor.position_body, [0.2, 0.0, 0.0]))


@given(st.integers(0, 2**32 - 1), st.integers(4, 12))
def test_every_cloud_of_masses_has_an_inertia_that_is_accepted(seed: int, points: int) -> None:
    rng = np.random.default_rng(seed)
    masses, places = rng.uniform(0.01, 1, points), rng.normal(size=(points, 3))
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, places, strict=True))
    np.testing.assert_array_equal(dataclasses.replace(QUAD, inertia=inertia).inertia, inertia)


@given(st.integers(0, 2**32 - 1))
def test_the_triangle_inequality_is_checked_in_any_axes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    flat = axes @ np.diag([1e-3, 2e-3, 3e-3]) @ axes.T  # a plate: the bound itself
    dataclasses.replace(QUAD, inertia=(flat + flat.T) / 2)
    beyond = flat + 2e-6 * np.outer(axes[:, 2], axes[:, 2])
    with pytest.raises(SpecError, match=r"^Vehicle\.inertia .* exceeds the sum of the others"):
        dataclasses.replace(QUAD, inertia=(beyond + beyond.T) / 2)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": 0}, "mass must be positive"),
        ({"mass": float("nan")}, "mass must be a finite number, got nan"),
        ({"mass": "heavy"}, "mass must be a number, got 'heavy'"),
        ({"mass": [1.0, 2.0]}, "mass must be a number, got a list of 2"),
        ({"name": ""}, "name must be one line"),
        ({"name": "two\nlines"}, "name must be one line"),
        ({"inertia": [1e-3, 1e-3]}, "inertia must be 3 numbers"),
        ({"inertia": np.ones((2, 3, 3))}, "inertia must be 3 x 3"),
        ({"inertia": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}, "inertia must be symmetric"),
        ({"inertia": np.diag([1, 1, -1])}, "inertia must be positive definite"),
        ({"inertia": np.zeros((3, 3))}, "inertia must be positive definite"),
        ({"inertia": np.diag([1, 1, np.inf])}, r"inertia\[2\]\[2\] must be a finite number"),
        ({"drag_body": [0.1, -0.1, 0.1]}, "drag_body must not be negative"),
        ({"rotors": QUAD.rotors[:3]}, "rotors must be 4 or more, got 3"),
        ({"rotors": (*QUAD.rotors[:3], "rotor")}, r"rotors\[3\] must be a Rotor"),
        ({"rotors": QUAD.rotors[:1] * 4}, "rotors must give .* cannot roll or pitch"),
        ({"rotors": [dataclasses.replace(r, spin=1) for r in QUAD.rotors]}, "rotors must give .* spin alike"),
        ({"rotors": [shifted(rotor) for rotor in QUAD.rotors]}, "rotors cannot hold a level hover"),
    ],
)
def test_what_cannot_be_a_vehicle_is_refused_by_the_field(changes: dict, message: str) -> None:
    with pytest.raises(SpecError, match=rf"^Vehicle\.{message}"):
        dataclasses.replace(QUAD, **changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position_body": [0.1, 0.1]}, "position_body must be 3 numbers"),
        ({"position_body": [0.1, 0.1, np.inf]}, r"position_body\[2\] must be a finite number"),
        ({"spin": 0}, "spin must be 1 or -1, got "),
        ({"spin": "left"}, "spin must be 1 or -1, got "),
        ({"min_thrust": 6.8792625}, "min_thrust must be below max_thrust"),
        ({"min_thrust": -2, "max_thrust": -1}, "max_thrust must be 0 or more"),
        ({"min_thrust": -2, "max_thrust": 0}, "min_thrust must be 0 where max_thrust is"),
        ({"max_thrust": np.inf}, "max_thrust must be a finite number"),
        ({"torque_coefficient": -0.05}, "torque_coefficient must be 0 or more"),
        ({"lag": -0.02}, "lag must be 0 or more"),
        ({"radius": 0}, "radius must be positive"),
    ],
)
def test_what_cannot_be_a_rotor_is_refused_by_the_field(changes: dict, message: str) -> None:
    with pytest.raises(SpecError, match=rf"^Rotor\.{message}"):
        changed_rotor(**changes)


@pytest.mark.parametrize("name", vehicle_names())
def test_nothing_in_a_vehicle_can_be_written_to(name: str) -> None:
    vehicle = load_vehicle(name)
    arrays = (
        vehicle.inertia,
        vehicle.drag_body,
        vehicle.allocation,
        vehicle.min_thrusts,
        vehicle.max_thrusts,
    )
    for array in (*arrays, vehicle.lags, *(rotor.position_body for rotor in vehicle.rotors)):
        with pytest.raises(ValueError, match="read-only"):
            array += 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        vehicle.mass = 2.0


def test_a_vehicle_is_copied_from_what_it_is_made_of() -> None:
    inertia = np.diag([1e-3, 1e-3, 1.7e-3])
    vehicle = dataclasses.replace(QUAD, inertia=inertia)
    inertia[0, 0] = 5.0
    assert vehicle.inertia[0, 0] == 1e-3


def test_a_vehicle_survives_pickling() -> None:
    twin = pickle.loads(pickle.dumps(QUAD))
    np.testing.assert_array_equal(twin.allocation, QUAD.allocation)
    assert str(twin) == str(QUAD)


def test_a_vehicle_says_what_it_is_in_one_line() -> None:
    text = str(load_vehicle("hexarotor"))
    assert "\n" not in text
    for fact in (
        "hexarotor: 1 kg",
        "6 rotors",
        "thrust-to-weight 5.00",
        "(0.008, 0.008, 0.014) kg·m²",
        "paper",
    ):
        assert fact in text
    assert str(Vehicle("bare", 0.85, QUAD.inertia, QUAD.rotors)).endswith("kg·m²")


def test_thrust_to_weight_is_full_thrust_over_weight_on_earth() -> None:
    assert QUAD.thrust_to_weight == pytest.approx(4 * 6.8792625 / (0.85 * 9.81))
    assert QUAD.max_specific_thrust == pytest.approx(3.3 * 9.81)


def test_a_vehicle_too_heavy_for_earth_may_hover_on_the_moon() -> None:
    heavy = dataclasses.replace(QUAD, mass=2.806)
    heavy.require_hover(1.62)
    with pytest.raises(SpecError, match=r"^rotors cannot lift agile-quad"):
        heavy.require_hover(9.81)
    weak = dataclasses.replace(QUAD, rotors=(changed_rotor(max_thrust=2.0), *QUAD.rotors[1:]))
    weak.require_hover(1.62)
    with pytest.raises(SpecError, match=r"^rotors cannot hold a level hover"):
        weak.require_hover(9.81)
