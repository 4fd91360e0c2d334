"""ROS 1 by rospy, from the installation that the interpreter finds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

from aerobat.errors import BackendMissing, SpecError
from aerobat.links.ros.middleware import NEWEST, QUEUE, Answer, Middleware, PacedClock, interface_class

_SIM_TIME = "/use_sim_time"  # the parameter that nodes read when they start


class RospyMiddleware(Middleware):
    """A node of ROS 1; see `Middleware`."""

    def __init__(self, name: str, clock: PacedClock | None = None) -> None:
        """Register with the master.

        Raises SpecError where no master answers or time stands still, BackendMissing without rospy.

        Args:
            name: of the node.
            clock: the clock of this node and of all nodes started later; None for ROS time.
        """
        super().__init__(clock)
        self._rospy = rospy = _rospy()
        import rosgraph

        if not rosgraph.is_master_online():
            raise SpecError(f"no ROS master answers at {rosgraph.get_master_uri()}; start roscore first")
        rospy.init_node(name, disable_signals=True)
        if clock is not None:
            rospy.set_param(_SIM_TIME, True)
        self.require_time()

    @staticmethod
    def make(kind: str, /, **given: Any) -> Any:
        """See `Make.__call__`."""
        package, _, name = kind.split("/")
        if package == "builtin_interfaces":
            return getattr(import_module("genpy"), name)(given["sec"], given["nanosec"])
        return interface_class(kind)(**given)

    def ros_time(self) -> int:
        """See `Middleware.ros_time`."""
        return int(self._rospy.get_rostime().to_nsec())

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Callable[[Any], None]:
        """See `Middleware.publisher`."""
        publish: Callable[[Any], None] = self._rospy.Publisher(
            topic, interface_class(kind), queue_size=QUEUE, latch=latched, tcp_nodelay=True
        ).publish
        return publish

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None], every: bool = True) -> None:
        """See `Middleware.subscribe`."""
        self._rospy.Subscriber(
            topic,
            interface_class(kind),
            partial(self.request, take),
            queue_size=None if every else NEWEST,
            tcp_nodelay=True,
        )

    def offer(self, service: str, take: Callable[[Answer], None]) -> None:
        """See `Middleware.offer`."""
        srv = import_module("std_srvs.srv")

        def respond(_request: Any) -> Any:
            success, sentence = self.answer(take)
            return srv.TriggerResponse(success=success, message=sentence)

        self._rospy.Service(service, srv.Trigger, respond)

    def close(self) -> None:
        """See `Middleware.close`."""
        super().close()
        if self._clock is not None:
            self._rospy.delete_param(_SIM_TIME)
        self._rospy.signal_shutdown("done")


def _rospy() -> Any:
    try:
        return import_module("rospy")
    except ImportError as error:
        raise BackendMissing(
            f"ROS 1 needs rospy, which this Python does not find ({error}): source "
            "/opt/ros/noetic/setup.bash, or apt-get install python3-rospy, and run aerobat with that Python"
        ) from None
