"""ROS 2 by rclpy, from the installation that the interpreter finds."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from threading import Thread
from typing import Any

from aerobat.errors import BackendMissing, SpecError
from aerobat.links.ros.middleware import NEWEST, QUEUE, Answer, Middleware, PacedClock, interface_class

CLOSING_TIME = 2.0  # [s] of the wall for each thread that ends


class RclpyMiddleware(Middleware):
    """A node of ROS 2; see `Middleware`."""

    def __init__(self, name: str, clock: PacedClock | None = None, sim_time: bool = False) -> None:
        """Join the graph. Raises SpecError where time stands still, BackendMissing without rclpy.

        Args:
            name: of the node.
            clock: the clock of the node; None for ROS time.
            sim_time: whether ROS time is that of the topic /clock.
        """
        super().__init__(clock)
        self._rclpy = rclpy = _rclpy()
        from rclpy.callback_groups import ReentrantCallbackGroup
        from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
        from rclpy.parameter import Parameter
        from rclpy.signals import SignalHandlerOptions

        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(name, parameter_overrides=[Parameter("use_sim_time", value=sim_time)])
        # services have a node of their own: an executor that lets them wait is several times slower per
        # message
        self._waiting = rclpy.create_node(f"{name}_services")
        self._services = ReentrantCallbackGroup()
        # at most four services wait for their answers, each in a thread
        self._executors = SingleThreadedExecutor(), MultiThreadedExecutor(4)
        for executor, node in zip(self._executors, (self._node, self._waiting), strict=True):
            executor.add_node(node)
        self._threads = [Thread(target=executor.spin, daemon=True) for executor in self._executors]
        for thread in self._threads:
            thread.start()
        self.require_time()

    @staticmethod
    def make(kind: str, /, **given: Any) -> Any:
        """See `Make.__call__`."""
        return interface_class(kind)(**given)

    def ros_time(self) -> int:
        """See `Middleware.ros_time`."""
        return int(self._node.get_clock().now().nanoseconds)

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Callable[[Any], None]:
        """See `Middleware.publisher`."""
        qos = import_module("rclpy.qos")
        durability = qos.DurabilityPolicy.TRANSIENT_LOCAL if latched else qos.DurabilityPolicy.VOLATILE
        profile = qos.QoSProfile(depth=1 if latched else QUEUE, durability=durability)
        publish: Callable[[Any], None] = self._node.create_publisher(
            interface_class(kind), topic, profile
        ).publish
        return publish

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None], every: bool = True) -> None:
        """See `Middleware.subscribe`."""
        qos = import_module("rclpy.qos")
        reliability = qos.ReliabilityPolicy.RELIABLE if every else qos.ReliabilityPolicy.BEST_EFFORT
        self._node.create_subscription(
            interface_class(kind),
            topic,
            partial(self.request, take),
            qos.QoSProfile(depth=QUEUE if every else NEWEST, reliability=reliability),
        )

    def offer(self, service: str, take: Callable[[Answer], None]) -> None:
        """See `Middleware.offer`."""
        trigger = import_module("std_srvs.srv").Trigger

        def respond(_request: Any, response: Any) -> Any:
            response.success, response.message = self.answer(take)
            return response

        self._waiting.create_service(trigger, service, respond, callback_group=self._services)

    def client(self, service: str, kind: str) -> Callable[..., None]:
        """Return a function that calls a service with its request's fields, without waiting for an answer.

        Raises SpecError where no node offers the service.
        """
        interface = interface_class(kind)
        client = self._waiting.create_client(interface, service, callback_group=self._services)
        if not client.wait_for_service(10.0):  # [s] of the wall
            raise SpecError(f"nobody offers the service {service}; start crazyswarm2's server first")
        return lambda **given: client.call_async(interface.Request(**given))

    def serve(self, service: str, kind: str, take: Callable[[Any], None]) -> None:
        """Offer a service with an empty answer."""

        def respond(request: Any, response: Any) -> Any:
            self.request(take, request)
            return response

        self._waiting.create_service(interface_class(kind), service, respond, callback_group=self._services)

    def close(self) -> None:
        """See `Middleware.close`."""
        super().close()
        for executor in self._executors:
            executor.shutdown(0.0)
        self._rclpy.try_shutdown()
        for thread in self._threads:  # one that runs when the interpreter ends would abort the process
            thread.join(CLOSING_TIME)


def _rclpy() -> Any:
    try:
        return import_module("rclpy")
    except ImportError as error:
        raise BackendMissing(
            f"ROS 2 needs rclpy, which this Python does not find ({error}): source "
            "/opt/ros/DISTRIBUTION/setup.bash, and run aerobat with the Python of that distribution"
        ) from None
