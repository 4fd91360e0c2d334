"""Links where gravity is not the Earth's: what is flown follows the gravity that was planned with."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.interchange.exports.crazyflie import AXES
from aerobat.interchange.ros import Messages
from aerobat.kernels.rigid_body import Body
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.commander import Commander, Doing
from aerobat.links.goals import Observed, PathPiece
from aerobat.links.mission import Mission, MissionSettings, Phase
from aerobat.links.ros.crazyswarm import SERVICES
from aerobat.links.ros.crazyswarm_server import CrazyswarmServer
from aerobat.links.ros.maneuver_node import ManeuverNode
from aerobat.links.routes import rest_to_rest
from aerobat.links.stream import SetpointStream
from command_lines import run
from mavlink_sky import Wire
from ros_sky import BEGAN, AtOnce, Graph, Ros

MOON = ab.Environment(gravity=1.62)
QUAD = ab.load_vehicle("agile-quad")
NAME = "/cf231"


def test_a_hold_in_a_maneuver_brakes_by_the_gravity_of_that_maneuver() -> None:
    """A climb ends by gravity, on the Moon six times as slowly as on Earth: rotors do not pull down."""
    vehicle, low, high = ab.load_vehicle("agile-quad"), np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, 33.0])
    path = rest_to_rest(low, high, max_speed=4.0)
    problem = ab.Problem(name="climb", start=ab.at_rest(low), goal=ab.at_rest(high), environment=MOON)
    plan = ab.Plan(problem=problem, trajectory=path, planner="by hand", status="").for_vehicle(vehicle)
    stream = SetpointStream(path, vehicle, MOON, np.zeros(3))
    mission = Mission(plan, MissionSettings(), stream, lambda time, _: stream.goal(time))
    now, period = 0.0, 0.05  # [s]
    commander = Commander(vehicle, ab.Environment().gravity, period)
    commander.observe(Observed(now, Body((0.0, 0.0, 3.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)))
    commander.begin(now, mission)
    while mission.phase is not Phase.MANEUVER or now - mission.maneuver_began < 0.5 * path.duration:
        goal, now = commander.step(now), now + period
        assert goal is not None
        reached = goal.position, goal.velocity, goal.q_world_body, goal.omega
        commander.observe(Observed(now, Body(*(tuple(part.tolist()) for part in reached))))
    commander.hover(now)
    assert commander.doing is Doing.BRAKING
    assert commander.route is not None
    braking = commander.route.path
    assert braking.evaluate(0.0, 1)[2] > 3.0
    thrust = braking.evaluate(np.linspace(0.0, braking.duration, 200), 2)[:, 2] + MOON.gravity
    assert (thrust > 0.0).all()


def test_an_uploaded_trajectory_leans_by_the_gravity_around_the_vehicle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = Graph(2)
    ros = Ros(graph)
    vehicle = SimulatedVehicle(replace(ab.load_vehicle("crazyflie"), drag_body=np.zeros(3)), MOON)
    server = CrazyswarmServer(ros, vehicle, NAME)

    def order(service: str, **request: Any) -> None:
        ros.client(f"{NAME}/{service}", SERVICES[service])(group_mask=0, **request)

    def run_for(seconds: float) -> None:
        end = graph.time + round(1e9 * seconds)
        while graph.time < end:
            graph.time += 4_000_000
            graph.deliver()
            server.tick((graph.time - BEGAN) / 1e9)

    order("takeoff", height=1.0)
    run_for(3.0)
    aside = rest_to_rest(np.zeros(3), np.array([1.5, 0.0, 0.0]))
    powers = aside.coefficients[0] / aside.duration ** np.arange(6)[:, None]
    polynomials = {f"poly_{axis}": row for axis, row in zip(AXES, [*powers.T, np.zeros(1)], strict=True)}
    duration = Messages(ros.make).time("Duration", round(1e9 * aside.duration))
    piece = ros.make("crazyflie_interfaces/msg/TrajectoryPolynomialPiece", duration=duration, **polynomials)
    order("upload_trajectory", trajectory_id=1, piece_offset=0, pieces=[piece])
    order("start_trajectory", trajectory_id=1, timescale=1.0, reversed=False, relative=True)
    followed: list[PathPiece] = []
    monkeypatch.setattr(vehicle, "follow_path", followed.append)
    run_for(aside.duration)
    goals = [piece.begin for piece in followed]
    leaning = so3.thrust_axis(np.array([goal.q_world_body for goal in goals]))
    asked = np.array([goal.acceleration for goal in goals]) + MOON.weight
    asked /= np.linalg.norm(asked, axis=1, keepdims=True)
    assert asked[:, 2].min() < 0.7  # 45° and more
    np.testing.assert_allclose(leaning, asked, atol=0.01)


@pytest.fixture
def windy_moon(tmp_path: Path) -> Path:
    """A problem's file, whose environment is neither the Earth's nor calm."""
    windy = replace(MOON, wind=np.array([0.5, 0.0, 0.0]))
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((2.0, 0.0, 1.0))
    path = tmp_path / "windy-moon.toml"
    ab.write_problem(ab.Problem("windy-moon", *ends, environment=windy), path)
    return path


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[ab.Environment]:
    """The environments in which commands simulate a vehicle; no ROS is needed, and no port taken."""
    found: list[ab.Environment] = []
    begin = SimulatedVehicle.__init__

    def noted(self: SimulatedVehicle, vehicle: ab.Vehicle, environment: ab.Environment) -> None:
        begin(self, vehicle, environment)
        found.append(environment)

    wire = Wire(1, 1)
    wire.other = Wire(2, 1)
    monkeypatch.setattr(SimulatedVehicle, "__init__", noted)
    monkeypatch.setattr("aerobat.cli.commands.mavlink.connect", lambda *_, **__: wire)
    monkeypatch.setattr("aerobat.cli.commands.ros._joined", lambda *_: Ros(Graph(2)))
    monkeypatch.setattr("aerobat.cli.commands.ros.run", lambda *_: None)
    return found


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[ManeuverNode]:
    """The nodes that `aerobat link ros` starts, which end at once and need no ROS and no second process."""
    found: list[ManeuverNode] = []
    monkeypatch.setattr("aerobat.cli.commands.ros._joined", lambda *_, **__: Ros(Graph(2)))
    monkeypatch.setattr("aerobat.cli.commands.ros.processes", lambda *_, **__: nullcontext(AtOnce()))
    monkeypatch.setattr("aerobat.cli.commands.ros._rehearse", lambda *_: None)
    monkeypatch.setattr("aerobat.cli.commands.ros.run", lambda node, *_: found.append(node))
    return found


def test_all_maneuvers_of_a_node_and_its_board_have_the_gravity_of_the_problems_that_are_named(
    windy_moon: Path,
    started: list[ManeuverNode],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The paper's maneuvers, too, which every node offers."""
    flown: list[ab.Environment] = []
    monkeypatch.setattr("aerobat.cli.commands.ros.board_at", lambda *given: flown.append(given[2]))
    code, _, err = run(capsys, "link", "ros", windy_moon)
    assert code == 0, err
    (node,) = started
    assert {problem.environment.gravity for problem, _ in node._maneuvers.values()} == {MOON.gravity}
    assert node.commander._gravity == MOON.gravity
    assert [environment.gravity for environment in flown] == [MOON.gravity]


