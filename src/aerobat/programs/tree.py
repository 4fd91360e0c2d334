"""Best-first branch and bound over the placements of stages.

A node places some stages and drops the others, which can only lower the cost; its relaxation is a convex QP.
Branching on a stage gives one child a placement. Few children reach the QP solver: a bound for all of them at
once (`Placements.prospects`) tells that most cost too much, and each waits in line behind cheaper siblings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count, pairwise
from math import inf
from time import perf_counter

import numpy as np

from aerobat.arrays import Array
from aerobat.programs.assignment import Indices, Mask, Status
from aerobat.programs.least_distance import LeastDistance, NotConverged, Point
from aerobat.programs.placements import PlacedBounds, Placements, Prospects
from aerobat.programs.reduction import UNBOUNDED, Bounds

_CLOSED = 1e-10  # relative gap at which the search ends


@dataclass(frozen=True, eq=False, slots=True)
class _Node:
    """A relaxation that is solved."""

    point: Point
    chosen: tuple[int, ...]  # placements
    pending: tuple[int, ...]  # stages, counting those with several slots, that are not placed
    open: Mask  # (P,) placements that may join those chosen
    inherited: Prospects | None  # of its parent


@dataclass(frozen=True, eq=False, slots=True)
class _Children:
    """Relaxations to be solved: a node with one placement more, the cheapest first."""

    node: _Node
    prospects: Prospects  # of the node
    pending: tuple[int, ...]
    placements: list[int]
    bounds: list[float]


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
        self._heap: list[tuple[float, int, _Node | _Children, int]] = []
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
            open_ = open_ & of.compatible[fitting[0]]
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
        if root is not None:
            pending = tuple(range(len(self._placements.free)))
            node = _Node(root, (), pending, self._placed.possible, None)
            self._push(node)
            if deadline < inf:
                self._dive(node, deadline)
        while self._heap and self._improves(self._heap[0][0]) and perf_counter() < deadline:
            _, _, item, at = heappop(self._heap)
            if isinstance(item, _Children):
                self._push_child(item, at + 1)
            found = item if isinstance(item, _Node) else self._solved(item, at)
            if found is None:
                continue
            if self._heap and found.point.value > self._heap[0][0]:
                self._push(found)  # others may cost less
            else:
                children = self._visited(found)
                if children is not None:
                    self._push_child(children, 0)

    def _dive(self, node: _Node | None, deadline: float) -> None:
        """Some assignment, fast, should time run out: best-first finds none before it finds the best."""
        while node is not None and perf_counter() < deadline:
            children = self._visited(node)
            if children is None:
                return
            solved = (self._solved(children, at) for at in range(len(children.bounds)))
            node = next((child for child in solved if child is not None or perf_counter() >= deadline), None)

    def _visited(self, node: _Node) -> _Children | None:
        """The node's children; None where it has none, or where its point is the best so far."""
        if not node.pending:
            self.best = (node.point, node.chosen)
            return None
        prospects = self._prospects(node)
        complete = self._completed(node, prospects)
        if complete is not None:
            self.best = (node.point, complete)
            return None
        return self._branched(node, prospects)

    def _prospects(self, node: _Node) -> Prospects:
        """The node's prospects, or its parent's where they will do: before the last stage a QP costs less."""
        if node.inherited is not None and len(node.pending) == 1:
            return node.inherited.among_open(node.open)
        return self._placements.prospects(node.point, self._placed, np.flatnonzero(node.open))

    def _branched(self, node: _Node, prospects: Prospects) -> _Children | None:
        """The placements of the stage whose cheapest one costs most; None where a stage has none left."""
        starts = np.searchsorted(prospects.stage, (*node.pending, len(self._placements.free))).tolist()
        spans = [slice(a, b) for a, b in pairwise(starts)]
        if any(span.start == span.stop for span in spans):
            return None
        dearest = max(range(len(spans)), key=lambda i: prospects.least[spans[i]].min())
        least = prospects.least[spans[dearest]]
        order = np.argsort(least, kind="stable")
        pending = (*node.pending[:dearest], *node.pending[dearest + 1 :])
        placements = prospects.among[spans[dearest]][order].tolist()
        return _Children(node, prospects, pending, placements, least[order].tolist())

    def _solved(self, children: _Children, at: int) -> _Node | None:
        """One of the children; None where it cannot beat the best."""
        parent, placement = children.node, children.placements[at]
        lower, upper = self._tightened(parent.point.lower, parent.point.upper, [placement])
        point = self._solve(lower, upper, parent.point, children.bounds[at])
        if point is None:
            return None
        open_ = parent.open & self._placements.compatible[placement]
        chosen = (*parent.chosen, placement)
        return _Node(point, chosen, children.pending, open_, children.prospects)

    def _completed(self, node: _Node, prospects: Prospects) -> tuple[int, ...] | None:
        """Placements, one for each stage, that the node's point satisfies as it is; None without."""
        holding = prospects.among[prospects.holds]
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

    def _tightened(self, lower: Array, upper: Array, chosen: list[int]) -> tuple[Array, Array]:
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

    def _push(self, node: _Node) -> None:
        heappush(self._heap, (node.point.value, next(self._ticket), node, 0))

    def _push_child(self, children: _Children, at: int) -> None:
        if at < len(children.bounds) and self._improves(children.bounds[at]):
            heappush(self._heap, (children.bounds[at], next(self._ticket), children, at))
