"""The one refinement: from a path through stages to the fastest certified polynomials near it.

Limits on a path are infinitely many constraints. They are held at places. Where paths exceed them between,
the next round has one more place (Blankenship and Falk, "Infinitely constrained optimization problems",
1976). It also keeps some room (Mitsos, "Global optimization of semi-infinite programs via restriction of the
right-hand side", 2011). Rough rounds, by a dense look, go on until the duration hardly falls. Fine rounds,
which are damped so that what is mended stays mended, go on until the path is certified.
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
from aerobat.optimization.deadline import out_of_time, within_share
from aerobat.optimization.interior_point import InteriorPointResult, Settings, interior_point
from aerobat.planning.certified_solve import Judged, Solution, certified_solve, judge
from aerobat.planning.courses import is_course
from aerobat.planning.gate_clearance import bodies_in_gates, is_clear
from aerobat.planning.passages import PlacedStage, place_stages
from aerobat.planning.recorder import Recorder
from aerobat.planning.refinement.excess import INWARD, JUST_INSIDE, Excess, chebyshev
from aerobat.planning.refinement.limit_values import LimitValues
from aerobat.planning.refinement.program import Multipliers, RefinementProgram
from aerobat.planning.refinement.spline import END_ORDER, Spline
from aerobat.planning.refinement.stage_values import StageValues
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.limits import UNITS
from aerobat.problem.stage import Stage, StageSequence
from aerobat.trajectory import Trajectory, polynomial

SEGMENTS = 8  # of a maneuver: within a percent of the fastest; twice as many take three times as long
LEG_SEGMENTS = 2  # of a course's leg
MAX_SEGMENTS = 80  # of all: solves take a second each
FIRST = Settings(least_barrier=1e-5, least_slack=0.1, gain=2e-4)  # from paths far beyond the limits
ROUGH = Settings(barrier=1e-6, least_slack=1e-3)
FINE = Settings(
    barrier=1e-6, least_slack=1e-3, damping=1e-2, iterations=30, tolerance=1e-5, violation=5e-5, gain=2e-4
)
# A barrier costs its parameter times the number of limits at places: of ten thousand of a course a hundredth
# of the duration; fine rounds that begin with a larger one than rough rounds end with leave limits again.
CLOSE_ROUGH = Settings(
    barrier=1e-6, least_barrier=1e-7, least_slack=1e-3, iterations=100, tolerance=1e-6, gain=1e-4
)
CLOSE_FINE = Settings(
    barrier=1e-8,
    least_barrier=1e-8,
    least_slack=1e-3,
    damping=1e-3,
    iterations=60,
    tolerance=1e-6,
    violation=5e-5,
    gain=1e-4,
)
ROUGH_ROUNDS = 8  # at most
FINE_ROUNDS = 16
MORE_ROUNDS = 1  # of such fine rounds, from a path that is certified on
SPREADS = 4  # of a rough path's knots anew, at most: 1.2 % shorter on average of 60 random problems
ROUGH_SHARE = 0.5  # of the time that is left, so that there is some to certify what is found
PLACES = 16  # of a segment at first: from 12, peaks between are found in vain
MORE_PLACES = 1.5  # times as many where thrusts jump, as those of rotors without lag
LOSS = 0.02  # of a rough path's duration, that makes one certified: more segments have less
LITTLE_GAIN = 0.005  # of the duration, from one rough round to the next: the end
SETTLED = 0.1  # of a limit's size: rough rounds go on where more is exceeded
BEHIND = 0.02  # of a known path's duration: one that is so much longer after a round is not gone on with
RADIUS = 2.0  # of the box in which scaled derivatives move at first,
SHRINK = 1.5  # the factor by which it is smaller from one rough round to the next,
LEAST_RADIUS = 1.0  # down to this
STRETCH = 1.6  # the factor by which durations may differ in one round
BACKOFF = 1e-4  # of every limit's size, at places
MAX_BACKOFF = 0.03  # that one round adds: where much is exceeded, it moves elsewhere
# More than so much of a limit's size is exceeded in peaks between places. There each segment gets one more
# place, and less room is kept beside it: 27 random problems' plans are 1.4 % shorter on average by that, in
# four fifths of the time.
PEAKED = 1e-3
PEAKS = 8  # places that a segment gets so; where more rounds are needed, they keep all the room
APART = 0.25  # of the gap that a place comes into, from either end
BESIDE_PEAKS = 0.1  # of the room that is kept otherwise
STILL = 0.02  # of a duration, and of what is exceeded: rounds that differ by less stand still
MORE_BACKOFF = 1.3  # times what is exceeded, in fine rounds
FINE_BACKOFF = 2e-4  # of a limit's size, and so much more, as for what a certificate refutes beside
# of a limit's size, beyond what is kept from it: there a certificate may refute what dense looks do not
NEARLY_EXCEEDED = 2e-3
MENDABLE = 0.5  # of a limit's size: a solve that leaves more has lost its way
RELATIVE_STAGE_TOLERANCE = 1e-5  # of a condition's size: by how much a stage may be missed through rounding
NEARLY_MISSED = 0.02  # likewise, where rounds that follow may mend it
NEWTON_STEPS = 3  # that meet what stages fix exactly
CONVERGED = "locally optimal"  # the status of such a solution


@dataclass(frozen=True, eq=False)
class RefinedPath:
    """A path with its stages, and by how much it exceeds limits."""

    path: WarmStart
    excess: Excess
    multipliers: Multipliers | None = None  # of the last program's inequalities
    certified: Judged[RefinedPath] | None = None  # the shortest that is, of the rough rounds that led to it

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
    in_gates: tuple[BodyInGate, ...] = ()  # that the stages cross
    still_ends: bool = False  # without jerk
    close: bool = False  # whether paths come within a thousandth of what they come near otherwise
    grows: bool = False  # whether paths get twice as many segments where they are much slower otherwise
    # whether paths of few segments that miss a stage get no more, which take several times as long, mostly in
    # vain: where other starts are at hand
    hasty: bool = False
    _known: dict[tuple[Stage, ...], StageValues] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, task: Task, recorder: Recorder, still_ends: bool = False) -> Refinement:
        """The refinement of a task's paths, with room for the body in all gates.

        Args:
            task: What is planned, with a vehicle.
            recorder: Keeps an attempt a round.
            still_ends: Whether ends are without jerk.
        """
        return cls(task, recorder, bodies_in_gates(task), still_ends)

    @property
    def settings(self) -> tuple[Settings, Settings]:
        """Of rough rounds that go on, and of fine ones."""
        return (CLOSE_ROUGH, CLOSE_FINE) if self.close else (ROUGH, FINE)

    @cached_property
    def limits(self) -> LimitValues:
        """Everything that holds all along, but for what others imply."""
        return LimitValues(self.task)

    @property
    def with_and_without_rooms(self) -> tuple[Refinement, ...]:
        """The refinement, then one without rooms, which some gates do not leave where they are crossed."""
        return (self, replace(self, in_gates=())) if self.in_gates else (self,)

    def stage_values(self, stages: tuple[Stage, ...]) -> StageValues:
        """Return the constraints of stages in the order of a path, compiled once."""
        if stages not in self._known:
            self._known[stages] = StageValues(stages, self.task, self.rooms(stages))
        return self._known[stages]

    def rooms(self, stages: tuple[Stage, ...]) -> tuple[BodyInGate, ...]:
        """The body's room in gates, with stages counted in the order of a path."""
        if self.task.stages.ordered:
            return self.in_gates
        gates = [stage.gate for stage in stages]
        return tuple(replace(body, stage=gates.index(body.gate.name)) for body in self.in_gates)

    def refined(self, guess: WarmStart, segments: int) -> Judged[RefinedPath]:
        """The fastest certified path near a guess, or the last one that was tried.

        Args:
            guess: A path through the stages, within limits or not.
            segments: Of the path that is sought, with a knot at every stage.
        """
        rough = self.rough(guess, segments)
        if self.is_promising(rough):
            return self.finished(rough)
        return Judged(self.task, self.solution(rough, "unknown"), None, False)

    def rough(self, guess: WarmStart, segments: int, known: float = np.inf) -> RefinedPath:
        """A path that is as fast as it gets, and may exceed limits a little between places.

        It is sought with few segments first, which go far in one step, then with twice as many, until there
        are as many as asked.

        Args:
            guess: A path through the stages, within limits or not.
            segments: Of the path that is sought, with a knot at every stage.
            known: The duration [s] of a path that is known: one that stays far behind it is left early.
        """
        number = min(segments, max(SEGMENTS, len(guess.phases)))
        with within_share(ROUGH_SHARE):
            return self.finer(self._rough(knots_at_stages(guess, number), known), segments, known)

    def finer(self, found: RefinedPath, segments: int, known: float = np.inf) -> RefinedPath:
        """A rough path with more segments, twice as many at a time, its knots where it wants them.

        Args:
            found: A rough path.
            segments: Of the path that is sought, at least its own.
            known: The duration [s] of a path that is known: one that stays far behind it is left early.
        """
        number = found.path.trajectory.segments
        while number < segments and not out_of_time() and not self._gives_up(found):
            number = min(2 * number, segments)
            found = self._rough(knots_at_stages(found.path, number), known, found.certified)
        return self._spread_anew(found, known)

    def _spread_anew(self, found: RefinedPath, known: float) -> RefinedPath:
        """A rough path whose knots are spread evenly between stages again, as long as it gains by that."""
        for _ in range(SPREADS):
            duration = found.path.trajectory.duration
            if out_of_time() or not self.is_promising(found) or duration > (1.0 + BEHIND) * known:
                break
            spread = knots_at_stages(found.path, found.path.trajectory.segments)
            again = self._rough(spread, duration, found.certified, found.multipliers)
            if not self.is_promising(again) or again.path.trajectory.duration >= duration:
                break
            found = again
            if again.path.trajectory.duration > (1.0 - LITTLE_GAIN) * duration:
                break
        return found

    def _rough(
        self,
        guess: WarmStart,
        known: float,
        certified: Judged[RefinedPath] | None = None,
        multipliers: Multipliers | None = None,
    ) -> RefinedPath:
        """The fastest path near one with knots at the stages, or one far behind a known duration [s].

        With it comes the shortest that is certified, of the rounds made here and before.
        """
        rounds = Rounds(self, guess, multipliers=multipliers)
        before = np.inf
        for number in range(ROUGH_ROUNDS):
            solution = rounds.solve()
            certified = _shortest(certified, judge(solution, self.task, self.recorder))
            duration = solution.duration
            is_settled = number and solution.source.excess.largest < SETTLED
            gains_little = is_settled and duration > (1.0 - LITTLE_GAIN) * before
            is_over = gains_little or duration > (1.0 + BEHIND) * known or rounds.is_stuck(solution)
            if is_over or out_of_time() or not self.is_promising(solution.source):
                break
            before = duration
            rounds.go_on(solution.source)
        return replace(solution.source, certified=certified)

    def finished(self, rough: RefinedPath) -> Judged[RefinedPath]:
        """The shortest certified path near one that is as fast as it gets, or the last one that was tried.

        Where the duration still falls, it goes on from the path that is certified.
        """
        judged = self._finished(rough)
        judged = _shortest(judged, rough.certified) or judged
        for _ in range(MORE_ROUNDS):
            solution = judged.solution
            if not judged.feasible or solution.status == CONVERGED or out_of_time():
                break
            again = self._finished(solution.source)
            if not again.feasible or again.solution.duration >= solution.duration:
                break
            judged = again
        return self._with_more_segments(rough, judged) if self.grows else judged

    def _with_more_segments(self, rough: RefinedPath, found: Judged[RefinedPath]) -> Judged[RefinedPath]:
        """The certified path that was found near a rough one, or a shorter one with twice as many segments.

        They are given where it is much longer than the rough one. A course has many as it is. A path whose
        body touches gates' frames is left as it is: it is refined again, with more room there.
        """
        path, duration = rough.path.trajectory, found.solution.duration
        loses_little = not found.feasible or duration <= (1.0 + LOSS) * path.duration
        if loses_little or is_course(self.task.stages) or not is_clear(found.frames) or out_of_time():
            return found
        finer = self.finer(rough, min(2 * path.segments, MAX_SEGMENTS), duration)
        if not self.is_promising(finer) or finer.path.trajectory.duration >= duration:
            return found
        judged = replace(self, grows=False).finished(finer)
        is_better = judged.feasible and judged.solution.duration < duration and is_clear(judged.frames)
        return judged if is_better else found

    def _finished(self, rough: RefinedPath) -> Judged[RefinedPath]:
        """The certified path near one, or the last one that was tried."""
        _, fine = self.settings
        rounds = Rounds(self, rough.path, fine, radius=LEAST_RADIUS, multipliers=rough.multipliers)
        rounds.back_off(rough.excess)
        return certified_solve(rounds, self.task, self.recorder, FINE_ROUNDS)

    def is_promising(self, path: RefinedPath) -> bool:
        """True of a path that meets its stages and exceeds limits by so little that rounds may mend it."""
        return path.excess.largest <= MENDABLE and self._nearly_meets_stages(path)

    def _gives_up(self, path: RefinedPath) -> bool:
        """True of a path that gets no more segments, although it has fewer than were asked."""
        return self.hasty and not self._nearly_meets_stages(path)

    def _nearly_meets_stages(self, path: RefinedPath) -> bool:
        """True of a path whose stages rounds may still meet."""
        return self._missed_stage(path.path, NEARLY_MISSED) is None

    def path(self, guess: WarmStart) -> RefinedPath:
        """A path, looked at densely."""
        return RefinedPath(guess, Excess.of(guess.trajectory, self.limits))

    def solution(
        self, path: RefinedPath, status: str, iterations: int = 0, time: float = 0.0
    ) -> Solution[RefinedPath]:
        """A path as a solution; a failure where it misses a stage, or exceeds limits.

        Args:
            path: What was found.
            status: Of the solver.
            iterations: Of the solver.
            time: That it took [s].
        """
        trajectory, excess = path.path.trajectory, path.excess
        failure = self._missed_stage(path.path)
        if failure is None and not excess.holds:
            failure = Reason(f"{excess.reason}{path.path.leg_at(excess.place[1])}", excess.reason.limits)
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
        """The first stage that a path misses, in a sentence; or None.

        Args:
            path: With its stages' times.
            tolerance: By which a condition may be missed, as a fraction of its size.
        """
        for stage, time in zip(path.stages, path.times, strict=True):
            where = (f"stage '{stage.name}'",)
            flat = np.array([path.trajectory.evaluate(time, k) for k in range(3)])
            for condition in stage.conditions:
                excess = float(condition.bound(self.task.balance).excess(flat))
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
    """The program near a path, again and again, with limits backed off from."""

    def __init__(
        self,
        refinement: Refinement,
        guess: WarmStart,
        settings: Settings = FIRST,
        places: int = PLACES,
        radius: float = RADIUS,
        multipliers: Multipliers | None = None,
        stretch: float = STRETCH,
    ) -> None:
        limits = refinement.limits
        self._refinement, self._guess, self._settings = refinement, guess, settings
        jumps = not refinement.task.vehicle.lags.any()
        fractions = chebyshev(round(places * (MORE_PLACES if jumps else 1.0)))
        begun = np.tile(fractions, (guess.trajectory.segments, 1))
        self._fractions = begun if multipliers is None else multipliers.fractions
        self._most_places, self._exceeded = self._fractions.shape[1] + PEAKS, np.inf
        self._radius, self._stretch = radius, stretch
        trajectory = guess.trajectory
        self._segments = tuple(_segment_that_ends(trajectory, time) for time in guess.times)
        kept = limits.reserve + BACKOFF
        self._backoff = np.tile(kept, (trajectory.segments, 1))
        self._multipliers = multipliers

    def solve(self) -> Solution[RefinedPath]:
        """The fastest path near the last one."""
        began, refinement = perf_counter(), self._refinement
        program = self._program
        known = None if self._multipliers is None else program.at_its_places(self._multipliers)
        answer = interior_point(program, program.spline.start, self._settings, known)
        self._multipliers = Multipliers(answer.z, program.fractions)
        x = _meeting_stages(program, answer)
        trajectory = program.spline.trajectory(x)
        times = tuple(float(trajectory.knots[segment + 1]) for segment in self._segments)
        found = refinement.path(replace(self._guess, trajectory=trajectory, times=times))
        path = replace(found, multipliers=self._multipliers)
        stands_still = abs(trajectory.duration / self._guess.trajectory.duration - 1.0) < LITTLE_GAIN
        status = CONVERGED if answer.converged or stands_still else "unknown"
        return refinement.solution(path, status, answer.iterations, perf_counter() - began)

    def tighten(self, solution: Solution[RefinedPath], certificate: Certificate | None) -> bool:
        """Go on from a path with more room where it exceeds limits, or where its certificate refutes it."""
        excess = solution.source.excess
        if out_of_time() or self.is_stuck(solution) or not self._refinement.is_promising(solution.source):
            return False
        self.back_off(excess, MORE_BACKOFF, FINE_BACKOFF)
        if certificate is not None:
            refuted, times = _refuted(certificate, self._refinement.task.reserve)
            self._hold_at(_with_times(excess.peaks, solution.source.path.trajectory, times))
            kept = self._backoff - self._refinement.limits.reserve
            is_near = excess.nearby + kept > -NEARLY_EXCEEDED
            self._backoff += (MORE_BACKOFF * refuted + FINE_BACKOFF) * is_near
        self._guess = solution.source.path
        return True

    def is_stuck(self, solution: Solution[RefinedPath]) -> bool:
        """True if a solution exceeds limits by much, as the last path does, and takes as long."""
        excess = solution.source.excess.largest
        pairs = (solution.duration, self._guess.trajectory.duration), (excess, self._exceeded)
        return excess > SETTLED and all(abs(new - old) < STILL * old for new, old in pairs)

    def go_on(self, path: RefinedPath) -> None:
        """Go on from a path in a smaller region, with more room where it exceeds limits."""
        self._guess, (self._settings, _) = path.path, self._refinement.settings
        self._radius = max(self._radius / SHRINK, LEAST_RADIUS)
        self.back_off(path.excess)

    def back_off(self, excess: Excess, factor: float = 1.0, more: float = 0.0) -> None:
        """Hold limits where each segment exceeds them most, and keep more room where they are exceeded.

        Args:
            excess: Of the last path.
            factor: Times what is exceeded.
            more: And so much more, of a limit's size.
        """
        exceeded = np.clip(excess.nearby, 0.0, MAX_BACKOFF)
        if excess.largest > PEAKED and self._hold_at(excess.peaks):
            factor *= BESIDE_PEAKS
        self._exceeded = excess.largest
        self._backoff += factor * exceeded + more * (exceeded > 0.0)

    def _hold_at(self, peaks: Array) -> bool:
        """Hold limits at one more place of each segment (S,); False where there would be too many."""
        if self._fractions.shape[1] >= self._most_places:
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
    """The shortest of the certified paths among those found; None where there is none."""
    certified = (each for each in found if each is not None and each.feasible)
    return min(certified, key=lambda each: each.solution.duration, default=None)


