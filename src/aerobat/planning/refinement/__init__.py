"""The one continuous optimizer: polynomials between knots, as fast as all limits allow, certified."""

from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import RefinedPath, Refinement, segments_for

__all__ = ["FlownPath", "RefinedPath", "Refinement", "segments_for"]
