"""ROS 1 and ROS 2 with common code: a node that flies maneuvers on demand, and a simulated vehicle for it."""
