"""A session with a real ROS: both nodes in processes of their own, and this one, which watches the topics.

python tests/support/ros_session.py ros1|ros2

Run by .ci/run with an interpreter that has that ROS and aerobat; ends with 1 where something does not hold,
with 75 where it waited in vain. The vehicle's clock waits for goals that are late, so that a busy machine
takes longer, and no more.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from math import hypot
from threading import Thread
from typing import Any, TypeAlias

import numpy as np

from aerobat import so3
from aerobat.links.goals import Observed, PathPiece
from aerobat.links.ros import topics
from aerobat.links.ros.middleware import Middleware

SPEED = "1"  # times the wall's, at most
ANSWERED = 60.0  # [s] of the wall, for which a plan may take on a busy machine
ANSWERED_AT_ONCE = 10.0  # [s] of the wall, for which any other order may take there
PLANNED = ("/aerobat/flip", "/aerobat/window")
LONG = 30.0  # [s] of the vehicle's time, for a take-off or a landing
TRIES = 4  # of either
LONG_ENOUGH = 30.0  # [s] of goals
MORE = 0.02  # [m] that a flight by topics may be off more than one in process, which is off by 0.01 mm


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def process(*command: str, says: str = "") -> Iterator[subprocess.Popen[str]]:
    """A process in the background, once it has said something; of a failed session it tells where it is."""
    with tempfile.TemporaryFile("w+") as log:
        started = subprocess.Popen(command, stdout=log, stderr=log, text=True, start_new_session=True)

        def said() -> str:
            log.seek(0)
            return log.read()

        try:
            wait(lambda: says in said() or started.poll() is not None, f"{command} to begin")
            assert started.poll() is None, said()
            yield started
        except BaseException:
            started.send_signal(signal.SIGABRT)  # tells where each of its threads is
            raise
        finally:
            started.send_signal(signal.SIGINT)
            try:
                started.wait(20)
            except subprocess.TimeoutExpired:
                os.killpg(started.pid, signal.SIGKILL)
            print(f"-- {' '.join(command[-3:])}\n{said()}", flush=True)


def wait(until: Callable[[], bool], what: str, limit: float = 120.0) -> None:
    """Wait for something, for no longer than so many seconds of the wall."""
    end = time.monotonic() + limit
    while not until():
        if time.monotonic() > end:
            raise TimeoutError(f"waited in vain for {what}")
        time.sleep(0.05)


class Watch:
    """All that was seen on the topics; times are since an instant [s]."""

    def __init__(self, ros: Middleware) -> None:
        self._ros = ros
        self.origin = time.time_ns() - 10**9
        self.goals: list[PathPiece] = []
        self.states: list[Observed] = []
        self.reports: list[str] = []
        self.markers: list[Any] = []
        ros.subscribe(topics.GOAL, topics.KIND_OF_GOAL, self._take_goal)
        ros.subscribe(topics.ODOMETRY, topics.KIND_OF_ODOMETRY, self._take_odometry)
        ros.subscribe(topics.REPORT, topics.KIND_OF_REPORT, lambda message: self.reports.append(message.data))
        ros.subscribe(topics.MARKERS, topics.KIND_OF_MARKERS, self.markers.append)

    def wait(self, until: Callable[[], bool], what: str) -> None:
        """Take messages until something holds."""

        def holds() -> bool:
            self._ros.work_until(0)  # what has come, whether or not time goes on
            return until()

        wait(holds, what)

    def wait_for(self, seconds: float) -> None:
        """Take messages for a time of the vehicle's [s]."""
        self.wait(self.passed(seconds), f"{seconds} s to pass")

    def passed(self, seconds: float, unless: Callable[[], bool] = lambda: False) -> Callable[[], bool]:
        """True once so much of the vehicle's time [s] has passed, or something holds."""
        end = self.now + seconds
        return lambda: self.now >= end or unless()

    @property
    def now(self) -> float:
        """The vehicle's time [s]."""
        return self.states[-1].time if self.states else 0.0

    @property
    def up(self) -> float:
        """The vertical part of the vehicle's thrust axis."""
        return float(so3.thrust_axis(np.array(self.states[-1].body.q_world_body))[2])

    @property
    def hovers(self) -> bool:
        """True of a vehicle that stands in the air, upright."""
        body = self.states[-1].body
        return hypot(*body.velocity) < 0.1 and body.position[2] > 0.3 and self.up > 0.99

    def _take_goal(self, message: Any) -> None:
        piece = topics.read_goal(message, self.origin)
        assert piece is not None, "a goal is malformed"
        self.goals.append(piece)

    def _take_odometry(self, message: Any) -> None:
        seen = topics.read_odometry(message, self.origin)
        assert seen is not None, "odometry is no vehicle's"
        self.states.append(seen)


Ask = Callable[[str], tuple[bool, str]]


def ros1_services() -> Ask:
    """What calls services of ROS 1."""
    import rospy
    from std_srvs.srv import Trigger

    def ask(service: str) -> tuple[bool, str]:
        rospy.wait_for_service(service, ANSWERED)
        answers: list[Any] = []
        Thread(target=lambda: answers.append(rospy.ServiceProxy(service, Trigger)()), daemon=True).start()
        wait(lambda: bool(answers), f"an answer of {service}", ANSWERED)
        return answers[0].success, answers[0].message

    return ask


def ros2_services(node: Any) -> Ask:
    """What calls services of ROS 2, of a node that is spun."""
    from std_srvs.srv import Trigger

    def ask(service: str) -> tuple[bool, str]:
        client = node.create_client(Trigger, service)
        for _ in range(TRIES):  # a server that was killed is known for a while, and may have been asked
            assert client.wait_for_service(ANSWERED), service
            answered = client.call_async(Trigger.Request())
            end = time.monotonic() + (ANSWERED if service in PLANNED else ANSWERED_AT_ONCE)
            while not answered.done() and time.monotonic() < end:
                time.sleep(0.05)
            if answered.done():
                answer = answered.result()
                return answer.success, answer.message
        raise TimeoutError(f"asked in vain for {service}")

    return ask


