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

from aerobat.optimization.assignment import AssignmentProgram
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
    search, best, nodes, time = solver("builtin"), None, answer.nodes, answer.time
    last = max(len(slots) - WIDTH, 0)  # first stage of the last window, which ends with the last stage
    firsts = [*range(0, last, STEP), last]
    unchanged, proven = 0, True  # windows in a row without an improvement, and whether all are solved exactly
    for first in cycle(firsts):
        if unchanged == len(firsts) or out_of_time():
            break
        window = _window(program, slots, range(first, first + WIDTH))
        found = search.solve(window, node_limit=WINDOW_NODES, start=None if best is None else slots)
        nodes, time = nodes + found.nodes, time + found.time
        if found.slots is not None and (best is None or found.cost < best.cost * (1.0 - IMPROVEMENT)):
            best, slots, unchanged, proven = found, found.slots, 0, True
        proven = proven and found.status == "optimal"
        unchanged += 1
    if best is None or not best.cost <= answer.cost:
        return replace(answer, nodes=nodes, time=time)
    status: Status = "locally optimal" if proven and unchanged == len(firsts) else "time_limit"
    return replace(best, status=status, bound=min(answer.bound, best.cost), nodes=nodes, time=time)


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


def _window(program: AssignmentProgram, slots: Sequence[int], window: range) -> AssignmentProgram:
    """Return the program whose stages outside a window keep their slots, with those between inside."""
    after = slots[window.start - 1] if window.start > 0 else -1
    before = slots[window.stop] if window.stop < len(slots) else np.inf
    stages = (
        stage.restricted([k for k, free in enumerate(stage.slots) if after < free < before])
        if i in window
        else stage.restricted([stage.index(slot)])
        for i, (stage, slot) in enumerate(zip(program.stages, slots, strict=True))
    )
    return replace(program, stages=tuple(stages))
