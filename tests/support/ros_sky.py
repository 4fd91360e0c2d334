"""Both ROS nodes in one process, in steps of a clock that nobody waits for; messages travel as bytes."""

from __future__ import annotations

import copy
from collections import defaultdict, deque
from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.interchange.exports.bags import StoredTypes
from aerobat.interchange.ros import Messages
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.commander import Doing
from aerobat.links.goals import PathPiece
from aerobat.links.mission import Phase
from aerobat.links.ros import topics
from aerobat.links.ros.crazyswarm import Crazyflie
from aerobat.links.ros.crazyswarm_server import CrazyswarmServer
from aerobat.links.ros.maneuver_node import ManeuverNode, NodeSettings
from aerobat.links.ros.middleware import Answer
from aerobat.links.ros.preparation import MANEUVERS
from aerobat.links.ros.vehicle_node import VehicleNode
from aerobat.states import BodyState

STEP = 2_000_000  # [ns]
VEHICLE_STEPS, NODE_STEPS = 2, 5  # between ticks of either: 250 and 100 a second
BEGAN = 1_700_000_000 * 10**9  # [ns] ROS time at first

TYPES = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
CRAZYFLIE_INTERFACES = {  # as crazyswarm2 has them
    "FullState": "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist\n"
    "geometry_msgs/Vector3 acc",
    "TrajectoryPolynomialPiece": "float32[] poly_x\nfloat32[] poly_y\nfloat32[] poly_z\n"
    "float32[] poly_yaw\nbuiltin_interfaces/Duration duration",
    "Takeoff": "uint8 group_mask\nfloat32 height\nbuiltin_interfaces/Duration duration",
    "Land": "uint8 group_mask\nfloat32 height\nbuiltin_interfaces/Duration duration",
    "GoTo": "uint8 group_mask\nbool relative\ngeometry_msgs/Point goal\nfloat32 yaw\n"
    "builtin_interfaces/Duration duration",
    "UploadTrajectory": "uint8 trajectory_id\nuint32 piece_offset\n"
    "crazyflie_interfaces/TrajectoryPolynomialPiece[] pieces",
    "StartTrajectory": "uint8 group_mask\nuint8 trajectory_id\nfloat32 timescale\nbool reversed\n"
    "bool relative",
    "NotifySetpointsStop": "uint8 group_mask\nuint32 remain_valid_millisecs",
}
for name, fields in CRAZYFLIE_INTERFACES.items():
    TYPES[2].register(get_types_from_msg(fields, f"crazyflie_interfaces/msg/{name}"))


class Graph:
    """The topics and services of a network, which carries bytes; what is sent arrives a step later."""

    def __init__(self, generation: int) -> None:
        self.generation = generation
        self.time = BEGAN
        self.takers: dict[str, list[tuple[str, Callable[[Any], None]]]] = defaultdict(list)
        self.services: dict[str, Callable[[Answer], None]] = {}
        self.sent: deque[tuple[str, str, bytes]] = deque()
        self.cut: set[str] = set()  # topics that reach nobody
        self.change: dict[str, Callable[[Any], list[Any]]] = {}  # of a topic's messages, as somebody likes

    def encode(self, message: Any, kind: str) -> bytes:
        store = TYPES[self.generation]
        return bytes(
            store.serialize_ros1(message, kind)
            if self.generation == 1
            else store.serialize_cdr(message, kind)
        )

    def decode(self, data: bytes, kind: str) -> Any:
        store = TYPES[self.generation]
        return (store.deserialize_ros1 if self.generation == 1 else store.deserialize_cdr)(data, kind)

    def deliver(self) -> None:
        """Hand on what was sent before."""
        for _ in range(len(self.sent)):
            topic, kind, data = self.sent.popleft()
            change = self.change.get(topic, lambda message: [message])
            for kind_taken, take in self.takers[topic]:
                assert kind_taken == kind
                if topic not in self.cut:
                    for message in change(self.decode(data, kind)):
                        take(message)


def request_of(service: str) -> str:
    """The kind of message by which a service's requests travel here."""
    return service.replace("/srv/", "/msg/")


class Sender:
    """What sends messages of a topic."""

    def __init__(self, graph: Graph, topic: str, kind: str) -> None:
        self._graph, self._topic, self._kind = graph, topic, kind

    def __call__(self, message: Any) -> None:
        self._graph.sent.append((self._topic, self._kind, self._graph.encode(message, self._kind)))


