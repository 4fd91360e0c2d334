"""Trajectory refinement: from a path through stages to the fastest certified polynomials near the path.

Limits along a path form a semi-infinite program, which is solved with the limits held at discrete places.
Where a path violates limits between places, the next round adds a place there (Blankenship and Falk,
"Infinitely constrained optimization problems", 1976). The next round also tightens the limits by a back-off
(Mitsos, "Global optimization of semi-infinite programs via restriction of the right-hand side", 2011).
Rough rounds check limits on dense samples and end when the duration hardly falls. Fine rounds are more
strongly damped, so that repaired violations do not return, and end when the path is certified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate, Verdict
from aerobat.errors import Reason
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.limits.path_condition import limit_of
from aerobat.optimization.deadline import count_work, out_of_time, within_share
from aerobat.optimization.interior_point import Settings, interior_point
from aerobat.planning.certified_solve import Judged, Solution, certified_solve, judge
from aerobat.planning.courses import is_course
from aerobat.planning.gate_clearance import bodies_in_gates
from aerobat.planning.passages import PlacedStage, place_stages
from aerobat.planning.recorder import Recorder
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.program import Multipliers, RefinementProgram
from aerobat.planning.refinement.spline import END_ORDER, Spline, chebyshev
from aerobat.planning.refinement.stage_values import StageValues
from aerobat.planning.refinement.violation import INWARD, JUST_INSIDE, ConstraintViolation
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.limits import UNITS
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory, polynomial

SEGMENTS = 8  # segments of a maneuver: within 1 % of the fastest; 16 segments take three times as long
LEG_SEGMENTS = 2  # segments of each leg of a course
MAX_SEGMENTS = 160  # largest number of segments of a path, where a solve takes about a second
# Interior point settings of the first round, which begins at a path that may violate limits by far
FIRST = Settings(least_barrier=1e-5, least_slack=0.1, gain=2e-4)
ROUGH = Settings(barrier=1e-6, least_slack=1e-3)  # of the rough rounds after the first
FINE = Settings(
    barrier=1e-6, least_slack=1e-3, damping=1e-2, iterations=30, tolerance=1e-5, violation=5e-5, gain=2e-4
)
# Settings for `Refinement.high_accuracy`. A barrier costs about its parameter times the number of limits at
# places: with the ten thousand of a course, 1 % of the duration. Fine rounds must not begin with a larger
# barrier parameter than rough rounds end with: paths would move away from the limits again.
ACCURATE_ROUGH = Settings(
    barrier=1e-6, least_barrier=1e-7, least_slack=1e-3, iterations=100, tolerance=1e-6, gain=1e-4
)
ACCURATE_FINE = Settings(
    barrier=1e-8,
    least_barrier=1e-8,
    least_slack=1e-3,
    damping=1e-3,
    iterations=60,
    tolerance=1e-6,
    violation=5e-5,
    gain=1e-4,
)
ROUGH_ROUNDS = 8  # largest number of rough rounds
FINE_ROUNDS = 16  # largest number of fine rounds before a path is certified
MORE_ROUNDS = 1  # further series of fine rounds, each from the last certified path
REDISTRIBUTIONS = 4  # most redistributions of knots: plans of 60 random problems get 1.2 % shorter on average
ROUGH_TIME_FRACTION = 0.5  # fraction of the remaining time for rough rounds; the rest is for certification
PLACES = 16  # places of a segment in the first round: with 12, finding the peaks between them does not help
MORE_PLACES = 1.5  # factor on PLACES where rotors have no lag and their thrusts may jump
MOST_DOUBLED = 4 * SEGMENTS  # segments from which no more are tried where certification fails or costs LOSS
LOSS = 0.02  # increase of duration by certification, relative, from which twice as many segments are tried
ROUND_WORK = 1e-3  # work of a round but for its program, for each segment [s] (benchmarks/work.py)
LITTLE_GAIN = 0.005  # relative decrease of duration below which rough rounds end
# constraint violation, relative to the limit's size, above which rough rounds continue
CONVERGED_VIOLATION = 0.1
DURATION_CUTOFF = 0.02  # relative excess over a known path's duration at which a slower path is given up
TRUST_RADIUS = 2.0  # half the width of the box (trust region) of scaled derivatives in the first round
SHRINK = 1.5  # factor by which TRUST_RADIUS shrinks from one rough round to the next
MIN_TRUST_RADIUS = 1.0  # lower bound of the shrinking TRUST_RADIUS
STRETCH = 1.6  # factor by which segment durations may change in one round
BACKOFF = 1e-4  # initial tightening of all limits at places, relative to their sizes
MAX_BACKOFF = 0.03  # largest tightening that one round adds, as large violations move elsewhere
# Constraint violation, relative to the limit's size, above which each segment gets one more place at its
# peak, and limits are tightened less (REDUCED_BACKOFF). Plans of 27 random problems get 1.4 % shorter on
# average by that, in four fifths of the time.
PEAK_VIOLATION = 1e-3
# largest number of places added to a segment; later rounds tighten by the full amount instead
MAX_ADDED_PLACES = 8
# least distance of an added place from its neighbours, as a fraction of the gap between them
MIN_SPACING = 0.25
# smallest gap between places that is divided, as a fraction of a segment: what fits closer ones overflows
MIN_GAP = 1e-6
REDUCED_BACKOFF = 0.1  # factor on the tightening in rounds that add places
MIN_PROGRESS = 0.02  # relative change of duration and of violation below which rounds have stalled
BACKOFF_FACTOR = 1.3  # factor on violations that gives the tightening of fine rounds
BACKOFF_OFFSET = 2e-4  # constant added to that tightening, relative to the limit's size
# Distance from the tightened limit, relative to the limit's size, within which a certificate may find a
# violation that dense samples miss.
NEAR_LIMIT = 2e-3
# largest constraint violation, relative to the limit's size, that further rounds may repair
REPAIRABLE_VIOLATION = 0.5
# The same among rough rounds: commands of rotors that lag may swing by more than their range between places,
# and a round later by a tenth. With 0.5, closed forms of such vehicles are given up, and a course of figures
# (benchmarks/freestyle.py) takes 6.12 s instead of 5.55 s.
BETWEEN_PLACES = 2.0
RELATIVE_STAGE_TOLERANCE = 1e-5  # violation of a stage's condition, relative to its size, that is rounding
# Largest violation of a stage's condition, relative to its size, that further rounds may repair. With 0.02,
# half-flips of x500 through gates at 45° and 60° took half as long again.
REPAIRABLE_MISS = 0.1
# Room for the body in gates that a path may miss, relative to its size. Where it misses more, no path near
# has the room: x500's flip in roll took 18 s of rounds in vain, 3 s without them. 0.005 to 0.02 are alike.
MISSED_ROOM = 0.01
NEWTON_STEPS = 3  # Newton steps that satisfy equalities and stages exactly after a solve
CONVERGED = "locally optimal"  # the status of a converged solution


@dataclass(frozen=True, eq=False)
class RefinedPath:
    """A path with its stages and its constraint violations."""

    path: WarmStart
    violation: ConstraintViolation  # constraint violations on dense samples
    multipliers: Multipliers | None = None  # of the last program's inequalities
    certified: Judged[RefinedPath] | None = None  # the shortest certified path of the rough rounds up to here

    @property
    def duration(self) -> float:
        """The duration of the path [s]."""
        return self.path.trajectory.duration

    @property
    def placed(self) -> tuple[PlacedStage, ...]:
        """The path's stages, each in its segment."""
        path = self.path
        numbers = np.searchsorted(path.trajectory.knots[1:-1], path.times, side="left").tolist()
        return place_stages(path.stages, numbers, path.times)


