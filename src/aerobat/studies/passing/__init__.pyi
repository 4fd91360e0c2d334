from .passing import plan_to_pass
from .result import Passing, Round

__all__ = ["Passing", "Round", "plan_to_pass"]
