"""An exact search of a sequence cut in two: slot after slot of one stage, by prices and lists."""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import inf
from time import perf_counter

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.assignment import AssignmentProgram
from aerobat.optimization.branch_and_bound.direct_search import NAME, DirectSearch
from aerobat.optimization.branch_and_bound.least_distance import NotConverged
from aerobat.optimization.branch_and_bound.search import SearchLimits
from aerobat.optimization.branch_and_bound.time_decomposition.cut import Cut, Timeline
from aerobat.optimization.branch_and_bound.time_decomposition.halves import HalfAnswer
from aerobat.optimization.branch_and_bound.time_decomposition.joint import Joint, JointQP
from aerobat.optimization.branch_and_bound.time_decomposition.prices import CuttingPlanes
from aerobat.optimization.result import AssignmentResult

MIN_ANCHORS = 3  # stages that confine most of the state: of fewer, the whole is searched faster
MIN_CONFINED = 0.2  # of the state that an anchor confines: a position, of chains of five integrators
HALF_NODES = 2000  # of one search of a half
FIRST_PRICES = 3  # tried for a slot in the first round, while the best may still improve much
MAX_PRICES = 8  # in a later one
NEAR = 0.003  # of the best, by which a bound may miss it where its assignments are listed
MAX_PAIRS = 500  # of assignments of the halves that are tried
OPTIMALITY_GAP = 1e-9  # relative, at which a slot is done


def cut_stage(program: AssignmentProgram) -> int | None:
    """The stage at which a program is best cut in two; None where it is searched as a whole.

    It is one of its anchors, the stages that confine most of the state, on both sides: that with the most
    equal halves.
    """
    dynamics = program.dynamics
    if dynamics is None or program.hessian is not None or program.gradient is not None:
        return None
    confines = np.array(
        [np.isfinite(stage.upper[0] - stage.lower[0]).sum() for stage in program.stages], dtype=int
    )
    free = np.array([len(stage.slots) > 1 for stage in program.stages], dtype=bool)
    anchors = np.flatnonzero(free & (confines == confines.max(initial=0)))
    least = MIN_CONFINED * len(dynamics.transition)
    if len(anchors) < MIN_ANCHORS or confines[anchors[0]] < least or not program.is_totally_ordered:
        return None
    before = np.cumsum(free)[anchors]
    return int(anchors[np.abs(2 * before - 1 - free.sum()).argmin()])


@dataclass(order=True)
class _Part:
    """All assignments with the stage that is cut at in one slot."""

    bound: float  # none of them costs less
    slot: int
    costate: Array = field(compare=False)  # of the state there, where its next prices begin


@dataclass(frozen=True, eq=False)
class _Known:
    """The price at which a slot's halves add up to most, and their bounds there."""

    price: Array
    before: float = -inf
    behind: float = -inf

    @property
    def bound(self) -> float:
        """No assignment with the slot costs less."""
        return self.before + self.behind