class Ros:
    """A node's access to the graph."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph

    def make(self, kind: str, /, **given: Any) -> Any:
        arrays = {name: np.array(x, np.float32) for name, x in given.items() if name.startswith("poly_")}
        return StoredTypes(TYPES[self._graph.generation])(kind, **{**given, **arrays})

    def time(self) -> int:
        return self._graph.time

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Sender:
        return Sender(self._graph, topic, kind)

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None], every: bool = True) -> None:
        self._graph.takers[topic].append((kind, take))

    def offer(self, service: str, take: Callable[[Answer], None]) -> None:
        self._graph.services[service] = take

    def client(self, service: str, kind: str) -> Callable[..., None]:
        return partial(self._ask, service, request_of(kind))

    def _ask(self, service: str, request: str, **given: Any) -> None:
        self.publisher(service, request)(self.make(request, **given))

    def serve(self, service: str, kind: str, take: Callable[[Any], None]) -> None:
        self.subscribe(service, request_of(kind), take)

    def work_until(self, instant: int, patience: float = np.inf) -> None:
        raise AssertionError("nothing waits here")

    def close(self) -> None:
        pass


class Reply:
    """What a service answered."""

    def __init__(self) -> None:
        self.success: bool | None = None
        self.sentence = ""

    def __call__(self, success: bool, sentence: str) -> None:
        assert self.success is None, "answered twice"
        self.success, self.sentence = success, sentence


class AtOnce(Executor):
    """Does what is submitted when it is submitted."""

    def submit(self, function: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        return Done(function(*args, **kwargs))  # type: ignore[return-value]


class Done:
    """A future that is past, and has no locks, so that it can be copied."""

    def __init__(self, value: Any) -> None:
        self._value = value

    def done(self) -> bool:
        return True

    def result(self) -> Any:
        return self._value


class Sky:
    """Both nodes, and what really happened."""

    def __init__(
        self,
        vehicle: str = "agile-quad",
        *,
        generation: int = 2,
        settings: NodeSettings | None = None,
        flying: ab.Vehicle | None = None,
        crazyflie: str = "",
    ) -> None:
        planned = ab.load_vehicle(vehicle)
        self.graph = Graph(generation)
        self.said: list[str] = []
        self.vehicle = SimulatedVehicle(planned if flying is None else flying, Environment())
        ros, taken = Ros(self.graph), None
        if crazyflie:
            self.vehicle_node: VehicleNode = CrazyswarmServer(ros, self.vehicle, crazyflie, say=self.note)
            settings = replace(settings or NodeSettings(), odometry=f"{crazyflie}/odom")
            taken = Crazyflie(ros, crazyflie).take
        else:
            self.vehicle_node = VehicleNode(ros, self.vehicle, say=self.note)
        planner = ab.Miqp(reserve=0.15)
        maneuvers = {name: (ab.load_problem(problem), planner) for name, problem in MANEUVERS.items()}
        settings = NodeSettings() if settings is None else settings
        self.node = ManeuverNode(Ros(self.graph), planned, maneuvers, AtOnce(), settings, self.note, taken)
        self.node_lives = self.vehicle_runs = True
        self.goals: list[PathPiece] = []
        self.shown: list[Any] = []  # arrays of markers
        self.reports: list[str] = []
        self.heights: list[float] = []  # [m] at every tick of the vehicle
        self.errors: list[float] = []  # [m] along the plan that is flown
        listener = Ros(self.graph)
        listener.subscribe(topics.GOAL, topics.KIND_OF_GOAL, self._take_goal)
        listener.subscribe(topics.MARKERS, topics.KIND_OF_MARKERS, self._take_markers)
        listener.subscribe(topics.REPORT, topics.KIND_OF_REPORT, self._take_report)

    def note(self, sentence: str) -> None:
        """Take a sentence of either."""
        self.said.append(sentence)

    def branched(self) -> Sky:
        """The same, to go on by itself."""
        return copy.deepcopy(self, {id(part): part for part in (self.vehicle._body._loop,)})

    @property
    def now(self) -> float:
        """Since both began [s]."""
        return (self.graph.time - BEGAN) / 1e9

    def take_off(self) -> None:
        """Have it hover."""
        self.run_for(0.1)
        assert self.call("takeoff").success
        self.run(lambda: self.node.commander.doing is Doing.HOVERING)
        self.run_for(1.0)

    def call(self, service: str) -> Reply:
        """Ask, and go on until it is answered."""
        reply = Reply()
        self.graph.services[f"/aerobat/{service}"](reply)
        self.run(lambda: reply.success is not None)
        return reply

    def run(self, until: Callable[[], bool], limit: float = 40.0) -> None:
        """Go on until something holds, for no longer than so many seconds."""
        end = self.now + limit
        while not until():
            assert self.now < end, f"not reached: {self.said}"
            self.graph.time += STEP
            self.graph.deliver()
            step = round((self.graph.time - BEGAN) / STEP)
            if step % VEHICLE_STEPS == 0 and self.vehicle_runs:
                self.vehicle_node.tick(self.now)
                self._note()
            if step % NODE_STEPS == 0 and self.node_lives:
                self.node.tick(self.now)

    def run_for(self, seconds: float) -> None:
        """Go on for a time [s]."""
        end = self.now + seconds
        self.run(lambda: self.now >= end - 1e-9, limit=2 * seconds)

    def run_into_the_plan(self, seconds: float) -> None:
        """Go on until the plan is flown for so long [s]."""
        self.run(lambda: self.since_begin >= seconds)

    @property
    def since_begin(self) -> float:
        """Since the plan's begin [s], NaN before it."""
        mission = self.node.commander.mission
        return np.nan if mission is None else self.now - mission.maneuver_began

    @property
    def state(self) -> BodyState:
        """The true one."""
        return self.vehicle.state

    @property
    def position(self) -> Array:
        """The true one [m]."""
        return self.vehicle.state.position

    @property
    def hovers(self) -> bool:
        """True of a vehicle that stands in the air, upright."""
        is_still = float(np.linalg.norm(self.state.velocity)) < 0.05
        is_upright = so3.thrust_axis(self.state.q_world_body)[2] > 0.999
        return is_still and is_upright and not self.vehicle.landed and not self.vehicle.crashed

    @property
    def stands(self) -> bool:
        """True of a vehicle that has landed, unhurt, its rotors stopped."""
        return self.vehicle.landed and not self.vehicle.armed and not self.vehicle.crashed

    def send(self, piece: PathPiece) -> None:
        """Send a goal as if the node had."""
        ros = Ros(self.graph)
        stamp = BEGAN + round(piece.stamp * 1e9)
        message = topics.goal_message(Messages(ros.make), piece, stamp)
        ros.publisher(topics.GOAL, topics.KIND_OF_GOAL)(message)

    def _note(self) -> None:
        self.heights.append(float(self.position[2]))
        mission = self.node.commander.mission
        if mission is not None and mission.phase is Phase.MANEUVER and self.node_lives:
            since = self.vehicle.time - mission.maneuver_began
            if 0.0 <= since <= mission.stream.duration:
                off = self.position - mission.stream.flat(since).position
                self.errors.append(float(np.linalg.norm(off)))

    def _take_goal(self, message: Any) -> None:
        piece = topics.read_goal(message, BEGAN)
        self.goals += [] if piece is None else [piece]

    def _take_markers(self, message: Any) -> None:
        self.shown.append(message)

    def _take_report(self, message: Any) -> None:
        self.reports.append(message.data)


@cache
def _aloft(vehicle: str, generation: int) -> Sky:
    sky = Sky(vehicle, generation=generation)
    sky.take_off()
    return sky


def aloft(vehicle: str = "agile-quad", generation: int = 2) -> Sky:
    """A vehicle that has taken off and hovers."""
    return _aloft(vehicle, generation).branched()


@cache
def _crazyflie_aloft(in_pieces: bool) -> Sky:
    sky = Sky("crazyflie", crazyflie="/cf231", settings=NodeSettings(in_pieces=in_pieces))
    sky.take_off()
    return sky


def crazyflie_aloft(in_pieces: bool) -> Sky:
    """A Crazyflie behind crazyswarm2's server that has taken off and hovers."""
    return _crazyflie_aloft(in_pieces).branched()


@cache
def _at_the_flips_begin() -> Sky:
    sky = aloft()
    assert sky.call("flip").success
    sky.run_into_the_plan(0.0)
    return sky


def at_the_flips_begin() -> Sky:
    """A flip in roll that just begins."""
    return _at_the_flips_begin().branched()
