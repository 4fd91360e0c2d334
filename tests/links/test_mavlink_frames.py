"""MAVLink's axes, units and modes against ours: laws, and what a level vehicle that heads north says."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.links.goals import Mode
from aerobat.links.mavlink.autopilot_link import _of_position
from aerobat.links.mavlink.connection import dialect
from aerobat.links.mavlink.dialects import ARDUPILOT, PX4, dialect_of
from aerobat.links.mavlink.frames import (
    from_global,
    swap_attitude,
    swap_body,
    swap_world,
    swap_yaw,
    to_global,
)

NUMBERS = st.floats(-50.0, 50.0)
VECTORS = st.tuples(NUMBERS, NUMBERS, NUMBERS)
QUATERNIONS = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: tuple(so3.normalize(np.array(q)).tolist()))
)


@given(QUATERNIONS, VECTORS)
def test_turning_and_changing_frames_commute(q: tuple[float, ...], vector: tuple[float, ...]) -> None:
    """A body vector taken to the world in ENU and FLU is the one taken there in NED and FRD."""
    ours = so3.rotate(np.array(q), np.array(vector))
    theirs = so3.rotate(np.array(swap_attitude(q)), np.array(swap_body(vector)))
    np.testing.assert_allclose(swap_world(tuple(ours)), theirs, atol=1e-12 * 100)


@given(QUATERNIONS, VECTORS, st.floats(-3.1, 3.1))
def test_every_change_of_frames_is_its_own_inverse(
    q: tuple[float, ...], v: tuple[float, ...], yaw: float
) -> None:
    assert swap_world(swap_world(v)) == v
    assert swap_body(swap_body(v)) == v
    assert swap_yaw(swap_yaw(yaw)) == pytest.approx(yaw, abs=1e-12)
    back = np.array(swap_attitude(swap_attitude(q)))
    assert abs(back @ np.array(q)) == pytest.approx(1.0, abs=1e-12)


def test_level_and_north_is_mavlinks_identity() -> None:
    north = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))
    np.testing.assert_allclose(swap_attitude(north), [1.0, 0.0, 0.0, 0.0], atol=1e-15)
    assert swap_yaw(pi / 2) == pytest.approx(0.0)
    assert swap_yaw(0.0) == pytest.approx(pi / 2)  # east
    assert swap_world((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)


@given(VECTORS)
def test_places_come_back_from_latitude_and_longitude_within_their_digits(place: tuple[float, ...]) -> None:
    np.testing.assert_allclose(from_global(*to_global(place)), place, atol=0.01)


def test_modes_are_px4s_numbers() -> None:
    assert PX4.custom_mode(Mode.OFFBOARD) == 6 << 16
    assert PX4.custom_mode(Mode.HOLD) == 4 << 16 | 3 << 24
    assert [PX4.mode_of(PX4.custom_mode(mode)) for mode in Mode] == list(Mode)
    assert PX4.mode_of(1 << 16) is None  # manual


def test_modes_are_copters_numbers_as_pymavlink_has_them() -> None:
    from pymavlink.mavutil import mode_mapping_acm

    names = {Mode.HOLD: "BRAKE", Mode.LAND: "LAND", Mode.OFFBOARD: "GUIDED"}
    assert {mode: mode_mapping_acm[ARDUPILOT.custom_mode(mode)] for mode in ARDUPILOT.modes} == names
    assert ARDUPILOT.mode_of(6) is None  # RTL
    assert (dialect_of(3), dialect_of(12), dialect_of(0)) == (ARDUPILOT, PX4, PX4)


@given(QUATERNIONS, st.tuples(*[st.floats(-20.0, 20.0)] * 3), st.integers(-50, 50))
def test_an_attitude_of_another_instant_turns_on_to_that_of_the_position(
    q: tuple[float, ...], rates: tuple[float, ...], apart: int
) -> None:
    make = dialect()
    turned = so3.multiply(np.array(q), so3.exp(1e-3 * apart * np.array(rates)))
    told = make.MAVLink_attitude_quaternion_message(1000, *swap_attitude(q), *swap_body(rates))
    place = make.MAVLink_local_position_ned_message(1000 + apart, 1.0, 2.0, -3.0, 0.1, 0.2, 0.3)
    seen = _of_position(place, told, 1e-3 * apart, 0.5)
    assert seen is not None
    assert seen.time == pytest.approx(0.5 + 1e-3 * apart)
    assert abs(turned @ np.array(seen.body.q_world_body)) == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(seen.body.position, (2.0, 1.0, 3.0))
    np.testing.assert_allclose(seen.body.velocity, (0.2, 0.1, -0.3), atol=1e-12)
