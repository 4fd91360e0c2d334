"""Live pages: moving a slider plans and flies the maneuver again."""
