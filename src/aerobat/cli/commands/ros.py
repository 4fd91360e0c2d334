"""`aerobat link ros` and `ros-vehicle`: nodes of ROS 1 and ROS 2 alike."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any, Literal, cast

from aerobat import so3
from aerobat.cli.link_options import RosNodeOptions, RosOptions, RosVehicleOptions
from aerobat.cli.runs.saved_plans import named_environment, named_vehicle
from aerobat.cli.terminal import say
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.betaflight.board import board_at
from aerobat.links.ros.crazyswarm import PREFIX, Crazyflie
from aerobat.links.ros.crazyswarm_server import CrazyswarmServer
from aerobat.links.ros.maneuver_node import OWN_SERVICES, ManeuverNode, NodeSettings, Tick
from aerobat.links.ros.middleware import Middleware, PacedClock
from aerobat.links.ros.preparation import MANEUVERS, ManeuverRequest, prepare, shared_gravity
from aerobat.links.ros.rclpy_middleware import RclpyMiddleware
from aerobat.links.ros.rospy_middleware import RospyMiddleware
from aerobat.links.ros.run import run
from aerobat.links.ros.topics import ODOMETRY, RVIZ
from aerobat.links.ros.vehicle_node import VehicleNode
from aerobat.planning import Planner, planner_class, suited_planner
from aerobat.problem import Problem, load_problem
from aerobat.studies.workers import processes
from aerobat.vehicle import Vehicle

_VEHICLE_RATE = 250.0  # [1/s] at which the simulated vehicle goes on


def ros(*problems: str, options: RosOptions = RosOptions()) -> None:
    """Fly maneuvers on demand as a node of ROS 1 or ROS 2.

    Offers services of std_srvs/Trigger: /aerobat/takeoff, the paper's line, flip, flip_pitch, flip_trans and
    window (a half-flip), hold, and land. A maneuver is planned from where the odometry sees the vehicle
    hover, answered once it begins, and streamed as goals; what came of it is told on /aerobat/report. Runs
    until it is interrupted; a vehicle that gets no more goals is to hover by itself. Read docs/ros.md before
    anything real is flown.

    Parameters
    ----------
    problems
        Names that `aerobat show` lists, or problems' TOML files, to be services too, of their names. They
        have one gravity, in which the paper's maneuvers are planned, too.
    """
    vehicle, crazyflie = named_vehicle(options.vehicle), _crazyflie(options)
    if options.onboard and not crazyflie:
        raise SpecError("--onboard is for a Crazyflie; give --goal crazyswarm2:/NAME, or leave it out")
    settings = NodeSettings(
        rate=options.rate,
        takeoff_height=options.takeoff_height,
        in_world=options.world,
        with_jerk=options.jerk,
        goal=options.goal,
        in_pieces=options.onboard,
        odometry=_odometry(options, crazyflie),
        mission=options.mission,
    )
    named = {service: load_problem(name) for service, name in _services(problems).items()}
    environment = Environment(gravity=shared_gravity(named.values()))
    maneuvers = {
        service: (problem, _planner(problem, vehicle, options))
        for service, problem in {**_paper_maneuvers(environment.gravity), **named}.items()
    }
    _require_topics(settings.odometry)
    board = board_at(options.goal, vehicle, environment, 1.0 / options.rate)
    if board is None and not crazyflie:
        _require_topics(settings.goal)
    take: Callable[[Tick], None] | None = None
    with (
        nullcontext() if board is None else closing(board),
        closing(_joined("aerobat", options.generation, sim_time=options.sim_time)) as middleware,
    ):
        if crazyflie:
            take = Crazyflie(cast(RclpyMiddleware, middleware), crazyflie).take
        elif board is not None:
            take = lambda tick: board.take(tick.piece, tick.commander.observed, tick.now)  # noqa: E731
        # two, so that none of them is this one
        with processes(2, forked=False) as executor:
            _rehearse(executor, vehicle, maneuvers, settings)
            node = ManeuverNode(middleware, vehicle, maneuvers, executor, settings, say, take)
            say(f"flies {vehicle.name}: /aerobat/ takeoff, {', '.join(maneuvers)}, hold, land")
            say(f"to look: {RVIZ[options.generation]}")
            run(node, middleware, options.rate, options.seconds or inf)


def ros_vehicle(
    vehicle: str = "agile-quad",
    /,
    options: RosVehicleOptions = RosVehicleOptions(),
) -> None:
    """Simulate a vehicle that is a node of ROS: goals in, odometry out, for `aerobat link ros`.

    It stands on the ground, is armed by the first goal above it, and hovers where goals stop. Runs until it
    is interrupted.

    Parameters
    ----------
    vehicle
        A name that `aerobat show` lists, or a vehicle's TOML file.
    """
    found, environment = named_vehicle(vehicle), named_environment(options.environment)
    clock = None if options.speed is None else PacedClock(options.speed)
    crazyflie = _crazyflie(options)
    odometry = _odometry(options, crazyflie)
    _require_topics(*(() if crazyflie else (options.goal,)), odometry)
    with closing(_joined("aerobat_vehicle", options.generation, clock)) as middleware:
        simulated = SimulatedVehicle(found, environment)
        settings: dict[str, Any] = {"rate": options.rate, "clock": clock, "say": say}
        if crazyflie:
            node: VehicleNode = CrazyswarmServer(
                cast(RclpyMiddleware, middleware), simulated, crazyflie, **settings
            )
        else:
            node = VehicleNode(middleware, simulated, goal=options.goal, odometry=odometry, **settings)
        say(f"{found.name} stands on the ground, and obeys {options.goal}")
        run(node, middleware, _VEHICLE_RATE, options.seconds or inf)


def _rehearse(
    executor: Executor,
    vehicle: Vehicle,
    maneuvers: Mapping[str, tuple[Problem, Planner]],
    settings: NodeSettings,
) -> None:
    """Begin to plan one maneuver for nobody, so that the first real one finds everything imported."""
    problem, planner = next(iter(maneuvers.values()))
    aloft = settings.takeoff_height * so3.UP
    executor.submit(prepare, ManeuverRequest(problem, vehicle, planner, aloft, 0.0, 0.0, in_world=False))


def _joined(
    name: str, generation: Literal["1", "2"], clock: PacedClock | None = None, sim_time: bool = False
) -> Middleware:
    """This process as a node of ROS.

    Args:
        name: of the node.
        generation: of ROS.
        clock: what it lives by; else ROS time.
        sim_time: whether that is the topic /clock's, which ROS 1 says by itself.
    """
    if generation == "2":
        return RclpyMiddleware(name, clock, sim_time)
    if sim_time:
        raise SpecError("--sim-time is for --ros 2; leave it out")
    return RospyMiddleware(name, clock)


def _require_topics(*names: str) -> None:
    """Raise SpecError for a name that no topic of ROS has."""
    token = r"[A-Za-z_{][A-Za-z0-9_{}]*"  # with substitutions of ROS 2, as {node}
    for name in names:
        if not re.fullmatch(rf"~?/?{token}(/{token})*", name):
            raise SpecError(f"'{name}' is no topic of ROS; give letters, digits and _, as in /aerobat/goal")


def _crazyflie(options: RosNodeOptions) -> str:
    """The name of a Crazyflie behind crazyswarm2's server that is a node's goal, else nothing."""
    if not options.goal.startswith(PREFIX):
        return ""
    if options.generation == "1":
        raise SpecError("crazyswarm2 is a server of ROS 2; leave --ros 1 out")
    return options.goal.removeprefix(PREFIX)


def _odometry(options: RosNodeOptions, crazyflie: str) -> str:
    """The topic of the vehicle's state. Raises SpecError where one is named beside a Crazyflie's own."""
    if not crazyflie:
        return ODOMETRY if options.odometry is None else options.odometry
    if options.odometry is not None:
        raise SpecError(f"--odometry is not for a Crazyflie, whose own is {crazyflie}/odom; leave it out")
    return f"{crazyflie}/odom"


def _paper_maneuvers(gravity: float) -> dict[str, Problem]:
    """The problems of the paper's services, under the gravity [m/s²] that the vehicle flies in."""
    problems = {service: load_problem(name) for service, name in MANEUVERS.items()}
    return {
        service: replace(problem, environment=replace(problem.environment, gravity=gravity))
        for service, problem in problems.items()
    }


def _services(problems: Sequence[str]) -> dict[str, str]:
    """The problems by the services that fly them. Raises SpecError for a service that there cannot be."""
    found: dict[str, str] = {}
    for name in dict.fromkeys(problems):
        service = re.sub("[^A-Za-z0-9]", "_", Path(name).stem)
        fault = None
        if service in OWN_SERVICES:
            fault = "is the node's own"
        elif not service[:1].isalpha():
            fault = "does not begin with a letter"
        elif service in found:
            fault = f"is that of {found[service]}"
        if fault is not None:
            raise SpecError(f"the service /aerobat/{service} {fault}; give {name} another name")
        found[service] = name
    return found


def _planner(problem: Problem, vehicle: Vehicle, options: RosOptions) -> Planner:
    name = options.planner or suited_planner(problem, vehicle)
    reserve: dict[str, float] = {"reserve": options.reserve}
    return planner_class(name)(**reserve)
