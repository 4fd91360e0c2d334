"""The built-in exact solver, best-first branch and bound over the slots of stages; see DERIVATION.md.

Other packages use only `BranchAndBound`; the modules of this folder are private.
"""

from aerobat.optimization.branch_and_bound.solver import BranchAndBound as BranchAndBound
