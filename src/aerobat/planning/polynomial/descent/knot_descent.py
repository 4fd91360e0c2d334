"""The descent of free knots from a plan: solve near it, look between samples, go on from what is certified.

Limits on a path are infinitely many constraints. They are held at samples; where the certificate or a denser
look finds one exceeded between them, that instant joins the samples, and all are held with a little more
backoff: the exchange method (Blankenship and Falk 1976) with restriction of the right-hand side, which makes
it end at a feasible point (Mitsos 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate, Verdict
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, certified_solve
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.gate_clearance import cleared, more_direct
from aerobat.planning.passages import PlacedStage
from aerobat.planning.polynomial.descent.framed_problem import TRUSTED, FramedProblem, Path
from aerobat.planning.polynomial.descent.knot_program import (
    FINE,
    ROUGH,
    KnotProgram,
)
from aerobat.planning.polynomial.descent.knot_samples import (
    GATE_SAMPLES,
    MIN_SAMPLES,
    chebyshev_samples,
    refit,
)
from aerobat.planning.polynomial.descent.knot_variables import KnotVariables
from aerobat.planning.polynomial.descent.stage_constraints import StageConstraints
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.warm_start import WarmStart

NEAR_ITERATIONS = 50  # of a solve, at most, once a path is certified: what takes longer leads away from it
ROUNDS = 12  # of solving, at most, from one start
LITTLE_GAIN = 0.005  # of the duration, from one certified path to the next: the end
LARGE_GAIN = 0.2  # of the duration: the start was far, trust regions confine what follows it
MIN_RADIUS = 0.2  # a smaller region may hold no path that mends what is exceeded
SHRINK = 3.0  # by how much the trust region is smaller where a limit is exceeded between samples
SOLVED = 1e-3  # the same at samples: more means that the region is too large
MAX_BACKOFF = 0.02  # that is added at once: where much is exceeded, samples mend most of it
CONVERGED = "locally optimal"  # the status of such a solution


@dataclass(frozen=True)
class Strategy:
    """How solves follow each other."""

    tolerance: float  # of IPOPT; of the first solve from a start ROUGH, as what it finds is mended anyhow
    radius: float  # of the trust region at first, in scaled variables, see KnotVariables
    backoff: float  # of every limit's range, kept at samples at first
    samples: int  # of a segment at first, at least
    until_free: bool  # what stands at no edge of its trust region counts as near, however far it began
    little_loss: float  # of the duration, that certainty between samples costs: the end if the start was near
    must_fall: bool  # from one path gone on from to the next: the duration where samples alone count
    paced: bool = True  # a start that exceeds limits by far is slowed


OF_MANEUVERS = Strategy(ROUGH, 2.0, 1e-4, MIN_SAMPLES, False, little_loss=0.01, must_fall=True)
OF_COURSES = Strategy(FINE, 3.0, 5e-4, GATE_SAMPLES, True, little_loss=0.02, must_fall=False)
# of polynomials next to the rigid body's own motion, shorter where it turns sharply
NEAR_MOTIONS = replace(OF_COURSES, radius=1.0, samples=MIN_SAMPLES, paced=False)


@dataclass
class Descent:
    """One descent, and the best that is certified."""

    framed: FramedProblem
    recorder: Recorder
    still_ends: bool
    iterations: int  # of each solve, at most
    strategy: Strategy = OF_MANEUVERS
    best: Judged[Path] | None = None
    converged: bool = False  # whether a solve has, whose path is certified or no faster than the best

    def consider(self, start: Plan, guess: WarmStart) -> None:
        """Keep the path of another planner's plan, as it is, where it is certified."""
        self._certified(_Start(self.framed, start, guess), 1)

    def run(self, guess: WarmStart, segments: int) -> None:
        """Free the knots of a path, or of the best that is certified, with so many segments."""
        guess = guess if self.best is None else self.best.solution.source.guess
        guess = replace(guess, trajectory=refit(guess.trajectory, segments))
        if self.strategy.paced:
            guess = self.framed.paced(guess)
        program, end = _Exchange(self, guess), len(self.recorder.attempts) + ROUNDS
        before = inf
        while (left := end - len(self.recorder.attempts)) > 0 and not out_of_time():
            if (found := self._certified(program, left)) is None or program.little_to_gain(found, before):
                return
            before = found.solution.duration
            program.go_on_from(found.solution.source.guess)

    def through_gates(self, segments: int) -> tuple[Plan | None, bool]:
        """The plan, or a more direct one through the gates whose frames its own flight does not clear.

        Only of a flight that keeps to its path: where it leaves it, the path is not what misses them. With
        it, whether its own flight passes all gates.
        """
        if self.best is None or not self.framed.problem.gates:
            return self.plan(segments), True
        flight, descent = cleared(self, Descent._own_flight, Descent._more_direct)
        return descent.plan(segments), not flight.lingers

    def _own_flight(self) -> OwnFlight:
        """The flight of the best path."""
        path, framed = self._best_path, self.framed
        return own_flight(path.trajectory, framed.vehicle, framed.problem, _placed(path))

    def _more_direct(self, flight: OwnFlight) -> Descent | None:
        """The descent from its best path, more direct through the gates that its own flight did not pass."""
        framed, guess = self.framed, self._best_path
        in_gates = more_direct(framed.in_gates, guess.stages, framed.problem, framed.vehicle, flight)
        if in_gates == framed.in_gates:
            return None
        again = replace(self, framed=replace(framed, in_gates=in_gates), best=None)
        again.run(guess, guess.trajectory.segments)
        return None if again.best is None else again

    @property
    def _best_path(self) -> WarmStart:
        assert self.best is not None, "a path that is certified"
        return self.best.solution.source.guess

    def plan(self, segments: int) -> Plan | None:
        """The plan of what is certified, its start's path where that is the best; None if nothing is.

        It says so where the best has not so many `segments`.
        """
        if self.best is None:
            return None
        path, start = self.best.solution.source.guess, self.best.solution.source.start
        return self.best.plan(
            self.recorder,
            planner="free-knots",
            order=5 if start is None else start.order,
            status=CONVERGED if start is None else "feasible",
            backend="ipopt" if start is None else start.backend,
            stages=_placed(path),
            rescue=_instead(start, path.trajectory.segments, segments),
        )

    def _certified(self, program: _Start | _Exchange, rounds: int) -> Judged[Path] | None:
        """Outcome of a program, if it is certified; the best is kept."""
        framed = self.framed
        found = certified_solve(
            program, framed.problem, framed.vehicle, self.recorder, rounds, reserve=framed.reserve
        )
        if not found.feasible:
            return None
        self.converged = self.converged or found.solution.status == CONVERGED
        if self.best is None or found.solution.duration < self.best.solution.duration:
            self.best = found
        return found


