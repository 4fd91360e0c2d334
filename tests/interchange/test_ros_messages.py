"""Goals and states as ROS messages: what is read is what was said, by both generations' own definitions."""

from __future__ import annotations

import re
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import aerobat as ab
from aerobat import cli, so3
from aerobat.interchange.ros import Messages, PlanMessages
from aerobat.links.goals import PathGoal, PathPiece, PositionGoal
from aerobat.links.ros import topics
from aerobat.states import BodyState
from ros_sky import BEGAN, Graph, Ros
from shared_plans import shared_plan


def random_goal(rng: np.random.Generator) -> PathGoal:
    vectors = rng.normal(scale=10.0, size=(6, 3))
    return PathGoal(*vectors[:4], so3.normalize(rng.normal(size=4)), *vectors[4:])


def carried(message: Any, kind: str, generation: int) -> Any:
    """A message after it has travelled."""
    graph = Graph(generation)
    return graph.decode(graph.encode(message, kind), kind)


@given(seed=st.integers(0, 2**32 - 1), generation=st.sampled_from([1, 2]))
def test_a_goal_is_read_as_it_was_sent(seed: int, generation: int) -> None:
    """Position to jerk and attitude to its second derivative, at both its ends."""
    rng = np.random.default_rng(seed)
    piece = PathPiece(random_goal(rng), random_goal(rng), 12.34, 0.01)
    messages = Messages(Ros(Graph(generation)).make)
    message = topics.goal_message(messages, piece, BEGAN + 12_340_000_000)
    read = topics.read_goal(carried(message, topics.KIND_OF_GOAL, generation), BEGAN)
    assert read is not None
    assert (read.stamp, read.duration) == pytest.approx((12.34, 0.01), abs=1e-9)
    for sent, got in zip((*piece.begin, *piece.end), (*read.begin, *read.end), strict=True):
        np.testing.assert_array_equal(got, sent)


def test_without_the_second_joint_the_jerk_is_that_between_its_two_points() -> None:
    rng = np.random.default_rng(1)
    piece = PathPiece(random_goal(rng), random_goal(rng), 0.0, 0.01)
    message = topics.goal_message(Messages(Ros(Graph(2)).make), piece, BEGAN, with_jerk=False)
    assert message.joint_names == ["base_link"]
    assert [len(point.transforms) for point in message.points] == [1, 1]
    read = topics.read_goal(message, BEGAN)
    assert read is not None
    change = (piece.end.acceleration - piece.begin.acceleration) / 0.01
    np.testing.assert_allclose(read.begin.jerk, change, rtol=1e-9)


def test_goals_of_others_need_no_more_than_a_place_and_an_attitude() -> None:
    rng = np.random.default_rng(2)
    goal = random_goal(rng)
    messages = Messages(Ros(Graph(1)).make)
    message = topics.goal_message(messages, PathPiece(goal, goal, 0.0, 0.01), BEGAN)
    bare = message.points[0]
    bare.transforms, bare.velocities, bare.accelerations = bare.transforms[:1], [], []
    message.points = [bare]
    read = topics.read_goal(message, BEGAN)
    assert read is not None
    np.testing.assert_array_equal(read.begin.position, goal.position)
    assert not np.any([read.begin.velocity, read.begin.acceleration, read.begin.jerk])
    message.points = []
    assert topics.read_goal(message, BEGAN) is None


@given(seed=st.integers(0, 2**32 - 1), generation=st.sampled_from([1, 2]))
def test_odometry_is_read_as_it_was_sent_its_velocities_in_the_bodys_axes(seed: int, generation: int) -> None:
    rng = np.random.default_rng(seed)
    position, velocity, omega = rng.normal(size=(3, 3))
    q = so3.normalize(rng.normal(size=4))
    message = Messages(Ros(Graph(generation)).make).odometry(BEGAN, BodyState(position, velocity, q, omega))
    message = carried(message, topics.KIND_OF_ODOMETRY, generation)
    twist = message.twist.twist.linear
    turn = Rotation.from_quat(q[[1, 2, 3, 0]])
    np.testing.assert_allclose(turn.apply([twist.x, twist.y, twist.z]), velocity, atol=1e-12)
    read = topics.read_odometry(message, BEGAN)
    assert read is not None
    for got, sent in zip(read.body, (position, velocity, q, omega), strict=True):
        np.testing.assert_allclose(got, sent, atol=1e-12)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
@pytest.mark.parametrize(
    "field",
    [f"pose.pose.{part}" for part in ("position.x", "orientation.w")]
    + [f"twist.twist.{part}.y" for part in ("linear", "angular")],
)
def test_odometry_that_is_no_vehicles_is_none(field: str, value: float) -> None:
    level = BodyState(np.zeros(3), np.zeros(3), so3.IDENTITY, np.zeros(3))
    message = Messages(Ros(Graph(2)).make).odometry(BEGAN, level)
    assert topics.read_odometry(message, BEGAN) is not None
    whole, _, last = field.rpartition(".")
    setattr(attrgetter(whole)(message), last, value)
    assert topics.read_odometry(message, BEGAN) is None


