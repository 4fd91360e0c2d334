"""The shortest path that a vehicle can fly: from programs along a scan on dt, each refined from its path.

The programs know no rotors. Those of small dt, which the vehicle cannot fly, have their stages where a fast
path has them: from there refinement ends at shorter paths than from those that it can.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.assessment.assessment import SUSPICIOUS
from aerobat.planning.certified_solve import Judged
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.refinement.excess import Excess
from aerobat.planning.refinement.refine import RefinedPath, Refinement
from aerobat.planning.warm_start import WarmStart

GROWTH = 1.15  # of dt, from one program to the next
COARSE_GROWTH = 1.3  # where a path is further off than that
COARSE = 4.0  # of a limit's size
FAR = 1.3  # of a limit's size: a path that exceeds it by more is no place to begin
STARTS = 2  # that are refined roughly, of which the fastest is refined finely first
MAX_STARTS = 4
SCAN_NODES = 500  # of a program's branch and bound: paths begin at its slots, which need not be the cheapest
SCAN_PLACES = 5  # of an interval, at which limits are looked at along a scan
UNSOLVED = 3  # programs without an answer, after others that have one: the longer ones are no better
SLOW = 1.2  # times what no motion falls short of: a path that takes longer is looked for once more,
SHORTER = (0.8, 0.9, 0.97)  # from programs of such fractions of its duration

_Slots = tuple[int, ...] | None


def shortest(
    attempts: Attempts,
    refinement: Refinement,
    segments: int,
    scanned: tuple[float, float],
    least: float,
) -> Judged[RefinedPath] | Judged[Placement] | None:
    """The shortest certified path found, or the first of a program that is flown as it is, or None.

    Args:
        attempts: Made and recorded here.
        refinement: Of their paths.
        segments: Of a refined path.
        scanned: The scan's smallest and largest dt [s].
        least: The duration [s] that no motion falls short of: shorter programs are left out.
    """
    scan, rough = _Scan(attempts, refinement, scanned, least), list[RefinedPath]()
    for begun, (slots, guess) in enumerate(scan.starts(), 1):
        path = refinement.rough(guess, segments, min(map(_duration, rough), default=inf))
        if refinement.is_promising(path):
            scan.known.append(slots)
            rough.append(path)
        if len(rough) >= STARTS or begun >= MAX_STARTS or out_of_time():
            break
    found: Judged[RefinedPath] | None = None
    for path in sorted(rough, key=_duration):
        judged = refinement.finished(path)
        if judged.feasible:
            found = _shortened(judged, scan, segments)
            break
    return _from_closed_form(found, scan, segments) or scan.certified()


def _from_closed_form(
    known: Judged[RefinedPath] | None, scan: _Scan, segments: int
) -> Judged[RefinedPath] | None:
    """A path from the closed form through points where the known one is slow, or missing; else that one."""
    task = scan.refinement.task
    is_slow = known is None or known.solution.duration > SUSPICIOUS * scan.least
    if not (is_slow and task.problem.maneuver.through_points) or is_course(task.stages) or out_of_time():
        return known
    try:
        start = WarmStart.of(MinSnap().plan(task.problem, task.vehicle), task.stages)
    except Infeasible:
        return known
    return _shorter(scan, start, segments, known) or known


def _shortened(judged: Judged[RefinedPath], scan: _Scan, segments: int) -> Judged[RefinedPath]:
    """The same, or a shorter one from programs shorter than it, where it is slow beside what is possible.

    The scan's starts are slower than what they lead to, and have stages where a slower path has them.
    """
    best = judged
    for fraction in SHORTER:
        duration = judged.solution.duration
        if duration <= SLOW * scan.least or fraction * duration < scan.least or out_of_time():
            continue
        start = scan.start(fraction * duration / scan.attempts.formulation.chain.intervals)
        if start is None:
            continue
        best = _shorter(scan, start, segments, best) or best
    return best


def _shorter(
    scan: _Scan, start: WarmStart, segments: int, known: Judged[RefinedPath] | None
) -> Judged[RefinedPath] | None:
    """The certified path near a start, where it is shorter than a known one; else None."""
    refinement, longest = scan.refinement, inf if known is None else known.solution.duration
    path = refinement.rough(start, segments, longest)
    if not refinement.is_promising(path) or _duration(path) >= longest:
        return None
    found = refinement.finished(path)
    return found if found.feasible and found.solution.duration < longest else None


def _duration(path: RefinedPath) -> float:
    return path.path.trajectory.duration


@dataclass
class _Scan:
    """Programs along dt, up to the first whose own path the vehicle can fly."""

    attempts: Attempts
    refinement: Refinement
    scanned: tuple[float, float]  # the smallest and the largest dt [s]
    least: float  # [s] of all intervals together
    known: list[_Slots] = field(default_factory=list)  # that lead to a path
    flown: Placement | None = None  # the answer that the vehicle can fly as it is

    def starts(self) -> Iterator[tuple[_Slots, WarmStart]]:
        """Slots and paths of answers near what the vehicle can do, but of those through known slots."""
        (dt, last), solved, unsolved = self.scanned, False, 0
        while COARSE_GROWTH * dt * self.attempts.formulation.chain.intervals < self.least:
            dt *= COARSE_GROWTH
        while dt <= last and unsolved < UNSOLVED and not self.attempts.is_over:
            placement = self.attempts.solve(dt, SCAN_NODES)
            excess = inf
            if placement.answer.x is not None:
                guess = self.attempts.path(placement)
                excess = self._recorded(placement, guess)
            else:
                self.attempts.judge(placement)
            if excess <= FAR and placement.answer.slots not in self.known:
                yield placement.answer.slots, guess
            if excess <= 0.0:
                self.flown = placement
                return
            solved = solved or excess < inf
            unsolved = unsolved + 1 if solved and placement.answer.status == "unknown" else 0
            dt *= GROWTH if excess < COARSE else COARSE_GROWTH

    def start(self, dt: float) -> WarmStart | None:
        """The path of the program of a dt through slots that led nowhere yet; None where it has none."""
        placement = self.attempts.solve(dt, SCAN_NODES)
        if placement.answer.x is None or placement.answer.slots in self.known:
            return None
        self.known.append(placement.answer.slots)
        return self.attempts.path(placement)

    def certified(self) -> Judged[Placement] | None:
        """The answer that the vehicle can fly as it is, certified, or None."""
        if self.flown is None:
            return None
        judged = self.attempts.judge(self.flown)
        return judged if judged.feasible else None

    def _recorded(self, placement: Placement, guess: WarmStart) -> float:
        """The largest excess of an answer's path, which is kept as an attempt where there is one."""
        found = Excess.of(guess.trajectory, self.refinement.limits, SCAN_PLACES)
        if not found.holds:
            self.attempts.judge(placement, found.reason, -found.largest)
        return 0.0 if found.holds else found.largest
