"""A Crazyflie behind crazyswarm2's server: its services and full states, in one process, as ROS 2's bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aerobat import so3
from aerobat.links.commander import Doing
from aerobat.links.goals import Mode
from aerobat.links.ros import topics
from aerobat.links.ros.crazyswarm import FULL_STATE, SERVICES
from command_lines import run
from ros_sky import Ros, Sky, crazyflie_aloft

NAME = "/cf231"
STARTED = ["upload_trajectory", "notify_setpoints_stop", "start_trajectory"]


def asked_of(sky: Sky) -> list[str]:
    """The services that are asked from now on, each time."""
    asked: list[str] = []
    for service in SERVICES:

        def note(message: Any, service: str = service) -> list[Any]:
            asked.append(service)
            return [message]

        sky.graph.change[f"{NAME}/{service}"] = note
    return asked


@pytest.mark.slow
@pytest.mark.parametrize(("maneuver", "in_pieces"), [("flip", True), ("window", False)])
def test_a_maneuver_is_flown_by_the_orders_of_crazyswarm2_and_lands(maneuver: str, in_pieces: bool) -> None:
    """Uploaded as pieces and flown by the vehicle itself, or streamed as full states."""
    sky = crazyflie_aloft(in_pieces)
    asked = asked_of(sky)
    reply = sky.call(maneuver)
    assert reply.success, reply.sentence
    sky.run(lambda: bool(sky.reports))
    assert sky.reports[0].startswith("flown within"), sky.reports
    assert max(sky.errors) < 0.03
    assert sky.call("land").success
    sky.run(lambda: sky.stands, limit=20.0)
    assert asked == [*(STARTED if in_pieces else []), "notify_setpoints_stop", "go_to", "land"]


@pytest.mark.slow
def test_a_node_that_dies_in_an_uploaded_maneuver_leaves_it_flown_and_a_hover_at_its_end() -> None:
    sky = crazyflie_aloft(True)
    asked = asked_of(sky)
    assert sky.call("line").success
    sky.run_into_the_plan(0.3)
    assert asked == STARTED
    assert max(sky.errors) < 0.02
    end = sky.node.commander.mission.end.position  # type: ignore[union-attr]
    sky.node_lives = False
    sky.run_for(2.6)
    assert sky.hovers
    np.testing.assert_allclose(sky.position, end, atol=0.02)


@pytest.mark.slow
def test_a_stream_that_is_given_up_in_the_air_ends_in_the_order_to_stay() -> None:
    sky = crazyflie_aloft(False)
    assert sky.call("line").success
    sky.run_into_the_plan(0.3)
    asked = asked_of(sky)
    sky.graph.cut.add(f"{NAME}/odom")
    sky.run(lambda: sky.node.commander.doing is Doing.NOTHING, limit=3.0)
    sky.run_for(0.5)
    assert asked[-2:] == ["notify_setpoints_stop", "go_to"]
    assert sky.vehicle.mode is Mode.HOLD


def test_a_full_state_is_the_goal_with_its_rates_in_the_bodys_axes() -> None:
    sky = crazyflie_aloft(False)
    heard: list[Any] = []
    Ros(sky.graph).subscribe(f"{NAME}/cmd_full_state", FULL_STATE, heard.append)
    assert sky.call("line").success
    sky.run_into_the_plan(0.5)
    mission = sky.node.commander.mission
    assert mission is not None
    since = (topics.nanoseconds(heard[-1].header.stamp) - sky.node.origin) / 1e9 - mission.maneuver_began
    planned = mission.stream.at(since)
    np.testing.assert_allclose(topics.vector(heard[-1].pose.position), planned.position, atol=1e-6)
    q = topics.quaternion(heard[-1].pose.orientation)
    omega = so3.rotate(q, topics.vector(heard[-1].twist.angular))
    np.testing.assert_allclose(omega, planned.omega, atol=1e-6)
    np.testing.assert_allclose(
        topics.vector(heard[-1].acc), mission.stream.flat(since).acceleration, atol=1e-6
    )


def test_a_plan_is_flown_on_board_of_a_crazyflie_alone(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "link", "ros", "--onboard")
    assert code == 2
    assert err.endswith("--onboard is for a Crazyflie; give --goal crazyswarm2:/NAME, or leave it out\n")


@pytest.mark.parametrize("command", ["ros", "ros-vehicle"])
def test_odometry_of_another_topic_than_the_crazyflie_s_is_refused(command: str, capsys) -> None:
    """It was left unread."""
    code, _, err = run(capsys, "link", command, "--goal", "crazyswarm2:/cf231", "--odometry", "/mocap/odom")
    assert code == 2
    assert err.endswith("--odometry is not for a Crazyflie, whose own is /cf231/odom; leave it out\n")


def test_a_trajectory_that_was_not_uploaded_does_not_begin() -> None:
    sky = crazyflie_aloft(True)
    start = {"trajectory_id": 7, "timescale": 1.0, "reversed": False, "relative": False}
    Ros(sky.graph).client(f"{NAME}/start_trajectory", SERVICES["start_trajectory"])(**start)
    sky.run_for(0.1)
    assert sky.hovers
    assert "none begins" in sky.said[-1]