@dataclass(frozen=True, eq=False)
class Refinement:
    """The data that all refinements of one problem for one vehicle share."""

    task: Task
    recorder: Recorder
    in_gates: tuple[BodyInGate, ...] = ()  # room of the body in the gates that stages cross
    still_ends: bool = False  # whether the jerk is zero at the ends
    high_accuracy: bool = False  # whether solves are more accurate: within 0.1 % of the local optimum
    # whether paths get twice as many segments where certification costs more than LOSS
    adds_segments: bool = False
    # whether a path that misses a stage after its first round, or with few segments, is given up: more rounds
    # and segments take several times as long, mostly in vain. For planners that have other starts.
    gives_up_early: bool = False
    _known: dict[tuple[Stage, ...], StageValues] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, task: Task, recorder: Recorder, still_ends: bool = False) -> Refinement:
        """Return the refinement of a task's paths, with room for the body in all gates.

        Args:
            task: The task that is planned, with a vehicle.
            recorder: Records one attempt a round.
            still_ends: Whether the jerk is zero at the ends.
        """
        return cls(task, recorder, bodies_in_gates(task), still_ends)

    @property
    def settings(self) -> tuple[Settings, Settings]:
        """The interior point settings of rough rounds after the first, and of fine rounds."""
        return (ACCURATE_ROUGH, ACCURATE_FINE) if self.high_accuracy else (ROUGH, FINE)

    @cached_property
    def limits(self) -> LimitValues:
        """The limits that hold along the whole path, without limits that others imply."""
        return LimitValues(self.task)

    @property
    def with_and_without_rooms(self) -> tuple[Refinement, ...]:
        """The refinement, then one that asks no room for the body in gates: some gates leave too little."""
        return (self, replace(self, in_gates=())) if self.in_gates else (self,)

    def stage_values(self, stages: tuple[Stage, ...]) -> StageValues:
        """Return the constraints of stages, which are in the order of a path; compiled once per order."""
        if stages not in self._known:
            self._known[stages] = StageValues(stages, self.task, self.rooms(stages))
        return self._known[stages]

    def rooms(self, stages: tuple[Stage, ...]) -> tuple[BodyInGate, ...]:
        """Return the body's room in gates, with the stages' numbers in the order of a path."""
        if self.task.stages.ordered:
            return self.in_gates
        gates = [stage.gate for stage in stages]
        return tuple(replace(body, stage=gates.index(body.gate.name)) for body in self.in_gates)

    def refined(self, guess: WarmStart, segments: int) -> Judged[RefinedPath]:
        """Return the fastest certified path near a guess, or the last path tried where none is certified.

        Args:
            guess: A path through the stages, feasible or not.
            segments: Number of segments of the result, which has a knot at every stage.
        """
        rough = self.rough(guess, segments)
        if self.is_promising(rough):
            return self.finished(rough)
        return Judged(self.task, self.solution(rough, "unknown"), None, False)

    def rough(self, guess: WarmStart, segments: int, known: float = np.inf) -> RefinedPath:
        """Return a path near a guess after rough rounds; it may violate limits a little between places.

        Mesh refinement: the first solves have few segments, which allow large steps. Then the number of
        segments is doubled until `segments` is reached.

        Args:
            guess: A path through the stages, feasible or not.
            segments: Number of segments of the result, which has a knot at every stage.
            known: The duration [s] of a known path. A path that stays much slower is given up early.
        """
        number = min(segments, max(SEGMENTS, len(guess.phases)))
        with within_share(ROUGH_TIME_FRACTION):
            return self.finer(self._rough(knots_at_stages(guess, number), known), segments, known)

    def finer(self, found: RefinedPath, segments: int, known: float = np.inf) -> RefinedPath:
        """Return a rough path after mesh refinement: segments are doubled, then knots are redistributed.

        Args:
            found: A rough path.
            segments: Number of segments of the result, at least that of `found`.
            known: The duration [s] of a known path. A path that stays much slower is given up early.
        """
        number = found.path.trajectory.segments
        while number < segments and not out_of_time() and not self._gives_up(found):
            number = min(2 * number, segments)
            found = self._rough(knots_at_stages(found.path, number), known, found.certified)
        return self._redistribute_knots(found, known)

    def _redistribute_knots(self, found: RefinedPath, known: float) -> RefinedPath:
        """Redistribute the knots evenly between stages and solve again, as long as the duration falls."""
        for _ in range(REDISTRIBUTIONS):
            duration = found.duration
            if out_of_time() or not self.is_promising(found) or duration > (1.0 + DURATION_CUTOFF) * known:
                break
            spread = knots_at_stages(found.path, found.path.trajectory.segments)
            again = self._rough(spread, duration, found.certified, found.multipliers)
            if not self.is_promising(again) or again.duration >= duration:
                break
            found = again
            if again.duration > (1.0 - LITTLE_GAIN) * duration:
                break
        return found

    def _rough(
        self,
        guess: WarmStart,
        known: float,
        certified: Judged[RefinedPath] | None = None,
        multipliers: Multipliers | None = None,
    ) -> RefinedPath:
        """Run rough rounds from a guess with knots at its stages; stop early if far slower than `known` [s].

        The result's `certified` is the shortest certified path of these rounds and of earlier ones.
        """
        rounds = Rounds(self, guess, multipliers=multipliers)
        before = np.inf
        for number in range(ROUGH_ROUNDS):
            solution = rounds.solve()
            certified = _shortest(certified, judge(solution, self.task, self.recorder))
            duration = solution.duration
            has_converged = number and solution.source.violation.largest < CONVERGED_VIOLATION
            gains_little = has_converged and duration > (1.0 - LITTLE_GAIN) * before
            is_slow = duration > (1.0 + DURATION_CUTOFF) * known
            is_over = gains_little or is_slow or rounds.has_stalled(solution)
            if is_over or out_of_time() or self._is_hopeless(solution.source, is_first=not number):
                break
            before = duration
            rounds.recenter(solution.source)
        return replace(solution.source, certified=certified)

    def finished(self, rough: RefinedPath) -> Judged[RefinedPath]:
        """Return the shortest certified path near a rough one, or the last path tried if none is certified.

        Where the duration has not converged, another series of fine rounds begins at the certified path.
        """
        judged = self._fine_rounds(rough)
        judged = _shortest(judged, rough.certified) or judged
        for _ in range(MORE_ROUNDS):
            solution = judged.solution
            if not judged.feasible or solution.status == CONVERGED or out_of_time():
                break
            again = self._fine_rounds(solution.source)
            if not again.feasible or again.solution.duration >= solution.duration:
                break
            judged = again
        return self._with_more_segments(rough, judged) if self.adds_segments else judged

    def _with_more_segments(self, rough: RefinedPath, found: Judged[RefinedPath]) -> Judged[RefinedPath]:
        """Return the certified path, or a shorter certified path with up to four times as many segments.

        More segments are tried where limits left no certified path, or one much longer than the rough one.
        Courses have many segments already.
        """
        path, known = rough.path.trajectory, found.solution.duration if found.feasible else np.inf
        loses_little = known <= (1.0 + LOSS) * path.duration
        has_most = is_course(self.task.stages) or path.segments >= MOST_DOUBLED
        if loses_little or has_most or out_of_time() or self._missed_stage(found.solution.source.path):
            return found
        finer = self.finer(rough, 2 * path.segments, known)
        if not self.is_promising(finer) or finer.duration >= known:
            return found
        judged = self.finished(finer)
        return judged if judged.feasible and judged.solution.duration < known else found

    def _fine_rounds(self, rough: RefinedPath) -> Judged[RefinedPath]:
        """Run one series of fine rounds; return the certified path, or the last path tried."""
        _, fine = self.settings
        rounds = Rounds(self, rough.path, fine, radius=MIN_TRUST_RADIUS, multipliers=rough.multipliers)
        rounds.back_off(rough.violation)
        return certified_solve(rounds, self.task, self.recorder, FINE_ROUNDS)

    def is_promising(self, path: RefinedPath, violation: float = REPAIRABLE_VIOLATION) -> bool:
        """Return whether further rounds may repair a path's constraint violations and what it misses.

        Args:
            path: The path.
            violation: The largest violation that they may repair, relative to the limit's size.
        """
        nearly_holds = path.violation.largest <= violation and self._nearly_meets_stages(path)
        return nearly_holds and self._has_room(path.path)

    def _gives_up(self, path: RefinedPath) -> bool:
        """Return whether the refinement gives a path up early, before it has the requested segments."""
        return self.gives_up_early and not self._nearly_meets_stages(path)

    def _nearly_meets_stages(self, path: RefinedPath) -> bool:
        """Return whether a path misses no stage by more than further rounds may repair."""
        return self._missed_stage(path.path, REPAIRABLE_MISS) is None

    def _has_room(self, path: WarmStart) -> bool:
        """Return whether a path leaves nearly all of the body's room in gates."""
        return self.stage_values(path.stages).missing_room(path.at_stages) <= MISSED_ROOM

    def _is_hopeless(self, path: RefinedPath, is_first: bool) -> bool:
        """Return whether rough rounds end, as further ones would not repair a path.

        The second round of a maneuver may meet stages that the first round, from far away, misses. No round
        makes room in gates. Courses have many starts.
        """
        goes_on = is_first and not (self.gives_up_early or is_course(self.task.stages))
        return not self._has_room(path.path) if goes_on else not self.is_promising(path, BETWEEN_PLACES)

    def path(self, guess: WarmStart) -> RefinedPath:
        """Return a path with its constraint violations on dense samples."""
        return RefinedPath(guess, ConstraintViolation.of(guess.trajectory, self.limits))

    def solution(
        self, path: RefinedPath, status: str, iterations: int = 0, time: float = 0.0
    ) -> Solution[RefinedPath]:
        """Return a path as a solution, with a failure if the path misses a stage or violates limits.

        Args:
            path: The path.
            status: The solver's status.
            iterations: The solver's iterations.
            time: The solver's time [s].
        """
        trajectory, violation = path.path.trajectory, path.violation
        failure = self._missed_stage(path.path)
        if failure is None and not violation.holds:
            reason, leg = violation.reason, path.path.leg_at(violation.place[1])
            failure = Reason(f"{reason}{leg}", reason.limits)
        return Solution(
            source=path,
            duration=trajectory.duration,
            trajectory=trajectory,
            status=status,
            nodes=iterations,
            solve_time=time,
            cost=trajectory.duration if self.is_promising(path) else None,
            failure=failure,
        )

    def _missed_stage(self, path: WarmStart, tolerance: float = RELATIVE_STAGE_TOLERANCE) -> Reason | None:
        """Return a sentence about the first stage that a path misses, or None.

        Args:
            path: The path, with its stages' times.
            tolerance: By how much a condition may be missed, as a fraction of the condition's size.
        """
        for stage, time, flat in zip(path.stages, path.times, path.at_stages, strict=True):
            where = (f"stage '{stage.name}'",)
            for condition in stage.conditions:
                excess = float(condition.bound(self.task.balance).excess(flat[:3]))
                if excess > tolerance * limit_of(condition, self.task.balance).size:
                    quantity = condition.quantity
                    missed = f"{excess:.2g} {UNITS[quantity.derivative]} of {quantity.replace('_', ' ')}"
                    return Reason(f"the stage '{stage.name}' is missed by {missed}", where)
            ball = stage.ball
            away = 0.0 if ball is None else float(np.linalg.norm(flat[0] - ball.centre)) - ball.radius
            if away > tolerance - RELATIVE_STAGE_TOLERANCE:
                return Reason(f"the stage '{stage.name}' is missed by {away:.2g} m", where)
            fraction, (earliest, latest) = time / path.trajectory.duration, stage.window
            if max(earliest - fraction, fraction - latest) > tolerance:
                return Reason(
                    f"the stage '{stage.name}' is passed at {fraction:.3g} of the duration, not when asked",
                    where,
                )
        return None


