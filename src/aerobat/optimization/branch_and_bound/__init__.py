"""The built-in exact solver, best-first branch and bound over the slots of stages; see DERIVATION.md.

`BranchAndBound` is all that others use; the modules beside it are private to this folder.
"""

from aerobat.optimization.branch_and_bound.solver import BranchAndBound

__all__ = ["BranchAndBound"]
