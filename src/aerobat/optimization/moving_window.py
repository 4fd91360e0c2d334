"""Improve an assignment of many stages by an exact search over a moving window of consecutive stages.

All stages outside the window keep their slots, so every solution is feasible for the whole program and
cheaper than the previous one. Windows overlap, and move until no window improves the solution. This proves
nothing for all stages together: the bound is the one of the search whose answer is improved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np

from aerobat.optimization.assignment import AssignmentProgram, SlottedStage
from aerobat.optimization.backends import solver
from aerobat.optimization.deadline import out_of_time
from aerobat.optimization.result import AssignmentResult, Status

WIDTH = 3  # stages of a window: 2 give worse assignments; 4 take twice as long and give none better
STEP = 2  # stages by which the window moves
WINDOW_NODES = 2000  # node limit of a window's search: some windows cost almost the same in all slots
IMPROVEMENT = 1e-9  # smallest relative decrease of the cost that counts; less is rounding


def improved_in_windows(
    program: AssignmentProgram, answer: AssignmentResult, start: Sequence[int] | None = None
) -> AssignmentResult:
    """Return a search's answer, improved window by window.

    The windows begin at the answer's slots, else at `start`, else at evenly spread slots. The status is
    "locally optimal" where no window can be improved; the bound is that of the answer. Answers that are
    optimal or infeasible, and those of programs without a total order of stages, are returned unchanged.
    """
    slots = answer.slots or start or evenly_spread(program)
    if answer.status in ("optimal", "infeasible") or slots is None or not program.is_totally_ordered:
        return answer
    search = _MovingWindowSearch(program, slots)
    search.run()
    spent = replace(answer, nodes=answer.nodes + search.nodes, time=answer.time + search.time)
    best = search.best
    if best is None or not best.cost <= answer.cost:
        return spent
    status: Status = "locally optimal" if search.converged else "time_limit"
    bound = min(answer.bound, best.cost)
    return replace(best, status=status, bound=bound, nodes=spent.nodes, time=spent.time)


def evenly_spread(program: AssignmentProgram) -> tuple[int, ...] | None:
    """Return slots in the stages' order, as evenly spread as possible; None where there are too few."""
    slots: list[int] = []
    last = max((slot for stage in program.stages for slot in stage.slots), default=0)
    latest = _latest(program)
    if latest is None:
        return None
    for i, stage in enumerate(program.stages):
        after = slots[-1] if slots else -1
        free = [slot for slot in stage.slots if after < slot <= latest[i]]
        wanted = (i + 1) * (last + 1) / (len(program.stages) + 1)
        slots.append(min(free, key=lambda slot: abs(slot - wanted)))
    return tuple(slots)


def _latest(program: AssignmentProgram) -> list[int] | None:
    """Return the latest slot of each stage that leaves slots for all later stages, or None."""
    latest: list[int] = []
    for stage in reversed(program.stages):
        free = [slot for slot in stage.slots if not latest or slot < latest[-1]]
        if not free:
            return None
        latest.append(max(free))
    latest.reverse()
    return latest


class _MovingWindowSearch:
    """Windows that move along one program, and the best result so far."""

    def __init__(self, program: AssignmentProgram, slots: Sequence[int]) -> None:
        self._program = program
        self._slots = tuple(slots)
        self._search = solver("builtin")
        self.best: AssignmentResult | None = None
        self.converged = False
        self.nodes = 0
        self.time = 0.0

    def run(self) -> None:
        """Move the windows until a whole round finds no improvement, or time is over."""
        last = max(len(self._slots) - WIDTH, 0)
        # first stages of the windows; the last window ends with the last stage
        firsts = [*range(0, last, STEP), last]
        unchanged, proven = 0, True
        for first in cycle(firsts):
            if out_of_time():
                return
            result = self._solved(first)
            if self._improves(result):
                unchanged, proven = 0, True
            proven = proven and result.status == "optimal"
            unchanged += 1
            if unchanged == len(firsts):
                self.converged = proven
                return

    def _solved(self, first: int) -> AssignmentResult:
        window = range(first, first + WIDTH)
        stages = self._program.stages
        free = [self._between(i, window) if i in window else self._fixed(i) for i in range(len(stages))]
        start = None if self.best is None else self._slots
        result = self._search.solve(
            replace(self._program, stages=tuple(free)), node_limit=WINDOW_NODES, start=start
        )
        self.nodes += result.nodes
        self.time += result.time
        return result

    def _improves(self, result: AssignmentResult) -> bool:
        """Keep a result that costs less than the best one, or is the first. Return True if it was kept."""
        if result.x is None:
            return False
        assert result.slots is not None
        known = np.inf if self.best is None else self.best.cost
        if result.cost >= known * (1.0 - IMPROVEMENT):
            return False
        self.best, self._slots = result, result.slots
        return True

    def _between(self, i: int, window: range) -> SlottedStage:
        """Return a stage with only the slots between the neighbours of its window."""
        after = self._slots[window.start - 1] if window.start > 0 else -1
        before = self._slots[window.stop] if window.stop < len(self._slots) else np.inf
        stage = self._program.stages[i]
        return stage.restricted([k for k, slot in enumerate(stage.slots) if after < slot < before])

    def _fixed(self, i: int) -> SlottedStage:
        stage = self._program.stages[i]
        return stage.restricted([stage.index(self._slots[i])])
