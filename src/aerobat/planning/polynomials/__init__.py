"""The paper's Section V: polynomials through knots, in closed form or with the knots free."""

from aerobat.planning.polynomials.free_knots import FreeKnots
from aerobat.planning.polynomials.min_snap import MinSnap, Stretch

__all__ = ["FreeKnots", "MinSnap", "Stretch"]
