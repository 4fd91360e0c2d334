"""Long sequences cut in two at the slot of one stage, each half searched by itself at a price of the state.

`TimeDecomposition` and `cut_stage` are all that `solver` uses; the docstring there says who reaches them.
DERIVATION.md of the folder above says why the answer is exact. `benchmarks/growth_with_stages.py` measures
three gates, and docs/lab/benchmarks.md has what each threshold is worth on them.
"""

from aerobat.optimization.branch_and_bound.time_decomposition.search import TimeDecomposition, cut_stage

__all__ = ["TimeDecomposition", "cut_stage"]