class Rounds:
    """Successive programs, each around the last path, with limits tightened where that path violates them."""

    def __init__(
        self,
        refinement: Refinement,
        guess: WarmStart,
        settings: Settings = FIRST,
        places: int = PLACES,
        radius: float = TRUST_RADIUS,
        multipliers: Multipliers | None = None,
        stretch: float = STRETCH,
    ) -> None:
        limits = refinement.limits
        self._refinement, self._guess, self._settings = refinement, guess, settings
        jumps = not refinement.task.vehicle.lags.any()
        fractions = chebyshev(round(places * (MORE_PLACES if jumps else 1.0)))
        initial = np.tile(fractions, (guess.trajectory.segments, 1))
        self._fractions = initial if multipliers is None else multipliers.fractions
        self._max_places, self._last_violation = self._fractions.shape[1] + MAX_ADDED_PLACES, np.inf
        self._radius, self._stretch = radius, stretch
        trajectory = guess.trajectory
        away = (np.abs(trajectory.knots[1:] - time) for time in guess.times)  # of segments' ends from stages
        self._segments = tuple(int(np.argmin(each)) for each in away)
        kept = limits.reserve + BACKOFF
        self._backoff = np.tile(kept, (trajectory.segments, 1))
        self._multipliers = multipliers

    def solve(self) -> Solution[RefinedPath]:
        """Solve the program around the last path."""
        began, refinement = perf_counter(), self._refinement
        count_work(ROUND_WORK * self._guess.trajectory.segments)
        program = self._program
        known = None if self._multipliers is None else program.at_its_places(self._multipliers)
        answer = interior_point(program, program.spline.start, self._settings, known)
        self._multipliers = Multipliers(answer.z, program.fractions)
        x = with_exact_stages(program, answer.x)
        trajectory = program.spline.trajectory(x)
        times = tuple(float(trajectory.knots[segment + 1]) for segment in self._segments)
        found = refinement.path(replace(self._guess, trajectory=trajectory, times=times))
        path = replace(found, multipliers=self._multipliers)
        is_unchanged = abs(trajectory.duration / self._guess.trajectory.duration - 1.0) < LITTLE_GAIN
        status = CONVERGED if answer.converged or is_unchanged else "unknown"
        return refinement.solution(path, status, answer.iterations, perf_counter() - began)

    def tighten(self, solution: Solution[RefinedPath], certificate: Certificate | None) -> bool:
        """Make a path the next guess and tighten limits where samples or its certificate show violations.

        Return False where further rounds lead nowhere.
        """
        violation = solution.source.violation
        if out_of_time() or self.has_stalled(solution) or not self._refinement.is_promising(solution.source):
            return False
        self.back_off(violation, BACKOFF_FACTOR, BACKOFF_OFFSET)
        if certificate is not None:
            refuted, times = _refuted(certificate, self._refinement.task.reserve)
            self._add_places(_with_times(violation.peaks, solution.source.path.trajectory, times))
            kept = self._backoff - self._refinement.limits.reserve
            is_near = violation.nearby + kept > -NEAR_LIMIT
            self._backoff += (BACKOFF_FACTOR * refuted + BACKOFF_OFFSET) * is_near
        self._guess = solution.source.path
        return True

    def has_stalled(self, solution: Solution[RefinedPath]) -> bool:
        """Return whether rounds have stalled: large violation, hardly changed, in the same duration."""
        violation = solution.source.violation.largest
        pairs = (solution.duration, self._guess.trajectory.duration), (violation, self._last_violation)
        is_unchanged = all(abs(new - old) < MIN_PROGRESS * old for new, old in pairs)
        return violation > CONVERGED_VIOLATION and is_unchanged

    def recenter(self, path: RefinedPath) -> None:
        """Make a path the next guess, shrink the box and tighten limits where the path violates them."""
        self._guess, (self._settings, _) = path.path, self._refinement.settings
        self._radius = max(self._radius / SHRINK, MIN_TRUST_RADIUS)
        self.back_off(path.violation)

    def back_off(self, violation: ConstraintViolation, factor: float = 1.0, more: float = 0.0) -> None:
        """Add a place at each segment's largest violation, and tighten limits where they are violated.

        Args:
            violation: The violations of the last path.
            factor: Tightening per violation.
            more: Constant that is added where a limit is violated, as a fraction of the limit's size.
        """
        exceeded = np.clip(violation.nearby, 0.0, MAX_BACKOFF)
        if violation.largest > PEAK_VIOLATION and self._add_places(violation.peaks):
            factor *= REDUCED_BACKOFF
        self._last_violation = violation.largest
        self._backoff += factor * exceeded + more * (exceeded > 0.0)

    def _add_places(self, peaks: Array) -> bool:
        """Add one place to each segment, near `peaks` (S,); return False where segments have too many."""
        if self._fractions.shape[1] >= self._max_places:
            return False
        held = np.array([_between(row, peak) for row, peak in zip(self._fractions, peaks, strict=True)])
        self._fractions = np.sort(np.concatenate([self._fractions, held[:, None]], axis=1), axis=1)
        return True

    @property
    def _program(self) -> RefinementProgram:
        """The program around the last path."""
        refinement, guess = self._refinement, self._guess
        spline = Spline(refinement.task, guess.trajectory, refinement.still_ends)
        return RefinementProgram(
            spline=spline,
            limits=refinement.limits,
            stages=refinement.stage_values(guess.stages),
            stage_segments=self._segments,
            fractions=self._fractions,
            backoff=self._backoff,
            radius=self._radius,
            stretch=self._stretch,
        )


