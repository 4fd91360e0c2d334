"""Plans flown over MAVLink: through the gate over a poor link, and given up without a fall."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.errors import SpecError
from aerobat.links.goals import Mode
from aerobat.links.mavlink.client import ClientSettings, ClientStage
from aerobat.links.mavlink.connection import dialect
from aerobat.links.mavlink.dialects import ARDUPILOT, DIALECTS
from aerobat.links.mission import MissionSettings, Phase, require_flyable
from mavlink_sky import ORIGIN, Sky, flip, over_a_link


def test_the_phases_follow_each_other_and_are_told() -> None:
    sky = over_a_link(phase=Phase.SETTLE)
    sky.run(lambda: sky.client.mission.phase is Phase.MANEUVER)
    expected = ["armed", "going to the plan's start", "coming to rest there", "flying the plan"]
    assert sky.said[1:5] == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize(("loss", "delay", "bound"), [(0.01, 0.02, 0.04), (0.05, 0.03, 0.12)])
def test_a_flip_goes_through_its_gate_over_a_link_that_loses_and_delays(
    loss: float, delay: float, bound: float, name: str
) -> None:
    """And what the client reports, from what it heard, is what happened."""
    sky = over_a_link(loss, delay, name=name)
    sky.run(lambda: sky.client.done)
    report = sky.client.report()
    assert report.is_success, str(report)
    assert max(sky.errors) < bound
    assert report.max_position_error_m == pytest.approx(max(sky.errors), abs=0.02)  # 2 ms of clocks
    assert report.delay_s == pytest.approx(delay, abs=0.006)
    (gate,) = report.passages
    assert gate.miss < bound
    assert gate.attitude_error_deg < 5.0
    assert sky.vehicle.landed
    assert not sky.vehicle.armed
    np.testing.assert_allclose(sky.position[:2], 0.0, atol=0.1)


@pytest.mark.parametrize("name", DIALECTS)
@pytest.mark.parametrize("instant", [1.06, *(pytest.param(t, marks=pytest.mark.slow) for t in (0.3, 1.7))])
def test_a_client_killed_at_any_instant_of_the_flip_leaves_a_hover(instant: float, name: str) -> None:
    sky = over_a_link(name=name)
    sky.run_into_the_plan(instant)
    sky.client_lives = False
    sky.run_for(6.0)
    assert sky.hovers
    assert sky.vehicle.mode is Mode.HOLD
    expected = ab.recoveries(flip(), times=[instant], ground=-ORIGIN[2]).lowest[0] + ORIGIN[2]
    assert min(sky.heights) > min(expected, ORIGIN[2]) - 0.3  # what was announced
    assert min(sky.heights) > 0.5
    assert abs(sky.vehicle.state.q_world_body[0]) == pytest.approx(1.0, abs=1e-3)


def test_without_news_of_the_vehicle_the_plan_is_given_up() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(1.1)
    sky.cable.receives = False
    sky.run(lambda: sky.client.stage is ClientStage.RECOVERING)
    assert sky.since_begin < 2.0
    assert "no news of the vehicle" in sky.client.report().aborted


def setpoint_numbers(sky: Sky) -> list[float]:
    """All numbers of the set-points sent, but the yaw rate, which is NaN where a point's yaw counts."""
    setpoints = [message for message in sky.cable.sent if message.get_type().startswith("SET_")]
    names = {name for message in setpoints for name in message.fieldnames} - {"yaw_rate"}
    return np.hstack([getattr(each, name, 0.0) for each in setpoints for name in names]).tolist()


@pytest.mark.parametrize(
    ("field", "value"),
    [("x", nan), ("vy", inf), ("rollspeed", nan), ("z", 1e30), ("q", [nan] * 4), ("q", [0.0] * 4)],
)
@pytest.mark.parametrize("phase", [Phase.SETTLE, Phase.MANEUVER])
def test_states_that_are_none_are_left_out_and_their_silence_ends_the_flight(
    phase: Phase, field: str, value: float | list[float]
) -> None:
    """Nothing that is not finite is sent, and a vehicle that is not seen is not at rest at the start."""
    sky = over_a_link(phase=phase)

    def change(message: Any) -> list[Any]:
        if message.get_type() == "ODOMETRY":
            setattr(message, field, value)
        return [message]

    sky.cable.change = change
    sky.run(lambda: sky.client.stage is ClientStage.RECOVERING, limit=1.5)
    assert "no news of the vehicle" in sky.client.report().aborted
    assert any("states are left out that are not finite" in sentence for sentence in sky.said)
    assert np.isfinite(setpoint_numbers(sky)).all()


