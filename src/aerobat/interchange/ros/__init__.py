"""ROS messages for bags and for live nodes of ROS 1 and ROS 2."""

from aerobat.interchange.ros.messages import BODY, NANOSECONDS, JointMotion, Messages, RosMessage
from aerobat.interchange.ros.plan_messages import PlanMessages, Stamped

__all__ = [
    "BODY",
    "NANOSECONDS",
    "JointMotion",
    "Messages",
    "PlanMessages",
    "RosMessage",
    "Stamped",
]
