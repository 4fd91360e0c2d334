"""The node that flies maneuvers on demand: services, goals at a fixed rate, and states from odometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.interchange.ros import NANOSECONDS, Messages, PlanMessages, RosMessage
from aerobat.links.commander import Commander, Doing, rehearse
from aerobat.links.goals import PathGoal, PathPiece, yaw_of
from aerobat.links.mission import Mission, MissionSettings, Phase
from aerobat.links.report import LinkReport, link_report
from aerobat.links.ros import topics
from aerobat.links.ros.middleware import Answer, Middleware
from aerobat.links.ros.preparation import ManeuverRequest, Prepared, prepare, shared_gravity
from aerobat.planning import Planner
from aerobat.problem import Problem
from aerobat.vehicle import Vehicle

OWN_SERVICES = ("takeoff", "hold", "land")  # besides those of maneuvers
_MAX_AHEAD = 0.1  # [s] largest lead of another machine's clock


@dataclass(frozen=True)
class NodeSettings:
    """Settings of the node."""

    rate: float = 100.0  # [1/s] of goals
    takeoff_height: float = 3.0  # [m]
    in_world: bool = False  # whether gates and goals keep their world positions, or move with the start
    with_jerk: bool = True  # whether goals contain the jerk, as a second joint
    in_pieces: bool = False  # whether plans are for a Crazyflie that flies polynomial pieces by itself
    goal: str = topics.GOAL
    odometry: str = topics.ODOMETRY
    mission: MissionSettings = field(default_factory=MissionSettings)


class Tick(NamedTuple):
    """The orders that are due at one tick, for the component that flies the vehicle."""

    commander: Commander  # what the vehicle does, on which route, and its last state
    piece: PathPiece | None  # the piece of the path that begins; None where there is no goal
    now: float  # [s]
    stamp: int  # [ns] start of the piece, in ROS time
    flown: Prepared | None  # the maneuver that is being flown
    is_flown: bool  # true during the plan itself, not on the way to its start or in the hover at its end


class ManeuverNode:
    """The node; call `tick` at its rate. Its clock begins with its creation."""

    def __init__(
        self,
        ros: Middleware,
        vehicle: Vehicle,
        maneuvers: Mapping[str, tuple[Problem, Planner]],
        executor: Executor,
        settings: NodeSettings = NodeSettings(),
        say: Callable[[str], None] = lambda sentence: None,
        take: Callable[[Tick], None] | None = None,
    ) -> None:
        """Offer the services.

        Args:
            ros: access to ROS 1 or ROS 2.
            vehicle: the vehicle.
            maneuvers: problems and their planners by the names of their services.
            executor: for planning in another process.
            settings: of the node.
            say: receives sentences about the progress.
            take: flies the vehicle instead of the topic of goals; called at every tick.

        Raises SpecError for maneuvers of different gravities.
        """
        self.origin = ros.time()  # [ns]
        self._ros = ros
        self.settings = settings
        gravity = shared_gravity(problem for problem, _ in maneuvers.values())
        rehearse(vehicle, gravity)
        self.commander = Commander(vehicle, gravity, 1.0 / settings.rate, say)
        self._vehicle, self._maneuvers, self._executor = vehicle, maneuvers, executor
        self._messages, self._say, self._period = Messages(ros.make), say, 1.0 / settings.rate
        self._take = take or partial(self._send, ros.publisher(settings.goal, topics.KIND_OF_GOAL))
        self._send_markers = ros.publisher(topics.MARKERS, topics.KIND_OF_MARKERS, latched=True)
        self._send_report = ros.publisher(topics.REPORT, topics.KIND_OF_REPORT, latched=True)
        self._now = 0.0  # [s] time of the last tick
        self._last: tuple[float, PathGoal] | None = None  # the previous goal and its time [s]
        self._planning: tuple[Future[Prepared | str], Answer] | None = None
        self._flown: Prepared | None = None  # the maneuver that is being flown
        self._judging: Future[LinkReport] | None = None  # the report of the last maneuver
        self._left_out: set[str] = set()  # the reasons why odometry was ignored, each reported once
        ros.subscribe(settings.odometry, topics.KIND_OF_ODOMETRY, self._take_odometry, every=False)
        for name in maneuvers:
            ros.offer(f"/aerobat/{name}", partial(self._take_request, partial(self._plan, name)))
        ros.offer("/aerobat/takeoff", partial(self._take_request, self._take_off))
        for name, order in (("hold", self.commander.hover), ("land", self.commander.land)):
            ros.offer(f"/aerobat/{name}", partial(self._take_request, partial(self._obey, name, order)))

    def tick(self, now: float) -> None:
        """Advance to this time [s]: begin a maneuver that has been planned, and send the due goal."""
        self._now = now
        if self._planning is not None and self._planning[0].done():
            (planned, answer), self._planning = self._planning, None
            self._begin(planned.result(), answer)
        goal = self.commander.step(now, (self._ros.time() - self.origin) / NANOSECONDS - now)
        piece = None
        if goal is not None and self._last is not None:
            stamp, before = self._last
            piece = PathPiece(before, goal, stamp, now + self._period - stamp)
        self._take(self._due(piece, now))
        self._last = None if goal is None else (now + self._period, goal)
        self._publish_report()

    def _due(self, piece: PathPiece | None, now: float) -> Tick:
        commander, mission = self.commander, self.commander.mission
        maneuvers = commander.doing is Doing.MANEUVERING
        return Tick(
            commander,
            piece,
            now,
            stamp=self.origin + round((now if piece is None else piece.stamp) * NANOSECONDS),
            flown=self._flown if maneuvers else None,
            is_flown=maneuvers and mission is not None and mission.phase is Phase.MANEUVER,
        )

    def _send(self, publish: Callable[[object], None], tick: Tick) -> None:
        """Publish a piece of a path, if there is one."""
        if tick.piece is not None:
            publish(topics.goal_message(self._messages, tick.piece, tick.stamp, self.settings.with_jerk))

    def _publish_report(self) -> None:
        """Have a maneuver judged once it has ended, and publish the report."""
        if self._flown is not None and self.commander.doing is not Doing.MANEUVERING:
            mission = self.commander.mission
            assert mission is not None, "maneuvers are missions"
            self._judging = self._executor.submit(
                link_report,
                self._flown.plan,
                self._flown.stream,
                mission.log,
                aborted=mission.reason,
                ended=str(self.commander.doing),
                delay=0.0,
                late=mission.max_lateness,
            )
            self._flown = None
        if self._judging is not None and self._judging.done():
            sentence, self._judging = str(self._judging.result()), None
            self._say(sentence)
            self._send_report(self._messages.make(topics.KIND_OF_REPORT, data=sentence))

    def _take_odometry(self, message: RosMessage) -> None:
        """Process a state, unless it is implausible."""
        observed = topics.read_odometry(message, self.origin)
        if observed is None:
            self._report_ignored("is not finite, or its attitude no unit quaternion; see to the estimator")
        elif observed.time > (self._ros.time() - self.origin) / NANOSECONDS + _MAX_AHEAD:
            self._report_ignored("is stamped later than now; set the clocks alike")
        else:
            self.commander.observe(observed)

    def _report_ignored(self, reason: str) -> None:
        """Report once that odometry of a kind is ignored."""
        if reason not in self._left_out:
            self._left_out.add(reason)
            self._say(f"odometry is left out that {reason}")

    def _take_request(self, obey: Callable[[Answer], None], answer: Answer) -> None:
        """Execute a request, or answer with the reason why not."""
        try:
            obey(answer)
        except SpecError as error:
            answer(False, str(error))

    def _take_off(self, answer: Answer) -> None:
        self.commander.take_off(self._now, self.settings.takeoff_height)
        self._give_up_planning("takeoff was called")
        answer(True, f"climbing by {self.settings.takeoff_height:g} m")

    def _obey(self, service: str, order: Callable[[float], None], answer: Answer) -> None:
        """Execute an order that ends the planning of a maneuver."""
        self._give_up_planning(f"{service} was called")
        order(self._now)
        answer(True, str(self.commander.doing))

    def _give_up_planning(self, reason: str) -> None:
        """Answer the request of a maneuver that is being planned, if there is one: it will not begin."""
        if self._planning is not None:
            (_, waiting), self._planning = self._planning, None
            waiting(False, f"the maneuver is given up: {reason}")

    def _plan(self, name: str, answer: Answer) -> None:
        """Have a maneuver planned from where the vehicle hovers."""
        if self._planning is not None:
            raise SpecError("a maneuver is being planned; wait for it")
        observed = self.commander.require_hover(self._now)
        problem, planner = self._maneuvers[name]
        request = ManeuverRequest(
            problem,
            self._vehicle,
            planner,
            position=np.array(observed.body.position),
            yaw=yaw_of(observed.body.q_world_body),
            ground=self.commander.ground,
            in_world=self.settings.in_world,
            in_pieces=self.settings.in_pieces,
        )
        self._planning = self._executor.submit(prepare, request), answer

    def _begin(self, planned: Prepared | str, answer: Answer) -> None:
        """Begin a planned maneuver, or answer with the reason why not."""
        if isinstance(planned, str):
            answer(False, planned)
            return
        stream = planned.stream  # the vehicle's own controller handles errors
        mission = Mission(planned.plan, self.settings.mission, stream, lambda time, _: stream.goal(time))
        try:
            self.commander.begin(self._now, mission)
        except SpecError as error:
            answer(False, str(error))
            return
        self._publish_markers(planned)
        self._flown = planned
        self._say(planned.announcement)
        answer(True, planned.announcement)

    def _publish_markers(self, planned: Prepared) -> None:
        """Publish markers of the path, its gates and the vehicle along it, in place of earlier markers."""
        stamp = self.origin + round(self._now * NANOSECONDS)
        shown = PlanMessages(self._messages, planned.plan, stamp, planned.stream.offset)
        kind = "visualization_msgs/msg/Marker"
        wipe = self._messages.make(kind, header=self._messages.header(stamp), action=3)  # DELETEALL
        lines = shown.lines(reference(planned.plan, rate=50.0))
        discs = [disc for _, found in shown.snapshots(every=0.15) for disc in found]
        markers = self._messages.make(topics.KIND_OF_MARKERS, markers=[wipe, *lines, *discs])
        self._send_markers(markers)
