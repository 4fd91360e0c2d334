"""A simulated vehicle with an autopilot of its own, to be flown live by whichever link."""