@given(seed=st.integers(0, 2**32 - 1))
def test_a_goal_near_a_hover_leans_as_its_acceleration_asks_and_turns_as_its_jerk_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    acceleration, jerk = rng.uniform(-2.0, 2.0, size=(2, 3))
    yaw, step, gravity = rng.uniform(-3.0, 3.0), 1e-5, 9.81
    position = np.zeros(3)
    goal = PathGoal.upright(PositionGoal(position, position, acceleration, yaw, jerk), gravity)
    later = PathGoal.upright(PositionGoal(position, position, acceleration + step * jerk, yaw, jerk), gravity)
    thrust = acceleration + gravity * so3.UP
    axis = so3.thrust_axis(goal.q_world_body)
    np.testing.assert_allclose(axis, thrust / np.linalg.norm(thrust), atol=1e-12)
    change = (so3.thrust_axis(later.q_world_body) - axis) / step
    np.testing.assert_allclose(so3.cross(goal.omega, axis), change, atol=1e-4)


def fields(message: Any, path: str = "") -> dict[str, Any]:
    """All numbers and strings in a message, by where they stand in it."""
    if isinstance(message, list):
        return {k: v for i, part in enumerate(message) for k, v in fields(part, f"{path}[{i}]").items()}
    if not hasattr(message, "__msgtype__"):
        return {path: message.tolist() if isinstance(message, np.ndarray) else message}
    parts = {name: value for name, value in vars(message).items() if name != "__msgtype__"}
    return {k: v for name, part in parts.items() for k, v in fields(part, f"{path}.{name}").items()}


def test_what_rviz_2_is_sent_is_what_rviz_shows_field_by_field() -> None:
    """RViz 2 was not run; of what it takes besides, meshes and textures, it gets none."""
    plan = shared_plan("half-flip")
    found = ab.reference(plan, rate=50.0)
    rviz, rviz2 = (
        fields([*shown.lines(found), *(disc for _, discs in shown.snapshots(0.3) for disc in discs)])
        for shown in (PlanMessages(Messages(Ros(Graph(g)).make), plan, BEGAN, np.zeros(3)) for g in (1, 2))
    )
    counts = [name for name in rviz if name.endswith(".seq")]  # of headers, which only ROS 1 has
    assert {name: rviz2[name] for name in rviz if name not in counts} == {
        name: value for name, value in rviz.items() if name not in counts
    }
    assert not any(value for name, value in rviz2.items() if name not in rviz)


@pytest.mark.parametrize("generation", topics.RVIZ)
def test_the_shipped_rviz_configurations_show_what_is_published(generation: str) -> None:
    """Of ROS 2 the markers are latched, and reach who asks for that alone."""
    path = Path(topics.RVIZ[generation].split(" -d ")[1])
    manager = yaml.safe_load(path.read_text())["Visualization Manager"]
    displays = {display["Name"]: display for display in manager["Displays"]}
    assert manager["Global Options"]["Fixed Frame"] == "world"
    if generation == "1":
        assert displays["Plan"]["Marker Topic"] == topics.MARKERS
        assert displays["Vehicle"]["Topic"] == topics.ODOMETRY
        return
    assert {display["Class"] for display in displays.values()} == {
        f"rviz_default_plugins/{kind}" for kind in ("Grid", "MarkerArray", "Odometry")
    }
    assert displays["Plan"]["Topic"]["Value"] == topics.MARKERS
    assert displays["Plan"]["Topic"]["Durability Policy"] == "Transient Local"
    assert displays["Vehicle"]["Topic"]["Value"] == topics.ODOMETRY


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("link", "ros", "--ros", "1"), "ROS 1 needs rospy.*/opt/ros/noetic/setup.bash"),
        (("link", "ros"), "ROS 2 needs rclpy.*/opt/ros/DISTRIBUTION/setup.bash"),
        (("link", "ros-vehicle", "--ros", "1"), "ROS 1 needs rospy"),
        (("link", "ros-vehicle", "--speed", "0.5"), "ROS 2 needs rclpy"),
        (("link", "ros", "flip-rool"), "did you mean 'flip-roll'"),
        (("link", "ros", "land.toml"), "/aerobat/land is the node's own; give land.toml another name"),
        (("link", "ros", "3d.toml"), "/aerobat/3d does not begin with a letter; give 3d.toml another name"),
        (("link", "ros", "power-loop", "power_loop.toml"), "/aerobat/power_loop is that of power-loop"),
        (("link", "ros", "--goal", "mps:/dev/ttyACM0"), "'mps:/dev/ttyACM0' is no topic of ROS"),
        (("link", "ros", "--odometry", "my odometry"), "'my odometry' is no topic of ROS"),
        (("link", "ros", "--goal", "crazyswarm2:/cf 231"), "'/cf 231/odom' is no topic of ROS"),
        (("link", "ros-vehicle", "--goal", "/3d/goal"), "'/3d/goal' is no topic of ROS"),
        (("link", "ros-vehicle", "--goal", "crazyswarm2:cf-231"), "'cf-231/odom' is no topic of ROS"),
        (("link", "ros", "--vehicle", "agile-quda"), "agile-quad"),
        (("link", "ros", "--reserve", "0.7"), "reserve"),
        (("link", "ros", "--rate", "1000"), "rate"),
        (("link", "ros", "--ros", "1", "--goal", "crazyswarm2:/cf231"), "crazyswarm2 is a server of ROS 2"),
        (("link", "ros", "--ros", "1", "--sim-time"), "--sim-time is for --ros 2"),
    ],
)
def test_what_is_missing_or_wrong_is_said_in_a_sentence(
    arguments: tuple[str, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("land.toml", "3d.toml", "power_loop.toml"):
        ab.write_problem("line", name)
    with pytest.raises(SystemExit) as stopped:
        cli.main(arguments)
    assert stopped.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(words, line), line
