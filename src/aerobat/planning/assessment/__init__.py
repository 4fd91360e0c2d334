"""The assessment of a plan: against a lower bound on durations, and against usual room and rates."""
