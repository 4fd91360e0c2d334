from .passing import plan_to_pass as plan_to_pass
from .result import Passing as Passing
from .result import Round as Round
from .steadying import steadied as steadied
