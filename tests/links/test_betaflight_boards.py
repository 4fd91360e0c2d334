"""Boards that are flown live: frames of channels by two protocols, and maneuvers on demand by rates alone."""

from __future__ import annotations

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.cli.commands.ros import ros
from aerobat.cli.link_options import RosOptions
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.links.betaflight.board import Board, SerialLine, board_at
from aerobat.links.betaflight.crsf import CRSF, channels_frame, crc8
from aerobat.links.betaflight.msp import MSP, SET_RAW_RC
from aerobat.links.betaflight.packets import ReceiverProtocol, Sticks
from aerobat.links.betaflight.settings import board_rate
from aerobat.links.commander import Doing
from bench import Bench, FirmwareLoop, ModelledLoop
from refusals import complaint
from suites import examples

QUAD = ab.load_vehicle("agile-quad")
COUNT = st.integers(0, 2047)


def unpacked(frame: bytes) -> list[int]:
    """The channels of a CRSF frame, bit by bit as its specification lays them out."""
    bits = [frame[3 + k // 8] >> k % 8 & 1 for k in range(176)]
    return [sum(bit << k for k, bit in enumerate(bits[11 * n : 11 * n + 11])) for n in range(16)]


@examples(40)
@given(st.lists(COUNT, min_size=16, max_size=16))
def test_a_frame_of_crsf_holds_its_channels_and_its_checksum(counts: list[int]) -> None:
    frame = channels_frame(counts)
    assert frame[:3] == b"\xc8\x18\x16"
    assert len(frame) == 26
    assert unpacked(frame) == counts
    assert crc8(frame[2:]) == 0  # of a message with its own behind it


def test_the_checksum_is_that_of_dvb_s2() -> None:
    assert crc8(b"123456789") == 0xBC  # the check value of the catalogue of CRC algorithms


def test_crsf_counts_are_the_pulses_of_its_specification() -> None:
    assert [CRSF.count(pulse) for pulse in (988.5, 1500.5, 2012.5)] == [172, 992, 1811]


def test_the_channels_of_msp_are_sixteen_words() -> None:
    frame = Sticks(20.0, MSP).idle(armed=True)
    assert frame[:5] == b"$M<" + bytes([32, SET_RAW_RC])
    assert np.frombuffer(frame[5:-1], "<u2").tolist()[:5] == [1500, 1500, 1000, 1500, 1900]


@examples(40)
@given(st.floats(-20.0, 20.0), st.floats(0.0, 1.0))
def test_finer_channels_say_on_average_what_is_asked(rate: float, throttle: float) -> None:
    sticks = Sticks(20.0, CRSF)
    sent = np.mean([unpacked(sticks.packet((rate, 0.0, 0.0), throttle))[:3] for _ in range(200)], axis=0)
    roll, _, thrust = CRSF.offset + CRSF.step * sent
    assert (roll - 1500.0) * 20.0 / 500.0 == pytest.approx(rate, abs=0.01 * 20.0 / 500.0)
    assert (thrust - 1050.0) / 950.0 == pytest.approx(throttle, abs=1e-4)


def test_lines_that_cannot_be_had_are_refused_in_a_sentence() -> None:
    for address in ("/dev/none", "socket://127.0.0.1:1", "socket://nowhere"):
        assert f"cannot open {address}" in complaint(lambda at=address: SerialLine(at, 115200))


def test_other_goals_name_no_board() -> None:
    assert board_at("/aerobat/goal", QUAD, ab.Environment(), 0.01) is None


def test_a_vehicle_that_no_board_flies_is_refused_before_ros_is_joined() -> None:
    options = RosOptions(goal="msp:loop://", vehicle="hexarotor")
    assert "quadrotors in X" in complaint(lambda: ros(options=options))


class Wire:
    """A line that keeps the channels of its last frame [µs]."""

    def __init__(self, protocol: ReceiverProtocol) -> None:
        self.protocol = protocol
        self.frames = [Sticks(20.0, protocol).idle(armed=False)]

    def send(self, frame: bytes) -> None:
        self.frames.append(frame)

    def close(self) -> None:
        pass

    @property
    def pulses(self) -> list[float]:
        words = (
            np.frombuffer(self.frames[-1][5:-1], "<u2") if self.protocol is MSP else unpacked(self.frames[-1])
        )
        return [self.protocol.offset + self.protocol.step * count for count in words]


def board(wire: Any) -> Board:
    """Of our quadrotor, whose goals come 250 times a second."""
    return Board(wire, wire.protocol, QUAD, ab.Environment(), 0.004)


def test_before_it_is_seen_a_board_is_told_to_stand() -> None:
    wire = Wire(MSP)
    board(wire).take(None, None, 0.0)
    assert wire.pulses[:5] == [1500.0, 1500.0, 1000.0, 1500.0, 1000.0]


def heard(wire: Wire) -> tuple[bool, RateSetpoint]:
    """What a board makes of its channels."""
    roll, pitch, throttle, yaw, switch = wire.pulses[:5]
    rates = tuple(board_rate(QUAD) * (pulse - 1500.0) / 500.0 for pulse in (roll, pitch, 3000.0 - yaw))
    low, high = QUAD.min_thrusts.sum(), QUAD.max_thrusts.sum()
    return switch > 1700.0, RateSetpoint(rates, low + (high - low) * max(throttle - 1050.0, 0.0) / 950.0)


def flown(wire: Any, inner: Any, maneuver: str = "flip-roll") -> Bench:
    """A maneuver from the ground to the ground."""
    bench = Bench(QUAD, board(wire), inner, maneuver)
    bench.run_for(6.0)  # which Betaflight takes to boot
    assert bench.call("takeoff").success
    bench.run_until(Doing.HOVERING)
    bench.run_for(1.0)
    answer = bench.call("maneuver")
    assert answer.success, answer.sentence
    bench.run_until(Doing.HOVERING)
    bench.run_for(1.0)
    assert bench.call("land").success
    bench.run_until(Doing.NOTHING)
    bench.run_for(0.5)
    assert bench.motion.body.position[2] == 0.0
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("protocol", [MSP, CRSF], ids=["msp", "crsf"])
def test_a_flip_on_demand_is_flown_by_rates_and_thrust_alone(protocol: ReceiverProtocol) -> None:
    wire = Wire(protocol)
    bench = flown(wire, ModelledLoop(QUAD, lambda: heard(wire)))
    assert bench.node.commander.mission.reason == ""
    assert any("through gate" in sentence for sentence in bench.said), bench.said
    assert not heard(wire)[0]


@pytest.mark.betaflight
def test_a_flip_on_demand_is_flown_by_betaflights_firmware_over_tcp() -> None:
    """Its receiver is MSP_SET_RAW_RC on its serial line, and arms, flies and disarms by that alone."""
    with closing(FirmwareLoop(QUAD)) as loop:
        bench = flown(loop, loop)
        assert bench.node.commander.mission.reason == ""
        assert any("through gate" in sentence for sentence in bench.said), bench.said
        motors = loop.firmware.step(0.1)
    assert not any(motors)


@pytest.mark.slow
def test_a_board_whose_vehicle_is_lost_from_sight_gets_no_more_channels() -> None:
    """So that its own failsafe does what it is set to; on the ground it is disarmed."""
    wire = Wire(MSP)
    bench = Bench(QUAD, board(wire), ModelledLoop(QUAD, lambda: heard(wire)), "line")
    bench.run_for(0.1)
    assert bench.call("takeoff").success
    bench.run(lambda: bench.motion.body.position[2] > 1.0)
    bench.sees = False
    bench.run_until(Doing.NOTHING)
    sent = len(wire.frames)
    bench.run_for(0.2)
    assert len(wire.frames) == sent
    assert "left to itself" in bench.said[-1]