def _placed(path: WarmStart) -> tuple[PlacedStage, ...]:
    """The stages of a path, each in its segment."""
    numbers = np.searchsorted(path.trajectory.knots[1:-1], path.times, side="right").tolist()
    stages = zip(path.stages, numbers, path.times, strict=True)
    return tuple(PlacedStage(s.name, segment, time, s.gate) for s, segment, time in stages)


def _instead(start: Plan | None, found: int, asked: int) -> str:
    """A sentence about what is returned instead of a path of so many segments, if anything is."""
    if start is not None:
        return f"free-knots found none faster than the path that it began from, {start.planner}'s"
    if found != asked:
        return f"free-knots found none faster with {asked} segments; planned with {found}"
    return ""


@dataclass
class _Start:
    """The path of another planner's plan, as it is."""

    framed: FramedProblem
    start: Plan
    guess: WarmStart

    def solve(self) -> Solution[Path]:
        """The path."""
        return self.framed.solution(self.framed.path(self.guess, self.start), "feasible")

    def tighten(self, solution: Solution[Path], certificate: Certificate | None) -> bool:
        """Nothing can be tightened."""
        return False


class _Exchange:
    """The program near a guess, with limits at samples, which counterexamples join as they are found."""

    def __init__(self, descent: Descent, guess: WarmStart) -> None:
        strategy, segments = descent.strategy, guess.trajectory.segments
        self.guess = guess
        self._descent = descent
        self._begun = guess.trajectory.duration
        self._samples = chebyshev_samples(segments, strategy.samples)
        self._radius = strategy.radius
        self._tolerance = ROUGH
        self._backoff = np.tile(self._least_backoff, (segments, 1))
        self._relaxed: float | None = None  # [s] the duration of the first solution near the guess
        self._relaxed_before: float | None = None  # [s] the same near the guess before
        self._confined = False  # whether the last solution stands at an edge of its trust region

    def solve(self) -> Solution[Path]:
        """The fastest path within the trust region around the guess."""
        descent, framed = self._descent, self._descent.framed
        segments = np.searchsorted(self.guess.trajectory.knots[1:-1], self.guess.times, side="right")
        variables = KnotVariables(
            problem=framed.problem,
            vehicle=framed.vehicle,
            guess=self.guess,
            segments=tuple(segments.tolist()),
            frame=framed.frame,
            radius=self._radius,
            still_ends=descent.still_ends,
        )
        stages = StageConstraints(variables, framed.limits, framed.balance, framed.in_gates)
        program = KnotProgram(variables, framed.limits, self._samples, stages, self._backoff)
        iterations = descent.iterations
        if descent.best is not None:
            iterations = min(iterations, NEAR_ITERATIONS)
        found, answer = program.solve(iterations, self._tolerance)
        self._tolerance = descent.strategy.tolerance
        self._confined = variables.is_at_edge(answer.x)
        status = CONVERGED if answer.converged else "unknown"
        path = replace(framed.path(found), unsolved=answer.violation)
        if self._relaxed is None and answer.converged:
            self._relaxed = found.trajectory.duration
        return framed.solution(path, status, answer.iterations, answer.time)

    def little_to_gain(self, found: Judged[Path], before: float) -> bool:
        """True if what is certified is hardly faster than before, or as fast as where samples alone count."""
        duration, relaxed = found.solution.duration, self._relaxed or 0.0
        near = duration >= (1.0 - LARGE_GAIN) * self._begun
        near = near or (self._descent.strategy.until_free and not self._confined)
        settled = near and duration <= (1.0 + self._descent.strategy.little_loss) * relaxed
        return settled or duration >= (1.0 - LITTLE_GAIN) * before

    def go_on_from(self, certified: WarmStart) -> None:
        """Begin again from a certified path, with the least backoff, in a smaller region than at first."""
        self.guess = certified
        self._relaxed_before, self._relaxed = self._relaxed, None
        self._radius = self._descent.strategy.radius / SHRINK
        self._backoff[:] = self._least_backoff

    @property
    def _least_backoff(self) -> Array:
        """Of every limit's range, the reserve included, (size,)."""
        framed = self._descent.framed
        return self._descent.strategy.backoff + framed.limits.of_vehicle(framed.reserve)

    @property
    def _is_no_faster(self) -> bool:
        """True where limits at samples alone leave no less time than before the path gone on from."""
        return self._relaxed is not None and self._relaxed >= (self._relaxed_before or inf)

    def tighten(self, solution: Solution[Path], certificate: Certificate | None) -> bool:
        """Sample where limits are exceeded, and go on from there in a smaller region.

        A path slower than the best that is certified is given up: tightening only slows it further. So is one
        near a certified path that was no faster before any tightening.
        """
        descent, path = self._descent, solution.source
        best, framed = descent.best, descent.framed
        if out_of_time():
            return False
        solved = path.unsolved <= SOLVED
        converged = solution.status == CONVERGED
        if (solved or converged) and best is not None and solution.duration >= best.solution.duration:
            descent.converged = descent.converged or converged
            return False
        if descent.strategy.must_fall and self._is_no_faster:
            return False
        violation = path.violation
        for finding in () if certificate is None else certificate.findings:
            if finding.verdict is not Verdict.HOLDS:
                violation = violation.add_counterexample(path.guess.trajectory, finding.time)
        for shortfall in () if certificate is None else reserve_shortfalls(certificate, framed.reserve):
            violation = violation.add_counterexample(path.guess.trajectory, shortfall.finding.time)
        self._samples = violation.joined(self._samples)
        if not solved and self._radius <= MIN_RADIUS:
            return False
        if not (solved and converged) or violation.worst > 0.0:
            self._radius = max(self._radius / SHRINK, MIN_RADIUS)
        if solved and violation.worst <= TRUSTED:
            self.guess = path.guess
            excess = np.clip(violation.excess_nearby, descent.strategy.backoff, 2.0 * MAX_BACKOFF)
            self._backoff += excess / 2.0
        return True
