from .figure import Figure
from .loops import Immelmann, MattyFlip, PowerLoop, SplitS
from .passes import InvertedPass, KnifeEdgePass
from .rolls import BarrelRoll, Corkscrew

__all__ = [
    "BarrelRoll",
    "Corkscrew",
    "Figure",
    "Immelmann",
    "InvertedPass",
    "KnifeEdgePass",
    "MattyFlip",
    "PowerLoop",
    "SplitS",
]
