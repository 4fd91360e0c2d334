"""A simulated vehicle with its own autopilot, to be flown live over any link."""