def test_states_that_come_twice_late_or_from_the_future_change_nothing() -> None:
    """The log stays in order of time, and the report is that of a good flight."""
    sky = over_a_link()
    kept: list[Any] = []

    def change(message: Any) -> list[Any]:
        if message.get_type() != "ODOMETRY":
            return [message]
        kept.append(message)
        ahead = copy(message)
        ahead.time_usec += 10**12
        return [message, ahead, message, kept[-20:][0]]

    sky.cable.change = change
    sky.run(lambda: sky.client.mission.phase is Phase.HOLD)
    assert (np.diff([seen.time for seen in sky.client.mission.log]) > 0.0).all()
    report = sky.client.report()
    assert not report.failures, str(report)
    assert report.max_position_error_m == pytest.approx(max(sky.errors), abs=0.02)


def test_a_state_from_the_future_leaves_the_watch_for_silence_on() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.5)

    def change(message: Any) -> list[Any]:
        if message.get_type() == "ODOMETRY":
            message.time_usec += 10**12
        return [message]

    sky.cable.change = change
    sky.run(lambda: sky.client.stage is ClientStage.RECOVERING, limit=0.5)
    assert "no news of the vehicle" in sky.client.report().aborted


@pytest.mark.parametrize("ahead", [0.1, 1000.0])
def test_answers_that_another_client_asked_for_tell_nothing_of_the_time(ahead: float) -> None:
    """Its clock is ahead of ours by so long [s]; a round trip that is negative would be the shortest."""
    sky = over_a_link(phase=Phase.SETTLE)

    def change(message: Any) -> list[Any]:
        if message.get_type() != "TIMESYNC":
            return [message]
        foreign = copy(message)
        foreign.ts1 = round(1e9 * (sky.clock.now() - 0.04 + ahead))
        return [foreign, message]

    sky.cable.change = change
    sky.run(lambda: sky.client.mission.phase is Phase.HOLD, limit=8.0)
    report = sky.client.report()
    assert not report.failures, str(report)
    assert report.delay_s == pytest.approx(0.02, abs=0.006)


@pytest.mark.slow
@pytest.mark.parametrize("cut", ["receives", "sends", "both"])
def test_a_link_that_is_cut_in_mid_flip_gives_it_up_and_lands_once_it_is_back(cut: str) -> None:
    sky = over_a_link()
    sky.run_into_the_plan(1.1)
    for way in ("receives", "sends") if cut == "both" else (cut,):
        setattr(sky.cable, way, False)
    sky.run_for(2.0)
    assert sky.client.stage is ClientStage.RECOVERING
    sky.cable.receives = sky.cable.sends = True
    sky.run(lambda: sky.client.done)
    assert sky.client.stage is ClientStage.LANDED
    assert not sky.vehicle.crashed
    report = sky.client.report()
    assert not report.is_success
    expected = "the vehicle went into the mode hold" if cut == "sends" else "no news of the vehicle"
    assert expected in report.aborted


@pytest.mark.slow
def test_a_link_that_stays_cut_is_left_to_the_vehicles_own_failsafe() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.9)
    sky.cable.receives = sky.cable.sends = False
    sky.run(lambda: sky.client.done)
    assert sky.client.stage is ClientStage.LOST
    assert sky.hovers
    assert "failsafe" in sky.said[-1]


@pytest.mark.slow
def test_a_set_point_that_is_late_gives_the_plan_up() -> None:
    """Earlier than the vehicle would by itself."""
    sky = over_a_link(settings=MissionSettings(max_lateness=0.05))
    sky.run_into_the_plan(1.2)
    sky.client_lives = False
    sky.run_for(0.08)
    sky.client_lives = True
    sky.run(lambda: sky.client.done)
    assert sky.client.report().aborted == "a set-point was 0.08 s late"
    assert sky.client.stage is ClientStage.LANDED
    assert not sky.vehicle.crashed


def test_an_error_over_its_bound_is_told_and_the_vehicle_brought_to_rest() -> None:
    sky = over_a_link(settings=MissionSettings(max_error=0.005))
    sky.run(lambda: sky.client.mission.phase is not Phase.MANEUVER)
    assert "off its path" in sky.client.report().aborted
    assert sky.client.stage is ClientStage.RECOVERING


