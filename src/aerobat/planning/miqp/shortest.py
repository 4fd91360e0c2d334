"""The shortest path that a vehicle can fly, refined from the paths of programs along a scan on dt.

The programs know no rotors. The vehicle cannot fly the paths of programs with small dt, but these place the
stages as a fast path does. From such paths, refinement ends at shorter paths than from flyable ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.refinement.refine import RefinedPath, Refinement
from aerobat.planning.refinement.violation import ConstraintViolation
from aerobat.planning.warm_start import WarmStart

GROWTH = 1.15  # factor on dt from one program to the next
COARSE_GROWTH = 1.3  # the same factor where the constraint violation is COARSE or more
COARSE = 4.0  # constraint violation, relative to a limit's size
FAR = 1.3  # largest constraint violation, relative to a limit's size, of a path that is refined
STARTS = 2  # number of promising rough paths that is enough; the fastest is refined finely first
MAX_STARTS = 4  # largest number of starts that are refined roughly
SCAN_NODES = 500  # node limit of a program's branch and bound: slots for a start need not be optimal
SCAN_PLACES = 5  # samples of an interval at which limits are evaluated along a scan
UNSOLVED = 3  # programs in a row without an answer, after solved ones, that end a scan: longer ones fail too
SLOW = 1.2  # ratio to the lower bound on the duration above which shorter programs are tried as starts
SHORTER = (0.8, 0.9, 0.97)  # durations of these programs, relative to the path's duration

_Slots = tuple[int, ...] | None


def shortest(
    attempts: Attempts,
    refinement: Refinement,
    segments: int,
    scanned: tuple[float, float],
    least: float,
) -> Judged[RefinedPath] | Judged[Placement] | None:
    """Return the shortest certified path found, else the certified path of a program itself, or None.

    Args:
        attempts: Solves and records the programs.
        refinement: Refines the programs' paths.
        segments: Number of segments of a refined path.
        scanned: The scan's smallest and largest dt [s].
        least: A lower bound on the duration of any motion [s]; programs far below it are skipped.
    """
    scan, rough = _Scan(attempts, refinement, scanned, least), list[RefinedPath]()
    starts = scan.starts()
    for number, (slots, guess) in enumerate(starts, 1):
        path = refinement.rough(guess, segments, min((each.duration for each in rough), default=inf))
        if refinement.is_promising(path):
            scan.known.append(slots)
            rough.append(path)
        if len(rough) >= STARTS or number >= MAX_STARTS or out_of_time():
            break
    found: Judged[RefinedPath] | None = None
    for path in sorted(rough, key=lambda each: each.duration):
        judged = refinement.finished(path)
        if judged.feasible:
            found = _shortened(judged, scan, segments)
            break
    return found or _from_flown(scan, starts, segments) or scan.certified()


def _from_flown(
    scan: _Scan, starts: Iterator[tuple[_Slots, WarmStart]], segments: int
) -> Judged[RefinedPath] | None:
    """The path near the scan's first answer that the vehicle can fly as it is, or None."""
    for _ in starts:  # runs the scan to its end, which finds what the vehicle can fly
        pass
    if scan.flown is None or out_of_time():
        return None
    return _shorter(scan, scan.attempts.path(scan.flown), segments)


def _shortened(judged: Judged[RefinedPath], scan: _Scan, segments: int) -> Judged[RefinedPath]:
    """Return a path, or a shorter one from shorter programs where the path is slow beside the lower bound.

    The scan's starts are slower than the paths refined from them, and place the stages as slower paths do.
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
    scan: _Scan, start: WarmStart, segments: int, known: Judged[RefinedPath] | None = None
) -> Judged[RefinedPath] | None:
    """Return the certified path refined from a start if it is shorter than a known one, else None."""
    refinement, longest = scan.refinement, inf if known is None else known.solution.duration
    path = refinement.rough(start, segments, longest)
    goes_on = refinement.is_promising(path) and path.duration < longest
    found = refinement.finished(path) if goes_on else path.certified
    return found if found and found.feasible and found.solution.duration < longest else None


@dataclass
class _Scan:
    """A scan of programs with rising dt, up to the first whose own path the vehicle can fly."""

    attempts: Attempts
    refinement: Refinement
    scanned: tuple[float, float]  # the smallest and the largest dt [s]
    least: float  # lower bound on the duration of any motion [s]
    known: list[_Slots] = field(default_factory=list)  # slots of stages from which a path was refined
    flown: Placement | None = None  # the answer whose own path satisfies the limits at samples

    def starts(self) -> Iterator[tuple[_Slots, WarmStart]]:
        """Yield slots and paths of answers that violate limits by FAR at most, without known slots."""
        (dt, last), solved, unsolved = self.scanned, False, 0
        while COARSE_GROWTH * dt * self.attempts.formulation.chain.intervals < self.least:
            dt *= COARSE_GROWTH
        while dt <= last and unsolved < UNSOLVED and not self.attempts.is_over:
            placement = self.attempts.solve(dt, SCAN_NODES)
            violation = inf
            if placement.answer.x is not None:
                guess = self.attempts.path(placement)
                violation = self._recorded(placement, guess)
            else:
                self.attempts.judge(placement)
            if violation <= FAR and placement.answer.slots not in self.known:
                yield placement.answer.slots, guess
            if violation <= 0.0:
                self.flown = placement
                return
            solved = solved or violation < inf
            unsolved = unsolved + 1 if solved and placement.answer.status == "unknown" else 0
            dt *= GROWTH if violation < COARSE else COARSE_GROWTH

    def start(self, dt: float) -> WarmStart | None:
        """Return the path of the program at a dt; None where it has none, or its slots are known."""
        placement = self.attempts.solve(dt, SCAN_NODES)
        if placement.answer.x is None or placement.answer.slots in self.known:
            return None
        self.known.append(placement.answer.slots)
        return self.attempts.path(placement)

    def certified(self) -> Judged[Placement] | None:
        """Return the answer whose own path the vehicle can fly if it is certified, else None."""
        if self.flown is None:
            return None
        judged = self.attempts.judge(self.flown)
        return judged if judged.feasible else None

    def _recorded(self, placement: Placement, guess: WarmStart) -> float:
        """Return the largest constraint violation of an answer's path; record an attempt if there is one."""
        found = ConstraintViolation.of(guess.trajectory, self.refinement.limits, SCAN_PLACES)
        if not found.holds:
            self.attempts.judge(placement, found.reason, -found.largest)
        return 0.0 if found.holds else found.largest