def _shortest(*found: Judged[RefinedPath] | None) -> Judged[RefinedPath] | None:
    """Return the shortest of the certified paths among `found`, or None."""
    certified = (each for each in found if each is not None and each.feasible)
    return min(certified, key=lambda each: each.solution.duration, default=None)


def _refuted(certificate: Certificate, reserve: float) -> tuple[float, list[float]]:
    """Return a certificate's largest violation or reserve shortfall, and the times [s] of its violations.

    The first is a fraction of a limit's size, MAX_BACKOFF at most.
    """
    refuted = [f for f in certificate.findings if f.verdict is Verdict.VIOLATED and f.limit is not None]
    beyond = [-(f.margin or 0.0) / (f.size or max(abs(f.limit or 0.0), 1.0)) for f in refuted]
    missed = [shortfall.size for shortfall in reserve_shortfalls(certificate, reserve)]
    return min(max([*beyond, *missed], default=0.0), MAX_BACKOFF), [f.time for f in refuted]


def _between(places: Array, peak: float) -> float:
    """Return a fraction near a peak, within the nearest gap of sorted places that is not too narrow."""
    gaps = np.diff(places)
    away = np.maximum(places[:-1] - peak, peak - places[1:]).clip(0.0) + np.where(gaps < MIN_GAP, 1.0, 0.0)
    gap = int(np.flatnonzero(away == away.min())[-1])
    kept = MIN_SPACING * gaps[gap]
    return float(np.clip(peak, places[gap] + kept, places[gap + 1] - kept))