@pytest.mark.slow
def test_an_error_over_its_bound_gives_the_plan_up() -> None:
    """Of a vehicle with a drag that its plan knows nothing of."""
    own = flip().vehicle
    assert own is not None
    sky = Sky(vehicle=replace(own, drag_body=np.full(3, 0.8)), mission=MissionSettings(max_error=0.1))
    sky.run(lambda: sky.client.done)
    assert "off its path" in sky.client.report().aborted
    assert sky.client.stage is ClientStage.LANDED
    assert not sky.vehicle.crashed


def test_a_pilot_who_takes_over_as_a_copter_takes_off_is_not_interfered_with() -> None:
    sky = Sky(speaks=ARDUPILOT)
    sky.run(lambda: sky.client.stage is ClientStage.TAKING_OFF)
    sky.cable.change = changing("HEARTBEAT", custom_mode=0)  # STABILIZE
    sky.run(lambda: sky.client.stage is ClientStage.LOST, limit=1.0)
    assert sky.said[-1] == "a pilot has taken over; it is left to the pilot"


@pytest.mark.parametrize(("name", "pilots"), [("px4", 1 << 16), ("ardupilot", 0), ("ardupilot", 6)])
def test_a_pilot_who_takes_over_is_not_interfered_with(name: str, pilots: int) -> None:
    """A heartbeat with a mode that is none of ours: from then on nothing is sent that moves the vehicle."""
    sky = over_a_link(name=name)
    sky.run_into_the_plan(0.05)
    sky.front_end._heartbeat = lambda: None  # type: ignore[method-assign]
    beat = dialect().MAVLink_heartbeat_message(2, 12, 129, pilots, 4, 3)
    sent: list[str] = []
    sky.client.link._take_heartbeat(beat)
    sky.cable.send = lambda message: sent.append(message.get_type())  # type: ignore[method-assign]
    sky.client.tick(sky.clock.now() + 0.001)
    assert sky.client.stage is ClientStage.LOST
    assert not {"COMMAND_LONG", "SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"} & set(sent)


def test_a_plan_for_another_vehicle_is_refused_before_anything_is_armed() -> None:
    sky = Sky(vehicle=ab.load_vehicle("crazyflie"))
    with pytest.raises(SpecError, match=r"hovers at .* another vehicle"):
        sky.run(lambda: sky.client.done)
    assert not sky.vehicle.armed


def test_a_vehicle_that_says_not_where_it_hovers_is_asked_of_the_user() -> None:
    sky = Sky(settings=ClientSettings(wait=2.0))
    del sky.front_end.parameters["MPC_THR_HOVER"]
    with pytest.raises(SpecError, match=r"MPC_THR_HOVER .* give --hover-thrust"):
        sky.run(lambda: sky.client.done)
    told = Sky(settings=ClientSettings(hover_thrust=1.0 / 3.3))
    del told.front_end.parameters["MPC_THR_HOVER"]
    told.run(lambda: told.client.stage is ClientStage.FLYING)


def with_a_second_system(sky: Sky) -> Sky:
    """A flight beside another system's autopilot, number 7, disarmed, whose heartbeats come first."""

    def change(message: Any) -> list[Any]:
        if message.get_type() != "HEARTBEAT":
            return [message]
        foreign = dialect().MAVLink_heartbeat_message(2, 12, 81, 1 << 16, 3, 3)
        foreign._header = replace_system(message._header, 7)
        return [foreign, message]

    sky.cable.change = change
    return sky


def replace_system(header: Any, system: int) -> Any:
    """A message's header as another system would send it."""
    changed = copy(header)
    changed.srcSystem = system
    return changed


def test_of_two_systems_none_is_flown_unless_it_is_named() -> None:
    sky = with_a_second_system(Sky())
    with pytest.raises(SpecError, match=r"^the systems 1 and 7 answer; name the vehicle's by --system$"):
        sky.run(lambda: sky.client.done)
    assert not sky.vehicle.armed
    named = with_a_second_system(Sky(settings=ClientSettings(system=1)))
    named.run(lambda: named.client.mission.phase is Phase.APPROACH)
    absent = with_a_second_system(Sky(settings=ClientSettings(system=2, wait=2.0)))
    with pytest.raises(SpecError, match=r"^system 2 does not answer within 2 s; those heard are: 1, 7$"):
        absent.run(lambda: absent.client.done)


def test_a_second_system_that_comes_in_flight_is_not_listened_to() -> None:
    sky = with_a_second_system(over_a_link())
    sky.run(lambda: sky.client.mission.phase is Phase.HOLD)
    assert not sky.client.report().failures


