"""A maneuver that is planned and flown anew whenever somebody moves a slider of its page."""
