"""The paper's Section II: a mixed-integer QP over an integrator, stages put in intervals, a search on dt."""

from aerobat.planning.miqp.miqp import Miqp, formulate

__all__ = ["Miqp", "formulate"]
