"""MAVLink: our client for an autopilot, and a front end that makes the simulated vehicle one."""
