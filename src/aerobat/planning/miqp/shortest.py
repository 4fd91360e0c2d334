"""The shortest path that a vehicle can fly: from programs along a scan on dt, each refined from its slots.

The programs know no rotors. Those of small dt, which the vehicle cannot fly, have their stages where a fast
path has them: from there the descent ends at shorter paths than from those that it can.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.miqp.mended_flight import flyable
from aerobat.planning.miqp.refinement import (
    Descent,
    PathPoint,
    descent,
    finished,
    on_equal_intervals,
    settled,
)

GROWTH = 1.15  # of dt, from one program to the next
COARSE_GROWTH = 1.3  # where a path is further off than that
COARSE = 4.0  # of a constraint's range
FAR = 1.3  # of a constraint's range: a path that exceeds it by more is no place to begin,
FALLING = 1.25  # unless the excess falls no faster than by this factor from one program to the next
STARTS = 2  # that lead to a path
MAX_STARTS = 6
SCAN_NODES = 500  # of a program's branch and bound: paths begin at its slots, which need not be the cheapest
UNSOLVED = 3  # programs without an answer, after others that have one: the longer ones are no better
# of the shortest path's duration: those of programs from which others may start
SHORTER = (0.8, 0.88, 0.93, 0.96, 0.98, 0.99)
MAX_SHORTER = 8  # of such starts that lead to a path

_Slots = tuple[int, ...] | None
_End = tuple[Placement, PathPoint]  # a start and the path that a descent from it ends at


def shortest(
    attempts: Attempts, first: float, last: float, least: float, shortens: bool = True
) -> Judged[Placement] | None:
    """The shortest certified path found, or None.

    Args:
        attempts: Made and recorded here.
        first: The scan's smallest dt [s].
        last: The scan's largest dt [s].
        least: The duration [s] that no motion falls short of: shorter programs are left out.
        shortens: Whether a certified path is shortened further, and flown: it need not be where others
            begin from it.
    """
    scan = _Scan(attempts, first, last, least)
    starts = scan.starts()
    ends: list[_End] = []
    known: set[_Slots] = set()  # whose shortest path is known
    for tried, start in enumerate(starts):
        if start.answer.slots in known:
            break
        end = _descent(start)
        ends += [(start, end.path)] if end.path else []
        if end.path and end.direct:
            known.add(start.answer.slots)
        if len(ends) == STARTS or tried + 1 == MAX_STARTS or out_of_time():
            break
    for start, path in sorted(ends, key=lambda end: float(end[1].x[-1])):
        judged = attempts.refined(start, partial(finished, path))
        if judged.feasible:
            return flyable(attempts, _shortened(attempts, judged, known, scan)) if shortens else judged
    return _slower(attempts, scan, starts)


def _shortened(
    attempts: Attempts, judged: Judged[Placement], known: set[_Slots], scan: _Scan
) -> Judged[Placement]:
    """The same, or a shorter one from programs shorter than it, as long as there are any that lead to one.

    The scan's starts are slower than what they lead to, and have stages where a slower path has them.
    """
    for _ in range(MAX_SHORTER):
        further = None if out_of_time() else _shorter_than(attempts, judged, known, scan)
        if further is None:
            break
        judged = further
    return judged


def _shorter_than(
    attempts: Attempts, judged: Judged[Placement], known: set[_Slots], scan: _Scan
) -> Judged[Placement] | None:
    """A shorter path, certified, from equal intervals that the vehicle can fly; None where none is found.

    Through slots whose shortest path is known only the nearest program is tried, and between two programs of
    the scan with the same such slots none but that is solved.
    """
    duration = judged.solution.duration
    for fraction in SHORTER:
        dt, is_nearest = fraction * duration / attempts.formulation.chain.intervals, fraction == SHORTER[-1]
        if fraction * duration < scan.least or (not is_nearest and scan.slots_around(dt) in known):
            continue
        start = attempts.placement(dt, SCAN_NODES)
        if not is_nearest and start.answer.slots in known:
            continue
        equal = on_equal_intervals(start.path) if start.path else None
        if equal is None:
            continue
        path = descent(equal.program, equal.x).path or equal
        for find in (partial(finished, path), partial(settled, equal)):
            found = attempts.refined(start, find)
            if found.feasible and found.solution.duration < duration:
                return found
    return None


def _slower(attempts: Attempts, scan: _Scan, starts: Iterator[Placement]) -> Judged[Placement] | None:
    """The path from the first program that the vehicle can fly as it is, shortened if that succeeds."""
    for start in starts:
        if start.path is None or start.path.violation > 0.0:
            continue
        path = _descent(start).path
        if path is None:
            continue
        judged = attempts.refined(start, partial(finished, path))
        if judged.feasible:
            return flyable(attempts, _shortened(attempts, judged, set(), scan))
    return scan.certified()


def _descent(start: Placement) -> Descent:
    """Where a descent from a start ends."""
    return descent(start.path.program, start.path.x) if start.path else Descent(None, False)


@dataclass
class _Scan:
    """Programs along dt, up to the first whose own path the vehicle can fly."""

    attempts: Attempts
    first: float  # [s]
    last: float  # [s]
    least: float  # [s] of all intervals together
    flown: Placement | None = None  # the answer that the vehicle can fly as it is
    slots: dict[float, _Slots] = field(default_factory=dict)  # of each program, by its dt

    def starts(self) -> Iterator[Placement]:
        """Answers that are not far from what the vehicle can do, each as a path of its program."""
        dt, before, solved, unsolved = self.first, inf, False, 0
        while COARSE_GROWTH * dt * self.attempts.formulation.chain.intervals < self.least:
            dt *= COARSE_GROWTH
        while dt <= self.last and unsolved < UNSOLVED and not self.attempts.is_over:
            placement = self.attempts.placement(dt, SCAN_NODES)
            self.slots[dt] = placement.answer.slots
            violation = placement.path.violation if placement.path else inf
            self._record(placement, violation)
            if violation <= 0.0:
                self.flown = replace(placement, path=None)
            if violation <= FAR or (violation < inf and violation * FALLING > before):
                yield placement
            if violation <= 0.0:
                return
            solved = solved or violation < inf
            unsolved = unsolved + 1 if solved and placement.answer.status == "unknown" else 0
            dt, before = dt * (GROWTH if violation < COARSE else COARSE_GROWTH), violation

    def slots_around(self, dt: float) -> _Slots:
        """The slots of the programs next to a dt on either side, where they are the same; else None."""
        below = max((known for known in self.slots if known <= dt), default=None)
        above = min((known for known in self.slots if known >= dt), default=None)
        if below is None or above is None or self.slots[below] != self.slots[above]:
            return None
        return self.slots[below]

    def certified(self) -> Judged[Placement] | None:
        """The answer that the vehicle can fly as it is, certified, or None."""
        if self.flown is None:
            return None
        judged = self.attempts.judge(self.flown)
        return judged if judged.feasible else None

    def _record(self, placement: Placement, violation: float) -> None:
        if violation > 0.0:
            failure = placement.path.excess_sentence if placement.path else None
            self.attempts.judge(replace(placement, path=None), failure, -violation)
