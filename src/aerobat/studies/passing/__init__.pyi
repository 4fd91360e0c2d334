from .passing import plan_to_pass
from .result import Passing, Round
from .steadying import steadied

__all__ = ["Passing", "Round", "plan_to_pass", "steadied"]
