"""ROS messages for bags and for live nodes of ROS 1 and ROS 2."""

from aerobat.interchange.ros.messages import BODY as BODY
from aerobat.interchange.ros.messages import NANOSECONDS as NANOSECONDS
from aerobat.interchange.ros.messages import JointMotion as JointMotion
from aerobat.interchange.ros.messages import Messages as Messages
from aerobat.interchange.ros.messages import RosMessage as RosMessage
from aerobat.interchange.ros.plan_messages import PlanMessages as PlanMessages
from aerobat.interchange.ros.plan_messages import Stamped as Stamped
