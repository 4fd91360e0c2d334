"""The paper's Section V: polynomials through knots, in closed form or with the knots free."""

from aerobat.planning.polynomial.free_knots import FreeKnots
from aerobat.planning.polynomial.min_snap import MinSnap, TimeScaling

__all__ = ["FreeKnots", "MinSnap", "TimeScaling"]