def asked(ask: Ask, service: str) -> None:
    """Have a service succeed; it is asked again where the node has not yet heard of the vehicle."""
    success, sentence = ask(f"/aerobat/{service}")
    for _ in range(100):
        if "nothing was heard" not in sentence:
            break
        time.sleep(0.2)
        success, sentence = ask(f"/aerobat/{service}")
    print(f"{service}: {sentence}", flush=True)
    assert success or " is climbing already" in sentence or " is landing" in sentence, sentence


def brought(watch: Watch, ask: Ask, service: str, there: Callable[[], bool]) -> None:
    """Have the vehicle brought up or down.

    Where it has not yet found who sends goals it does not move, and the node leaves it to itself: then again.
    """
    watch.goals.clear()
    for _ in range(TRIES):
        asked(ask, service)
        watch.wait(watch.passed(LONG, there), service)
        if there():
            return
        watch.goals.clear()
    raise AssertionError(f"{service} has led nowhere")


def whole(goals: list[PathPiece], waits: bool = True) -> float:
    """The time [s] that goals last: each begins when and where the one before ends, so that none was lost.

    From where the vehicle obeys, and time `waits` for goals, they are a period long.
    """
    for before, after in pairwise(goals):
        assert abs(before.stamp + before.duration - after.stamp) < 1e-6, (before.stamp, after.stamp)
        if waits and after.begin.position[2] > 0.1:
            assert abs(after.duration - 0.01) < 1e-6, after
        np.testing.assert_allclose(after.begin.position, before.end.position, atol=1e-9)
    return goals[-1].stamp - goals[0].stamp


def fly(watch: Watch, ask: Ask, node: Callable[[], Any]) -> None:
    """All that must hold.

    Args:
        watch: of the topics.
        ask: what calls services.
        node: what starts a node that flies maneuvers.
    """
    watch.wait(lambda: bool(watch.states), "odometry")
    with node() as killed:
        refused, why = ask("/aerobat/flip")
        assert not refused, why
        brought(watch, ask, "takeoff", lambda: bool(watch.goals) and watch.hovers)
        watch.wait_for(2.0)
        asked(ask, "flip")
        watch.wait(lambda: bool(watch.reports), "a report")
        (report,) = watch.reports
        flown = re.fullmatch(
            r"flown within ([\d.]+) (m|cm|mm) of the plan, through gate .*; hovering", report
        )
        assert flown, report
        error = float(flown[1]) * {"m": 1.0, "cm": 1e-2, "mm": 1e-3}[flown[2]]
        assert error < MORE, report
        assert {marker.ns for marker in watch.markers[-1].markers} >= {"path", "gate", "vehicle: start"}
        watch.wait(lambda: watch.goals[-1].stamp - watch.goals[0].stamp > LONG_ENOUGH, "goals enough")
        asked(ask, "window")
        watch.wait(lambda: watch.up < 0.5, "the half-flip")
        os.killpg(killed.pid, signal.SIGKILL)
        killed.wait()
        last = len(watch.goals)
    watch.wait_for(6.0)
    assert watch.hovers, watch.states[-1]
    lasted = whole(watch.goals)
    print(f"{last} goals in {lasted:.1f} s, none lost; {report}; killed in mid-flip, hovers", flush=True)
    with node():
        brought(watch, ask, "land", lambda: watch.states[-1].body.position[2] < 0.01)
        watch.wait_for(2.0)
        assert hypot(*watch.states[-1].body.velocity) < 1e-6


Session: TypeAlias = tuple[Middleware, Watch, Ask, Callable[[], Any]]


@contextmanager
def session(generation: str, speed: str | None) -> Iterator[Session]:
    """ROS, a watch of its topics, what calls services, and what starts a node that flies maneuvers.

    A vehicle stands on the ground; of a given speed it is the clock.
    """
    with ExitStack() as stack:
        link = (sys.executable, "-X", "faulthandler", "-m", "aerobat", "link")
        which = ("--ros", generation[-1])
        options: tuple[str, ...] = ()
        pace = () if speed is None else ("--speed", speed)
        ros: Any
        if generation == "ros1":
            port = str(free_port())
            os.environ |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
            os.environ["ROS_LOG_DIR"] = stack.enter_context(tempfile.TemporaryDirectory())
            stack.enter_context(process("roscore", "-p", port, says="started core service"))
        else:
            domain = str(os.getpid() % 100)
            os.environ |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": domain}
            options = () if speed is None else ("--sim-time",)
        stack.enter_context(process(*link, "ros-vehicle", *which, *pace, says="obeys"))
        if generation == "ros1":
            from aerobat.links.ros.rospy_middleware import RospyMiddleware

            ros, ask = RospyMiddleware("watch"), ros1_services()
        else:
            from aerobat.links.ros.rclpy_middleware import RclpyMiddleware

            ros = RclpyMiddleware("watch")
            ask = ros2_services(ros._node)
        stack.callback(ros.close)
        yield (
            ros,
            Watch(ros),
            ask,
            lambda: process(*link, "ros", *which, *options, says="to look"),
        )


def main(generation: str) -> int:
    """The exit status."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that no process is left
    try:
        with session(generation, SPEED) as (_, watch, ask, node):
            fly(watch, ask, node)
    except TimeoutError:
        traceback.print_exc()
        return os.EX_TEMPFAIL
    print(f"{generation}: all holds", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
