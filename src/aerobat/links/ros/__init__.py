"""ROS 1 and ROS 2, by one core: a node that flies maneuvers on demand, and a simulated vehicle for it."""