def _refuted(certificate: Certificate, reserve: float) -> tuple[float, list[float]]:
    """The largest excess that a certificate refutes, or misses of the reserve; when limits are violated."""
    refuted = [f for f in certificate.findings if f.verdict is Verdict.VIOLATED and f.limit is not None]
    beyond = [-(f.margin or 0.0) / (f.size or max(abs(f.limit or 0.0), 1.0)) for f in refuted]
    missed = [shortfall.size for shortfall in reserve_shortfalls(certificate, reserve)]
    return min(max([*beyond, *missed], default=0.0), MAX_BACKOFF), [f.time for f in refuted]


def _between(places: Array, peak: float) -> float:
    """The place nearest to a peak that keeps apart from rising places."""
    after = int(np.searchsorted(places[1:-1], peak, side="right")) + 1
    before, gap = places[after - 1], places[after] - places[after - 1]
    return float(np.clip(peak, before + APART * gap, before + (1.0 - APART) * gap))


def _with_times(peaks: Array, trajectory: Trajectory, times: Sequence[float]) -> Array:
    """Fractions of segments (S,), some of them at these times [s] instead."""
    found = peaks.copy()
    for time in times:
        segment = int(np.searchsorted(trajectory.knots[1:-1], time))
        fraction = (time - trajectory.knots[segment]) / trajectory.durations[segment]
        found[segment] = np.clip(fraction, INWARD, 1.0 - INWARD)
    return found


