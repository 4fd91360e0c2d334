"""Best-first branch and bound over the candidates of stages.

A node chooses candidates for some stages and drops the other stages, which can only lower the cost. Its
relaxation is a convex QP. Few children reach the QP solver: cheap lower bounds for single candidates and for
pairs prune most of them, and the others wait in the queue behind cheaper siblings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.branch_and_bound.candidates import CandidateBounds, Candidates
from aerobat.optimization.branch_and_bound.lazy_children import Branch, LazyChildren
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP, NotConverged, QPSolution
from aerobat.optimization.branch_and_bound.lower_bounds import DualBounds, LowerBounds
from aerobat.optimization.branch_and_bound.null_space import UNBOUNDED, ReducedBounds
from aerobat.optimization.deadline import out_of_time
from aerobat.optimization.result import Status

_OPTIMALITY_GAP = 1e-10  # relative optimality gap at which the search ends
_MAX_INHERITED = 4  # up to this number of candidates of the last stage, the parent's bounds are reused
_DIVE_GROWTH = 2  # the search dives whenever the number of solved QPs has grown by this factor
_FAILURE_COST = 20  # cost of a QP that does not converge, in converging QPs, because it is tried three times


@dataclass(frozen=True, eq=False, slots=True)
class _Node:
    """A node of the search with its solved relaxation."""

    solution: QPSolution
    chosen: tuple[int, ...]  # candidates
    pending: tuple[int, ...]  # groups without a chosen candidate
    inherited: LowerBounds  # bounds of its parent, for the candidates compatible with those chosen


class BestFirstSearch:
    """One search: `best` is the cheapest solution with its candidates, `bound` a global lower bound."""

    def __init__(
        self,
        candidates: Candidates,
        dual_bounds: DualBounds,
        qp: LeastDistanceQP,
        bounds: CandidateBounds,
        root: ReducedBounds,
    ) -> None:
        """`bounds` are those of the candidates, `root` those of the rows without any stage assigned."""
        self._candidates = candidates
        self._dual_bounds = dual_bounds
        self._qp = qp
        self._bounds = bounds
        self._root = root
        self._heap: list[tuple[float, int, _Node, LazyChildren | None]] = []
        self._ticket = count()
        self._unresolved = inf  # the smallest bound of a relaxation that the QP solver could not solve
        self.best: tuple[QPSolution, tuple[int, ...]] | None = None
        self.nodes = 0  # QPs solved
        self._failures = 0  # QPs that did not converge
        self._node_limit = inf

    @property
    def bound(self) -> float:
        """The lower bound of ½|y|²; infinite when there is no solution."""
        waiting = self._heap[0][0] if self._heap else inf
        return min(waiting, self._unresolved, self._cutoff if self._cutoff < UNBOUNDED else inf)

    @property
    def status(self) -> Status:
        """The status of the best solution: "optimal" only where the bound proves it."""
        if self.best is not None:  # after a limit or a failed QP a cheaper solution may exist
            return "time_limit" if self._improves(self.bound) else "optimal"
        return "infeasible" if self.bound == inf else "unknown"

    def try_start(self, slots: Mapping[int, int]) -> None:
        """Use an assignment (stage: slot) as the best solution so far, where it is feasible."""
        chosen: list[int] = []
        possible = self._bounds.possible
        for stage, slot in slots.items():
            is_meant = (self._candidates.stage == stage) & (self._candidates.slot == slot)
            matching = np.flatnonzero(possible & is_meant)
            if not matching.size:
                return
            chosen.append(int(matching[0]))
            possible = possible & self._candidates.compatible_with(chosen[-1:])
        lower, upper = self._tightened(self._root.lower, self._root.upper, chosen)
        solution = self._solve(lower, upper, None, inf)
        if solution is not None:
            self.best = (solution, tuple(chosen))

    def run(self, node_limit: float) -> None:
        """Search until the best solution is proven optimal, no node is left, or a limit is reached.

        The limit counts solved QPs; a QP that fails counts with its higher cost.
        """
        self._node_limit = node_limit
        if self._is_over:
            self._unresolved = 0.0
            return
        solution = self._solve(self._root.lower, self._root.upper, None, 0.0)
        pending = tuple(range(len(self._candidates.free_stages)))
        inherited = self._dual_bounds.root_bounds(self._bounds)
        if solution is not None and inherited.covers_all_stages(pending):
            root = _Node(solution, (), pending, inherited)
            self._dive(root)
        next_dive = _DIVE_GROWTH * self.nodes
        while self._heap and self._improves(self._heap[0][0]) and not self._is_over:
            node = self._next()
            if node is None:
                continue
            if self.nodes >= next_dive:
                self._dive(node)
                next_dive = _DIVE_GROWTH * self.nodes
            elif self._heap and node.solution.value > self._heap[0][0]:
                self._push(node.solution.value, node)  # other nodes have smaller bounds
            else:
                children = self._children(node)
                if children is not None:
                    self._push(children.bound, node, children)

    def _next(self) -> _Node | None:
        """Return the best node; None where its best branch is infeasible or costs more than the next node."""
        _, _, node, children = heappop(self._heap)
        if children is None:
            return node
        bound = children.evaluate_best()
        if self._improves(bound) and not (self._heap and bound > self._heap[0][0]):
            branch = children.pop(self._cutoff, in_pairs=False)
            self._push(children.bound, node, children)
            return self._child(node, children.lower_bounds, branch)
        self._push(bound, node, children)
        return None

    def _dive(self, node: _Node | None) -> None:
        """Dive to a complete assignment along the best child of every node; other children stay queued.

        An early solution prunes nodes that cost more, and is the answer if time runs out.
        """
        while node is not None and not self._is_over:
            children = self._children(node)
            if children is None:
                return
            child, in_pairs = None, True
            while child is None and self._improves(children.evaluate_best()) and not self._is_over:
                branch = children.pop(self._cutoff, in_pairs)
                child = self._child(node, children.lower_bounds, branch)
                # where a pair fails, try its candidate alone, which can exclude all its pairs
                in_pairs = False
            self._push(children.bound, node, children)
            node = child
        if node is not None:
            self._push(node.solution.value, node)

    def _children(self, node: _Node) -> LazyChildren | None:
        """Return the node's children; None where it is complete, and becomes the best solution."""
        if not node.pending:
            self.best = (node.solution, node.chosen)
            return None
        lower_bounds, steps = node.inherited, None
        # bounds are computed anew unless solving the few remaining QPs is cheaper
        if not node.chosen or len(node.pending) > 1 or len(lower_bounds.candidates) > _MAX_INHERITED:
            lower_bounds, steps = self._dual_bounds.single_bounds(node.solution, self._bounds, node.inherited)
        return LazyChildren(self._dual_bounds, node.solution, lower_bounds, steps)

    def _child(self, node: _Node, lower_bounds: LowerBounds, branch: Branch) -> _Node | None:
        """Return one child of a node; None where it cannot improve on the best solution."""
        groups = self._candidates.group[list(branch.chosen)].tolist()
        pending = tuple(group for group in node.pending if group not in groups)
        allowed = self._candidates.compatible_with(branch.chosen, branch.excluded)
        inherited = lower_bounds.restricted(allowed, self._cutoff)
        if not inherited.covers_all_stages(pending):
            return None
        lower, upper = self._tightened(node.solution.lower, node.solution.upper, branch.chosen)
        solution = self._solve(lower, upper, node.solution, branch.bound)
        return None if solution is None else _Node(solution, node.chosen + branch.chosen, pending, inherited)

    def _tightened(self, lower: Array, upper: Array, chosen: Sequence[int]) -> tuple[Array, Array]:
        lower = lower.copy()
        upper = upper.copy()
        for candidate in chosen:
            rows = self._candidates.rows[:, candidate]
            np.maximum.at(lower, rows, self._bounds.lower[:, candidate])  # a row may occur twice
            np.minimum.at(upper, rows, self._bounds.upper[:, candidate])
        return lower, upper

    def _solve(
        self, lower: Array, upper: Array, warm_start: QPSolution | None, bound: float
    ) -> QPSolution | None:
        self.nodes += 1
        try:
            return self._qp.solve(lower, upper, warm_start, self._cutoff)
        except NotConverged:
            self._failures += 1
            self._unresolved = min(self._unresolved, bound)
            return None

    @property
    def _is_over(self) -> bool:
        spent = self.nodes + _FAILURE_COST * self._failures
        return spent >= self._node_limit or out_of_time()

    @property
    def _cutoff(self) -> float:
        return UNBOUNDED if self.best is None else self.best[0].value

    def _improves(self, bound: float) -> bool:
        return bound < self._cutoff - _OPTIMALITY_GAP * (self._cutoff + abs(self._root.base_cost))

    def _push(self, bound: float, node: _Node, children: LazyChildren | None = None) -> None:
        if self._improves(bound):
            heappush(self._heap, (bound, next(self._ticket), node, children))