class TimeDecomposition:
    """A search that begins with an answer which has a solution."""

    def __init__(
        self,
        program: AssignmentProgram,
        stage: int,
        answer: AssignmentResult,
        limits: SearchLimits,
        direct: DirectSearch,
    ) -> None:
        """Cut a program at the stage that `cut_stage` finds.

        Args:
            program: It.
            stage: The place of that stage.
            answer: What is known: a solution and a bound.
            limits: Of this search and that of the answer together.
            direct: Searches the parts that no price bounds.
        """
        assert program.dynamics is not None
        assert answer.x is not None
        self._program = program
        self._stage = stage
        self._answer = answer
        self._limits = limits
        self._direct = direct
        self._timeline = Timeline(program, program.dynamics)
        self._joint_qp = JointQP(program, float(np.linalg.norm(answer.x)) or 1.0)
        self._tried: set[tuple[int, ...]] = set()
        self._open: list[_Part] = []  # a heap
        self._best: Joint | None = None
        self._nodes = answer.nodes

    def run(self) -> AssignmentResult:
        """Search until the best is proven optimal, or a limit is reached; the claim is not yet verified."""
        assert self._answer.slots is not None
        self._try(self._answer.slots)
        if self._best is None:
            return self._direct.claim(self._program, self._limits, self._answer.slots)
        self._first_round(self._best)
        unresolved = inf
        while self._open and not self._is_done(self._open[0]) and not self._is_over:
            part = heappop(self._open)
            self._bound(part, MAX_PRICES, 1.0)
            if not self._is_done(part):
                self._search(part)
            if not self._is_done(part):
                unresolved = min(unresolved, part.bound)
        bound = min([unresolved, *(part.bound for part in self._open)])
        proven = self._reaches_best(bound)
        return AssignmentResult(
            status="optimal" if proven else "time_limit",
            backend=NAME,
            bound=self._program.constant + (self._cutoff if proven else bound),
            x=self._best.x,
            slots=self._best.slots,
            nodes=self._nodes,
        )

    def _first_round(self, first: Joint) -> None:
        """Bound every slot, from a solution's on both ways, each beginning at its neighbour's costate."""
        at = first.slots[self._stage]
        cut = Cut(self._timeline, self._stage, at)
        costate = cut.costate(cut.optimal_price(first.x, first.multipliers))
        slots = self._possible_slots()
        for way in ([k for k in slots if k >= at], [k for k in reversed(slots) if k < at]):
            at_neighbour = costate
            for slot in way:
                part = _Part(max(self._answer.bound - self._program.constant, 0.0), slot, at_neighbour)
                if not self._is_over:
                    self._bound(part, FIRST_PRICES, NEAR)
                    at_neighbour = part.costate
                if not self._is_done(part):
                    heappush(self._open, part)

    def _possible_slots(self) -> list[int]:
        """The slots of the stage that is cut at, in order, that have some of all others on either side."""
        stages = self._program.stages
        first = max(min(stage.slots) for stage in stages[: self._stage])
        last = min(max(stage.slots) for stage in stages[self._stage + 1 :])
        return sorted(slot for slot in stages[self._stage].slots if first < slot < last)

    def _bound(self, part: _Part, prices: int, near: float) -> None:
        """Raise the bound of a slot, price by price, then list all assignments that may be better yet.

        Args:
            part: The slot.
            prices: How many are tried at most.
            near: What may be missing of the best, as a fraction, where they are listed.
        """
        cut = Cut(self._timeline, self._stage, part.slot)
        known = _Known(cut.price(part.costate))
        planes = CuttingPlanes(len(known.price))
        price: Array | None = self._best_price(cut, known.price)
        for _ in range(prices):
            if price is None:
                break
            before, behind = self._minima(cut, price)
            cutoff = self._cutoff
            if before.bound + behind.bound > known.bound:
                known = _Known(price, before.bound, behind.bound)
            part.bound = max(part.bound, known.bound)
            if before.minimum is None or behind.minimum is None or self._is_over:
                break
            self._try((*before.minimum.slots, part.slot, *behind.minimum.slots))
            if self._reaches_best(part.bound, NEAR):
                break
            planes.add(price, before.minimum, behind.minimum)
            price = planes.nearest(known.price, self._cutoff, known.bound)
            if self._cutoff < cutoff:
                price = self._best_price(cut, known.price)
        part.costate = cut.costate(known.price)
        if not self._is_done(part) and self._reaches_best(part.bound, near):
            self._list(cut, known, part)

    def _best_price(self, cut: Cut, price: Array) -> Array:
        """The price at which the best is both halves' minimum, where it has the cut's slot; else another."""
        assert self._best is not None
        if self._best.slots[self._stage] != cut.slot:
            return price
        return cut.optimal_price(self._best.x, self._best.multipliers)

    def _minima(self, cut: Cut, price: Array) -> tuple[HalfAnswer, HalfAnswer]:
        """Search both halves at a price, the shorter first; the other for what may improve on the best."""
        first, second = (cut.before, cut.behind) if cut.is_early else (cut.behind, cut.before)
        one = first.minimum(price, self._half_limits)
        other = one  # where it has no solution
        if one.bound < inf:
            other = second.minimum(price, self._half_limits, self._cutoff - one.bound)
        self._nodes += one.nodes + other.nodes
        return (one, other) if cut.is_early else (other, one)

    def _list(self, cut: Cut, known: _Known, part: _Part) -> None:
        """Try all pairs of the halves' assignments that may be better than the best; no other can be."""
        before = cut.before.below(known.price, self._half_limits, self._cutoff - known.behind)
        self._nodes += before.nodes
        if not before.are_all:
            return
        behind = cut.behind.below(known.price, self._half_limits, self._cutoff - known.before)
        self._nodes += behind.nodes
        if not behind.are_all:
            return
        pairs = [
            (a + b, (*i, part.slot, *j))
            for a, i in before.found
            for b, j in behind.found
            if not self._reaches_best(a + b)
        ]
        if len(pairs) > MAX_PAIRS:
            return
        for bound, slots in sorted(pairs):
            if self._reaches_best(bound):
                break
            if self._is_over or not self._try(slots):
                return
        part.bound = self._cutoff

    def _search(self, part: _Part) -> None:
        """Search a slot as a whole."""
        stages = list(self._program.stages)
        stages[self._stage] = stages[self._stage].restricted([stages[self._stage].index(part.slot)])
        limits = SearchLimits(self._limits.deadline, self._limits.nodes - self._nodes)
        constant = self._program.constant
        program = self._program.with_bounds(stages=stages)
        answer = self._direct.claim(program, limits, cutoff=self._cutoff + constant)
        self._nodes += answer.nodes
        if answer.slots is not None:
            self._try(answer.slots)
        part.bound = max(part.bound, answer.bound - constant)

    def _try(self, slots: tuple[int, ...]) -> bool:
        """Take an assignment for the best, where it is; False where its QP does not converge."""
        if slots in self._tried:
            return True
        self._nodes += 1
        try:
            joint = self._joint_qp.solve(slots, self._cutoff)
        except NotConverged:
            return False
        self._tried.add(slots)
        if joint is not None and joint.cost < self._cutoff:
            self._best = joint
        return True

    def _is_done(self, part: _Part) -> bool:
        return self._reaches_best(part.bound)

    def _reaches_best(self, bound: float, missing: float = OPTIMALITY_GAP) -> bool:
        """Tell if a bound misses no more than a fraction of the best cost."""
        return bound >= self._cutoff * (1.0 - missing)

    @property
    def _cutoff(self) -> float:
        return inf if self._best is None else self._best.cost

    @property
    def _half_limits(self) -> SearchLimits:
        return SearchLimits(self._limits.deadline, min(HALF_NODES, self._limits.nodes - self._nodes))

    @property
    def _is_over(self) -> bool:
        return self._nodes >= self._limits.nodes or perf_counter() >= self._limits.deadline
