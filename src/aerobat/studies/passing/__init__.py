"""Plans that pass with the probability asked: plan, fly, tighten, and prove it on fresh flights."""

from aerobat.studies.passing.passing import plan_to_pass
from aerobat.studies.passing.result import Passing, Round

__all__ = ["Passing", "Round", "plan_to_pass"]
