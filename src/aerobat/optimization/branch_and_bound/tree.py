"""Best-first branch and bound over the placements of stages.

A node places some stages and drops the others, which can only lower the cost; its relaxation is a convex QP.
Few children reach the QP solver: bounds for all of them at once (`Placements.prospects`), and for pairs
(`Placements.together`), tell that most cost too much, and each waits in line behind cheaper siblings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import inf
from time import perf_counter

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import Indices, Status
from aerobat.optimization.branch_and_bound.candidates import PlacedBounds, Placements, Prospects
from aerobat.optimization.branch_and_bound.lazy_children import Branch, Fan
from aerobat.optimization.branch_and_bound.least_distance import LeastDistance, NotConverged, Point
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED, Bounds

_CLOSED = 1e-10  # relative gap at which the search ends
_FEW = 4  # placements of the last stage, of which no prospects are made
_DIVES = 2  # a dive whenever the number of QPs has grown so many times


@dataclass(frozen=True, eq=False, slots=True)
class _Node:
    """A relaxation that is solved."""

    point: Point
    chosen: tuple[int, ...]  # placements
    pending: tuple[int, ...]  # stages, counting those with several slots, that are not placed
    inherited: Prospects  # of its parent, for the placements that may join those chosen


class Tree:
    """One search: `best` is the cheapest point found, with its placements, and `bound` what none can beat."""

    def __init__(
        self,
        placements: Placements,
        placed: PlacedBounds,
        solver: LeastDistance,
        standing: Bounds,
    ) -> None:
        """`standing` are the bounds of the rows, with no stage placed."""
        self._placements, self._placed, self._solver, self._standing = placements, placed, solver, standing
        self._heap: list[tuple[float, int, _Node, Fan | None]] = []
        self._ticket = count()
        self._unresolved = inf  # the least bound of a relaxation that the QP solver could not settle
        self.best: tuple[Point, tuple[int, ...]] | None = None
        self.nodes = 0  # QPs solved

    @property
    def bound(self) -> float:
        """No point has a smaller ½|y|²; infinite when there is no point."""
        waiting = self._heap[0][0] if self._heap else inf
        return min(waiting, self._unresolved, self._limit if self.best else inf)

    @property
    def status(self) -> Status:
        """What is proven so far."""
        if self.best is not None:
            return "time_limit" if self._improves(self.bound) else "optimal"
        return "infeasible" if self.bound == inf else "unknown"

    def try_slots(self, slots: Mapping[int, int]) -> None:
        """Take an assignment (stage: slot) for the best so far, where it is one."""
        of, chosen, open_ = self._placements, [], self._placed.possible
        for stage, slot in slots.items():
            fitting = np.flatnonzero(open_ & (of.stage == stage) & (of.slot == slot))
            if not fitting.size:
                return
            chosen.append(int(fitting[0]))
            open_ = open_ & of.beside(chosen[-1:])
        lower, upper = self._tightened(self._standing.lower, self._standing.upper, chosen)
        point = self._solve(lower, upper, None, inf)
        if point is not None:
            self.best = (point, tuple(chosen))

    def search(self, deadline: float = inf) -> None:
        """Until the best is proven best, or nothing is left, or the deadline has passed."""
        if perf_counter() >= deadline:
            self._unresolved = 0.0
            return
        root = self._solve(self._standing.lower, self._standing.upper, None, 0.0)
        pending = tuple(range(len(self._placements.free)))
        every = self._placements.all(self._placed)
        if root is not None and every.cover(pending):
            self._dive(_Node(root, (), pending, every), deadline)
        dive = _DIVES * self.nodes
        while self._heap and self._improves(self._heap[0][0]) and perf_counter() < deadline:
            node = self._next()
            if node is None:
                continue
            if self.nodes >= dive:
                self._dive(node, deadline)
                dive = _DIVES * self.nodes
            elif self._heap and node.point.value > self._heap[0][0]:
                self._wait(node.point.value, node)  # others may cost less
            else:
                fan = self._visited(node)
                if fan is not None:
                    self._wait(fan.bound, node, fan)

    def _next(self) -> _Node | None:
        """The cheapest node there is; None where what waited comes to nothing, or to more than the next."""
        _, _, node, fan = heappop(self._heap)
        if fan is None:
            return node
        bound = fan.settle()
        if self._improves(bound) and not (self._heap and bound > self._heap[0][0]):
            branch = fan.pop(self._limit, in_pairs=False)
            self._wait(fan.bound, node, fan)
            return self._child(node, fan.prospects, branch)
        self._wait(bound, node, fan)
        return None

    def _dive(self, node: _Node | None, deadline: float) -> None:
        """Down to some assignment, the cheapest child at every turn; all others are left in the heap.

        What costs more is not searched any more, and should time run out there is something to show.
        """
        while node is not None and perf_counter() < deadline:
            fan = self._visited(node)
            if fan is None:
                return
            child = None
            while child is None and self._improves(fan.settle()) and perf_counter() < deadline:
                child = self._child(node, fan.prospects, fan.pop(self._limit, in_pairs=True))
            self._wait(fan.bound, node, fan)
            node = child
        if node is not None:
            self._wait(node.point.value, node)

    def _visited(self, node: _Node) -> Fan | None:
        """The node's children; None where it has none, or where its point is the best so far."""
        if not node.pending:
            self.best = (node.point, node.chosen)
            return None
        prospects = self._prospects(node)
        complete = self._completed(node, prospects)
        if complete is not None:
            self.best = (node.point, complete)
            return None
        return Fan(self._placements, node.point, prospects)

    def _prospects(self, node: _Node) -> Prospects:
        """The node's prospects, or its parent's where they will do: a few QPs cost less."""
        if node.chosen and len(node.pending) == 1 and len(node.inherited.among) <= _FEW:
            return node.inherited
        return self._placements.prospects(node.point, self._placed, node.inherited)

    def _child(self, node: _Node, prospects: Prospects, branch: Branch) -> _Node | None:
        """One child of a node with these prospects; None where it cannot beat the best."""
        placed = self._placements.order[list(branch.placed)].tolist()
        pending = tuple(stage for stage in node.pending if stage not in placed)
        open_ = self._placements.beside(branch.placed, branch.spared)
        inherited = prospects.some(open_, self._limit)
        if not inherited.cover(pending):
            return None
        lower, upper = self._tightened(node.point.lower, node.point.upper, branch.placed)
        point = self._solve(lower, upper, node.point, branch.bound)
        return None if point is None else _Node(point, node.chosen + branch.placed, pending, inherited)

    def _completed(self, node: _Node, prospects: Prospects) -> tuple[int, ...] | None:
        """Placements, one for each stage, that the node's point satisfies as it is; None without."""
        if prospects.moves is None:
            return None
        holding = prospects.among[prospects.moves.none]
        if len(holding) < len(node.pending):
            return None
        return self._matched(node.chosen, node.pending, holding)

    def _matched(
        self, chosen: tuple[int, ...], pending: tuple[int, ...], holding: Indices
    ) -> tuple[int, ...] | None:
        if not pending:
            return chosen
        for p in holding[self._placements.order[holding] == pending[0]]:
            beside = holding[self._placements.compatible[p][holding]]
            complete = self._matched((*chosen, int(p)), pending[1:], beside)
            if complete is not None:
                return complete
        return None

    def _tightened(self, lower: Array, upper: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        lower, upper = lower.copy(), upper.copy()
        for p in chosen:
            rows = self._placements.rows[:, p]
            np.maximum.at(lower, rows, self._placed.lower[:, p])  # a row may be there twice
            np.minimum.at(upper, rows, self._placed.upper[:, p])
        return lower, upper

    def _solve(self, lower: Array, upper: Array, guess: Point | None, bound: float) -> Point | None:
        self.nodes += 1
        try:
            return self._solver.solve(lower, upper, guess, self._limit)
        except NotConverged:
            self._unresolved = min(self._unresolved, bound)
            return None

    @property
    def _limit(self) -> float:
        return UNBOUNDED if self.best is None else self.best[0].value

    def _improves(self, bound: float) -> bool:
        return bound < self._limit - _CLOSED * (self._limit + abs(self._standing.base))

    def _wait(self, bound: float, node: _Node, fan: Fan | None = None) -> None:
        if self._improves(bound):
            heappush(self._heap, (bound, next(self._ticket), node, fan))
