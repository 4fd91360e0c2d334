"""ROS 1 and ROS 2, one core and two adapters: a node that flies maneuvers on demand, a simulated vehicle for it."""