def test_maneuvers_of_different_gravities_are_refused_before_ros_is_joined(
    windy_moon: Path, started: list[ManeuverNode], capsys: pytest.CaptureFixture[str]
) -> None:
    """By the node, and by its command."""
    moon, earth = ab.load_problem(str(windy_moon)), ab.load_problem("line")
    planner = ab.Miqp()
    with pytest.raises(ab.SpecError, match=r"'line' has 9\.81 m/s² and 'windy-moon' has 1\.62 m/s²"):
        ManeuverNode(Ros(Graph(2)), QUAD, {"line": (earth, planner), "moon": (moon, planner)}, AtOnce())
    code, _, err = run(capsys, "link", "ros", "power-loop", windy_moon)
    assert code == 2
    assert "a vehicle flies in one gravity" in err
    assert err.count("\n") == 1
    assert not started


VEHICLES = pytest.mark.parametrize("command", ["ros-vehicle", "mavlink-vehicle"])


@VEHICLES
@pytest.mark.parametrize("source", ["problem", "plan"])
def test_a_vehicle_is_simulated_in_the_environment_of_the_problem_or_plan_that_is_named(
    command: str,
    source: str,
    windy_moon: Path,
    simulated: list[ab.Environment],
    capsys: pytest.CaptureFixture[str],
) -> None:
    problem, named = ab.load_problem(str(windy_moon)), windy_moon
    if source == "plan":
        named = windy_moon.with_suffix(".plan")
        path = rest_to_rest(problem.start.position, problem.goal.position)
        ab.Plan(problem=problem, trajectory=path, planner="by hand", status="").save(named)
    code, _, err = run(capsys, "link", command, "--for", 0.01, "--environment", named)
    assert code == 0, err
    assert simulated == [problem.environment]


@VEHICLES
def test_a_vehicle_is_simulated_on_earth_in_still_air_where_no_environment_is_named(
    command: str, simulated: list[ab.Environment], capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run(capsys, "link", command, "--for", 0.01)
    assert code == 0, err
    assert simulated == [ab.Environment()]


@VEHICLES
@pytest.mark.parametrize(
    ("named", "words"), [("flip-rool", "did you mean 'flip-roll'"), ("path.csv", "alone")]
)
def test_an_environment_that_is_none_is_refused_in_a_sentence(
    command: str,
    named: str,
    words: str,
    tmp_path: Path,
    simulated: list[ab.Environment],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    ab.write_csv(rest_to_rest(np.zeros(3), np.ones(3)), "path.csv")
    code, _, err = run(capsys, "link", command, "--for", 0.01, "--environment", named)
    assert code == 2
    assert words in err
    assert err.count("\n") == 1
    assert not simulated