def changing(kind: str, **fields: Any) -> Callable[[Any], list[Any]]:
    """Give fields of one kind of message other values."""

    def change(message: Any) -> list[Any]:
        if message.get_type() == kind:
            for name, value in fields.items():
                setattr(message, name, value)
        return [message]

    return change


def test_a_vehicle_that_says_it_was_disarmed_in_flight_is_told_to_hover_and_land() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.2)
    sky.cable.change = changing("HEARTBEAT", base_mode=1)
    sky.run(lambda: sky.client.stage is ClientStage.RECOVERING, limit=1.0)
    assert sky.client.report().aborted == "the vehicle was disarmed"
    sky.run(lambda: sky.vehicle.mode is Mode.HOLD, limit=0.2)


@pytest.mark.slow
def test_a_vehicle_that_is_not_seen_after_an_abort_is_told_to_land_and_does() -> None:
    sky = over_a_link()
    sky.cable.change = changing("ODOMETRY", vx=nan)
    sky.run(lambda: sky.client.done)
    assert "no news of the vehicle; it is told to land" in sky.said
    assert sky.client.stage is ClientStage.LANDED
    assert sky.vehicle.landed
    assert not sky.vehicle.crashed


@pytest.mark.slow
def test_a_vehicle_that_seems_to_move_after_an_abort_is_told_to_land_all_the_same() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.2)
    sky.client.abort(sky.clock.now(), "enough")
    sky.cable.change = changing("ODOMETRY", vx=1.0)
    sky.run(lambda: sky.client.done, limit=100.0)
    assert "the vehicle does not come to a hover; it is told to land" in sky.said
    assert sky.client.stage is ClientStage.LANDED


@pytest.mark.slow
def test_a_vehicle_that_does_not_land_is_left_with_a_sentence() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.2)
    sky.client.abort(sky.clock.now(), "enough")
    sky.vehicle.land = lambda: False  # type: ignore[method-assign]
    sky.run(lambda: sky.client.done, limit=120.0)
    assert sky.said[-1] == "the vehicle does not land as it is told; it is left to its own failsafe"
    assert sky.client.stage is ClientStage.LOST
    assert sky.hovers


def test_a_pilot_who_takes_over_after_an_abort_is_not_interfered_with() -> None:
    sky = over_a_link()
    sky.run_into_the_plan(0.2)
    sky.client.abort(sky.clock.now(), "enough")
    sky.run_for(0.1)
    sky.cable.change = changing("HEARTBEAT", custom_mode=1 << 16)
    sky.run(lambda: sky.client.stage is ClientStage.LOST, limit=1.0)
    assert sky.said[-1] == "a pilot has taken over; it is left to the pilot"
    assert sky.client.report().aborted == "enough"


def test_a_vehicle_that_cannot_be_armed_is_told_in_a_sentence() -> None:
    sky = Sky()
    sky.vehicle.crashed = True
    with pytest.raises(
        SpecError, match=r"^the vehicle does not arm: Arming denied: it lies where it crashed$"
    ):
        sky.run(lambda: sky.client.done)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("GUID_OPTIONS", 65.0, r"GUID_OPTIONS is 65: thrusts are taken for climb rates; set it to 73"),
        ("ATC_ANGLE_BOOST", 1.0, "none is left upside down; set it to 0"),
    ],
)
def test_a_copter_that_would_fly_other_thrusts_is_refused_before_it_is_armed(
    name: str, value: float, words: str
) -> None:
    sky = Sky(speaks=ARDUPILOT)
    sky.front_end.parameters[name] = value
    with pytest.raises(SpecError, match=words):
        sky.run(lambda: sky.client.done)
    assert not sky.vehicle.armed


def test_what_keeps_a_copter_from_arming_is_told_as_it_says() -> None:
    sky = Sky(speaks=ARDUPILOT)
    sky.vehicle.arm = lambda: False  # type: ignore[method-assign]

    def change(message: Any) -> list[Any]:
        if message.get_type() == "STATUSTEXT":
            message.text = "PreArm: Need Position Estimate"
        return [message]

    sky.cable.change = change
    with pytest.raises(SpecError, match=r"^the vehicle does not arm: PreArm: Need Position Estimate$"):
        sky.run(lambda: sky.client.done)


