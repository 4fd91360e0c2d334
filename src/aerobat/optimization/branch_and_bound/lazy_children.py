"""The children of one node, created on demand, those of the smallest lower bound first."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.optimization.branch_and_bound.least_distance import QPSolution
from aerobat.optimization.branch_and_bound.lower_bounds import DualBounds, DualSteps, LowerBounds

_NONE = np.zeros(0, dtype=np.intp)
_FIRST_BATCH = 4  # candidates paired in the first batch; each later batch is twice as large
# of one candidate; with more pairs below the cutoff, the candidate alone is one branch
_MAX_PAIR_BRANCHES = 2


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """All completions of a node that contain the candidates `chosen` and none of those `excluded`."""

    bound: float
    chosen: tuple[int, ...]
    excluded: tuple[int, ...] = ()


@dataclass(eq=False, slots=True)
class _Pairing:
    """A candidate with all candidates of its partner group, or alone where it has none."""

    candidate: int
    partners: Indices
    bounds: Array  # of the pairs
    num_branched: int = 0  # number of partners already branched on, in the order of their bounds


class LazyChildren:
    """Branches that cover all completions of a node.

    Branches choose a candidate of the group with the largest average lower bound. Where few pairs remain,
    they also choose one of a second group: the one whose smallest pairwise bound is the largest. Pairwise
    bounds come from the node's own solution, so most of the QPs in between need not be solved. Candidates are
    paired on demand.
    """

    def __init__(
        self,
        dual_bounds: DualBounds,
        solution: QPSolution,
        lower_bounds: LowerBounds,
        steps: DualSteps | None,
    ) -> None:
        """`solution` is the node's; `lower_bounds` have candidates of every pending group.

        `steps` prove these bounds; None where they are inherited from the parent.
        """
        self.lower_bounds = lower_bounds
        self._dual_bounds = dual_bounds
        self._solution = solution
        self._steps = steps
        group, value = lower_bounds.group, lower_bounds.value
        self._starts = np.concatenate([[0], (group[1:] != group[:-1]).nonzero()[0] + 1])
        self._spans = [slice(a, b) for a, b in pairwise((*self._starts.tolist(), len(group)))]
        sizes = np.diff([*self._starts, len(group)])
        average = np.add.reduceat(value, self._starts) / sizes
        self._branching_group = int(average.argmax())
        span = self._spans[self._branching_group]
        self._waiting = (span.start + value[span].argsort(kind="stable")).tolist()
        self._batch = _FIRST_BATCH
        self._evaluated: list[tuple[float, int, _Pairing]] = []
        self._ticket = count()

    @property
    def bound(self) -> float:
        """The lower bound of all remaining branches."""
        evaluated = self._evaluated[0][0] if self._evaluated else inf
        if not self._waiting:
            return evaluated
        return min(evaluated, float(self.lower_bounds.value[self._waiting[0]]))

    def evaluate_best(self) -> float:
        """Pair candidates until the best branch is known; return its bound."""
        while self._waiting and (not self._evaluated or self.bound < self._evaluated[0][0]):
            batch = self._waiting[: self._batch]
            self._waiting = self._waiting[self._batch :]
            self._evaluate(batch)
            self._batch *= 2
        return self.bound

    def pop(self, cutoff: float, in_pairs: bool) -> Branch:
        """Return the best branch, once evaluated.

        The branch is a pair if `in_pairs`, or where few pairs are below `cutoff`; else it is a candidate
        alone.
        """
        bound, _, pairing = heappop(self._evaluated)
        if not pairing.partners.size:
            return Branch(bound, (pairing.candidate,))
        done = pairing.num_branched
        if done == 0:
            order = pairing.bounds.argsort()
            pairing.partners = pairing.partners[order]
            pairing.bounds = pairing.bounds[order]
        partners = pairing.partners.tolist()
        if not in_pairs and pairing.bounds.searchsorted(cutoff) > done + _MAX_PAIR_BRANCHES:
            return Branch(bound, (pairing.candidate,), tuple(partners[:done]))
        pairing.num_branched += 1
        if pairing.num_branched < len(partners):
            self._push(float(pairing.bounds[pairing.num_branched]), pairing)
        return Branch(bound, (pairing.candidate, partners[done]))

    def _push(self, bound: float, pairing: _Pairing) -> None:
        if bound < inf:
            heappush(self._evaluated, (bound, next(self._ticket), pairing))

    def _evaluate(self, batch: list[int]) -> None:
        candidates = self.lower_bounds.candidates
        value = self.lower_bounds.value
        if self._steps is None or len(self._spans) == 1:
            for i in batch:
                self._push(float(value[i]), _Pairing(int(candidates[i]), _NONE, value[:0]))
            return
        pairs = self._dual_bounds.pairwise_bounds(
            self._solution, self.lower_bounds, self._steps, np.array(batch)
        )
        by_group = np.minimum.reduceat(pairs, self._starts, axis=1)
        by_group[:, self._branching_group] = -inf
        partner_groups = by_group.argmax(axis=1).tolist()
        bounds = by_group.max(axis=1).tolist()
        for i, row, bound, partner in zip(batch, pairs, bounds, partner_groups, strict=True):
            span = slice(0, 0) if i in self._steps.blocked else self._spans[partner]
            self._push(bound, _Pairing(int(candidates[i]), candidates[span], row[span]))