def knots_at_stages(path: WarmStart, segments: int) -> WarmStart:
    """Polynomials of degree 9 through a path up to snap, about so many, with a knot at every stage.

    Args:
        path: Of any degree.
        segments: Their number, where that is no less than the phases between stages.
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


def segments_for(sequence: StageSequence, asked: int = SEGMENTS) -> int:
    """Return how many segments a path through stages has: of a course so many a leg, else as asked."""
    legs = len(sequence.stages) + 1
    wanted = max(asked, LEG_SEGMENTS * legs) if is_course(sequence) else asked
    return min(max(wanted, legs), MAX_SEGMENTS)


def _meeting_stages(program: RefinementProgram, answer: InteriorPointResult) -> Array:
    """The point next to an answer that meets what stages fix exactly."""
    x = answer.x
    for _ in range(NEWTON_STEPS):
        point = program.at(x)
        with np.errstate(over="ignore", invalid="ignore"):
            rows, values = point.equality_rows, point.equalities
        if not (np.isfinite(rows).all() and np.isfinite(values).all()):  # too far away for numbers
            break
        x = x - np.linalg.lstsq(rows, values, rcond=None)[0]
    return np.asarray(x)


def _segment_that_ends(trajectory: Trajectory, time: float) -> int:
    """The segment at whose end a stage holds."""
    return int(np.argmin(np.abs(trajectory.knots[1:] - time)))