def test_a_copter_takes_off_by_an_order_and_one_that_does_not_is_told_to_land() -> None:
    """Set-points lead it nowhere from the ground, and it arms in the mode GUIDED alone."""
    sky = Sky(speaks=ARDUPILOT)
    sky.cable.send(dialect().MAVLink_command_long_message(1, 1, 400, 0, 1.0, *[0.0] * 6))
    sky.run_for(0.2)
    assert not sky.vehicle.armed
    sky.vehicle.take_off = lambda height: False  # type: ignore[method-assign]
    with pytest.raises(SpecError, match="the vehicle does not take off"):
        sky.run(lambda: sky.client.done)
    assert sky.vehicle.landed
    assert not sky.vehicle.armed


def test_a_copter_whose_take_off_is_given_up_is_told_to_hover_and_reported() -> None:
    sky = Sky(speaks=ARDUPILOT)
    sky.run(lambda: sky.client.stage is ClientStage.TAKING_OFF)
    sky.run_for(0.5)
    sky.client.abort(sky.clock.now(), "interrupted")
    sky.run(lambda: sky.vehicle.mode is Mode.HOLD, limit=0.5)
    assert sky.client.mission.phase is Phase.ABORTED
    assert str(sky.client.report()) == "aborted: interrupted; hovering after the abort"


@pytest.mark.slow
@pytest.mark.parametrize("lost", [True, False])
def test_a_vehicle_that_may_have_been_armed_unheard_is_told_to_land_before_it_is_refused(lost: bool) -> None:
    """Heartbeats of an armed vehicle get lost for as long as it is, or say that it is not."""
    sky = Sky()

    def change(message: Any) -> list[Any]:
        if message.get_type() != "HEARTBEAT" or not sky.vehicle.armed:
            return [message]
        message.base_mode = 1
        return [] if lost else [message]

    sky.cable.change = change
    with pytest.raises(SpecError, match="the vehicle does not arm"):
        sky.run(lambda: sky.client.done)
    sky.client_lives = False
    sky.run(lambda: not sky.vehicle.armed, limit=4.0)
    assert "the vehicle does not arm; it is told to land" in sky.said


def test_the_simulated_vehicle_obeys_no_order_to_another_system_and_none_without_numbers() -> None:
    sky = over_a_link(loss=0.0)
    make = dialect()
    for order in (
        make.MAVLink_command_long_message(7, 1, 21, 0, *[0.0] * 7),  # land
        make.MAVLink_set_attitude_target_message(10**9, 7, 1, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0, 1.0),
        *(
            make.MAVLink_command_long_message(1, 1, number, 0, *[x] * 7)
            for number in (176, 511, 512)
            for x in (nan, inf)
        ),
    ):
        sky.cable.send(order)
        sky.run_for(0.04)
    sky.run_for(0.3)
    assert sky.vehicle.mode is Mode.OFFBOARD
    assert max(sky.errors) < 0.04


def test_a_set_point_stamped_far_ahead_does_not_keep_the_vehicle_from_those_after_it() -> None:
    sky = over_a_link(loss=0.0)
    sky.run_into_the_plan(0.3)
    ahead = copy(sky.cable.sent[-1])
    ahead.time_boot_ms += 10**6
    sky.cable.send(ahead)
    sky.run(lambda: sky.client.mission.phase is Phase.HOLD)
    assert not sky.client.report().failures


def test_what_is_not_proven_for_its_vehicle_is_refused() -> None:
    plan = flip()
    bare = replace(plan, vehicle=None)
    assert plan.vehicle is not None
    weak = replace(plan.vehicle, rotors=tuple(replace(r, max_thrust=5.0) for r in plan.vehicle.rotors))
    refuted = replace(plan, vehicle=weak)
    require_flyable(plan, ORIGIN, "agile-quad")
    for wrong, words in (
        ((bare, ORIGIN, None), "for no vehicle"),
        ((plan, ORIGIN, "hexarotor"), "certified for agile-quad, not for hexarotor"),
        ((refuted, ORIGIN, None), "not certified for agile-quad .command of rotor"),
        ((plan, np.zeros(3), None), "raise its origin"),
    ):
        with pytest.raises(SpecError, match=words):
            require_flyable(*wrong)


def test_a_plan_that_begins_in_motion_is_refused() -> None:
    plan = flip()
    moving = ab.Trajectory([1.0], [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    ends = (ab.EndState((x, 0.0, 0.0), velocity=(1.0, 0.0, 0.0)) for x in (0.0, 1.0))
    plan = replace(plan, problem=ab.Problem("moving", *ends), stages=())
    with pytest.raises(SpecError, match="begins in motion"):
        require_flyable(replace(plan, trajectory=moving), ORIGIN)
