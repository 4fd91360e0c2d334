"""Long sequences cut in two at the slot of one stage, each half searched by itself at a price of the state.

`TimeDecomposition` and `cut_stage` are all that the solver uses; DERIVATION.md of the folder above says why
the answer is exact.
"""

from aerobat.optimization.branch_and_bound.time_decomposition.search import TimeDecomposition, cut_stage

__all__ = ["TimeDecomposition", "cut_stage"]