def _with_times(peaks: Array, trajectory: Trajectory, times: Sequence[float]) -> Array:
    """Return peaks (S,), moved to the times [s] in segments that contain one, as fractions of segments."""
    found = peaks.copy()
    for time in times:
        segment = int(np.searchsorted(trajectory.knots[1:-1], time))
        fraction = (time - trajectory.knots[segment]) / trajectory.durations[segment]
        found[segment] = np.clip(fraction, INWARD, 1.0 - INWARD)
    return found


def knots_at_stages(path: WarmStart, segments: int) -> WarmStart:
    """Return degree-9 polynomials that interpolate a path up to snap, with a knot at every stage.

    Args:
        path: A path of any degree.
        segments: Number of segments; at least one for each phase between stages is made.
    """
    phases = path.phases
    parts = np.ones(len(phases), dtype=int)
    while parts.sum() < segments:
        parts[np.argmax(phases / parts)] += 1
    durations = np.repeat(phases / parts, parts)
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    inside = np.stack([knots[:-1] + JUST_INSIDE * durations, knots[1:] - JUST_INSIDE * durations])
    ends = np.stack([path.trajectory.evaluate(inside, k) for k in range(END_ORDER)], axis=2)
    ends *= (durations[:, None] ** np.arange(END_ORDER))[..., None]
    trajectory = Trajectory(durations, polynomial.hermite(ends[0], ends[1]), path.trajectory.heading)
    return replace(path, trajectory=trajectory)


def segments_for(sequence: StageSequence, requested: int = SEGMENTS) -> int:
    """Return the number of a path's segments: `requested`, at least one a leg, LEG_SEGMENTS on a course."""
    legs = len(sequence.stages) + 1
    wanted = max(requested, LEG_SEGMENTS * legs) if is_course(sequence) else requested
    return min(max(wanted, legs), MAX_SEGMENTS)


def with_exact_stages(program: RefinementProgram, x: Array) -> Array:
    """Return variables (n,) after Newton steps (least norm) that satisfy equalities and stages exactly."""
    for _ in range(NEWTON_STEPS):
        with np.errstate(over="ignore", invalid="ignore"):
            values, rows = program.at(x).missed(REPAIRABLE_MISS)
        if not (np.isfinite(rows).all() and np.isfinite(values).all()):  # too far away for numbers
            break
        x = x - np.linalg.lstsq(rows, values, rcond=None)[0]
    return np.asarray(x)
