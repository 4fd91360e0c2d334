"""The children of one relaxation, made as they are asked for, the cheapest first."""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import Indices
from aerobat.optimization.branch_and_bound.candidates import Placements, Prospects
from aerobat.optimization.branch_and_bound.least_distance import Point

_NOBODY = np.zeros(0, dtype=np.intp)
_AT_FIRST = 4  # placements are looked at together; twice as many the next time
_FEW = 2  # pairs of one placement that become branches of their own; of more, the placement alone is one


@dataclass(frozen=True, eq=False, slots=True)
class Branch:
    """All ways to complete a node with the placements `placed` and without those `spared`."""

    bound: float
    placed: tuple[int, ...]
    spared: tuple[int, ...] = ()


@dataclass(eq=False, slots=True)
class _Choice:
    """A placement with any one of its partner stage's, the cheapest first; alone where it has no partner."""

    placement: int
    partners: Indices
    bounds: Array  # of the pairs
    paired: int = 0  # the first ones are dealt with
    sorted: bool = False

    def sort(self) -> None:
        if not self.sorted:
            order = self.bounds.argsort()
            self.partners, self.bounds, self.sorted = self.partners[order], self.bounds[order], True


class Fan:
    """Branches that cover all ways to complete a node.

    They place the stage whose cheapest placement costs most and, where that leaves few choices, with it the
    stage that would cost most then: one point bounds what two placements cost together, so that most of the
    relaxations in between need not be solved. Placements are looked at when their turn comes.
    """

    def __init__(self, placements: Placements, point: Point, prospects: Prospects) -> None:
        """`point` is the node's; `prospects` have placements of every stage that is left."""
        self.prospects = prospects
        self._of, self._point = placements, point
        stage, least = prospects.stage, prospects.least
        self._starts = np.concatenate([[0], (stage[1:] != stage[:-1]).nonzero()[0] + 1])
        self._spans = [slice(a, b) for a, b in pairwise((*self._starts.tolist(), len(stage)))]
        self._dearest = int(np.minimum.reduceat(least, self._starts).argmax())
        span = self._spans[self._dearest]
        self._waiting = (span.start + least[span].argsort(kind="stable")).tolist()
        self._at_once = _AT_FIRST
        self._ready: list[tuple[float, int, _Choice]] = []
        self._ticket = count()

    @property
    def bound(self) -> float:
        """No branch that is left costs less."""
        ready = self._ready[0][0] if self._ready else inf
        return min(ready, float(self.prospects.least[self._waiting[0]])) if self._waiting else ready

    def settle(self) -> float:
        """Look at placements until the cheapest is known; the bound then."""
        while self._waiting and (not self._ready or self.bound < self._ready[0][0]):
            some, self._waiting = self._waiting[: self._at_once], self._waiting[self._at_once :]
            self._look_at(some)
            self._at_once *= 2
        return self.bound

    def pop(self, limit: float, in_pairs: bool) -> Branch:
        """The cheapest branch, once settled: a pair, if wanted or where few pairs cost less than `limit`."""
        bound, _, choice = heappop(self._ready)
        if not choice.partners.size:
            return Branch(bound, (choice.placement,))
        choice.sort()
        paired, partners = choice.paired, choice.partners.tolist()
        if not in_pairs and choice.bounds.searchsorted(limit) > paired + _FEW:
            return Branch(bound, (choice.placement,), tuple(partners[:paired]))
        choice.paired += 1
        if choice.paired < len(partners):
            self._push(float(choice.bounds[choice.paired]), choice)
        return Branch(bound, (choice.placement, partners[paired]))

    def _push(self, bound: float, choice: _Choice) -> None:
        if bound < inf:
            heappush(self._ready, (bound, next(self._ticket), choice))

    def _look_at(self, some: list[int]) -> None:
        among, least, moves = self.prospects.among, self.prospects.least, self.prospects.moves
        if moves is None or len(self._spans) == 1:
            for i in some:
                self._push(float(least[i]), _Choice(int(among[i]), _NOBODY, least[:0]))
            return
        joint = self._of.together(self._point, self.prospects, moves, np.array(some))
        each = np.minimum.reduceat(joint, self._starts, axis=1)
        each[:, self._dearest] = -inf
        partners, bounds = each.argmax(axis=1).tolist(), each.max(axis=1).tolist()
        for i, row, bound, partner in zip(some, joint, bounds, partners, strict=True):
            span = slice(0, 0) if i in moves.stopped else self._spans[partner]
            self._push(bound, _Choice(int(among[i]), among[span], row[span]))
