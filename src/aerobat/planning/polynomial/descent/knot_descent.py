"""The descent of free knots from a plan: solve near it, look between samples, go on from what is certified.

Limits on a path are infinitely many constraints. They are held at samples; where the certificate or a denser
look finds one exceeded between them, that instant joins the samples, and all are held with a little more
backoff: the exchange method (Blankenship and Falk 1976) with restriction of the right-hand side, which makes
it end at a feasible point (Mitsos 2011).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.certification import Certificate, Verdict
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, certified_solve
from aerobat.planning.polynomial.descent.framed_problem import TRUSTED, FramedProblem, Path
from aerobat.planning.polynomial.descent.knot_program import ROUGH, KnotProgram, Multipliers, Precision
from aerobat.planning.polynomial.descent.knot_samples import chebyshev_samples, refit
from aerobat.planning.polynomial.descent.knot_variables import KnotVariables
from aerobat.planning.polynomial.descent.stage_constraints import StageConstraints
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import PlacedStage, Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.warm_start import WarmStart

NEAR_ITERATIONS = 50  # of a solve, at most, once a path is certified: what takes longer leads away from it
ROUNDS = 12  # of solving, at most, from one start
LITTLE_GAIN = 0.005  # of the duration, from one certified path to the next: the end
LITTLE_LOSS = 0.02  # of the duration, that certainty between samples costs: the end if the start was near
LARGE_GAIN = 0.2  # of the duration: the start was far, trust regions confine what follows it
TRUST_RADIUS = 2.0  # in scaled variables, see KnotVariables
MIN_RADIUS = 0.2  # a smaller region may hold no path that mends what is exceeded
SHRINK = 3.0  # by how much the trust region is smaller where a limit is exceeded between samples
NEAR = 0.02  # the same, where the next solution lies near: with multipliers as first guesses it is soon found
SOLVED = 1e-3  # the same at samples: more means that the region is too large
FIRST_BACKOFF = 1e-4  # of every limit's range, kept at samples
MAX_BACKOFF = 0.02  # that is added at once: where much is exceeded, samples mend most of it
CONVERGED = "locally optimal"  # the status of such a solution


@dataclass
class Descent:
    """One descent, and the best that is certified."""

    framed: FramedProblem
    recorder: Recorder
    still_ends: bool
    iterations: int  # of each solve, at most
    precision: Precision = ROUGH
    best: Judged[Path] | None = None

    def consider(self, start: Plan, guess: WarmStart) -> None:
        """Keep the path of another planner's plan, as it is, where it is certified."""
        self._certified(_Start(self.framed, start, guess), 1)

    def run(self, guess: WarmStart, segments: int) -> None:
        """Free the knots of a path, or of the best that is certified, with so many segments."""
        guess = guess if self.best is None else self.best.solution.source.guess
        guess = self.framed.paced(replace(guess, trajectory=refit(guess.trajectory, segments)))
        program, end = _Exchange(self, guess), len(self.recorder.attempts) + ROUNDS
        while (left := end - len(self.recorder.attempts)) > 0 and not out_of_time():
            before = program.guess.trajectory.duration
            if (found := self._certified(program, left)) is None or program.little_to_gain(found, before):
                return
            program.go_on_from(found.solution.source.guess)

    def plan(self, segments: int) -> Plan | None:
        """The plan of what is certified, its start's path where that is the best; None if nothing is.

        It says so where the best has not so many `segments`.
        """
        if self.best is None:
            return None
        path, start = self.best.solution.source.guess, self.best.solution.source.start
        numbers = np.searchsorted(path.trajectory.knots[1:-1], path.times, side="right").tolist()
        stages = zip(path.stages, numbers, path.times, strict=True)
        return self.best.plan(
            self.recorder,
            planner="free-knots",
            order=5 if start is None else start.order,
            status=CONVERGED if start is None else "feasible",
            backend="ipopt" if start is None else start.backend,
            stages=tuple(PlacedStage(s.name, segment, time, s.gate) for s, segment, time in stages),
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
        if self.best is None or found.solution.duration < self.best.solution.duration:
            self.best = found
        return found


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
        self.guess = guess
        self._descent = descent
        self._begun = guess.trajectory.duration
        self._samples = chebyshev_samples(guess.trajectory.segments)
        self._radius = TRUST_RADIUS
        self._backoff = np.full(guess.trajectory.segments, FIRST_BACKOFF + descent.framed.reserve)
        self._multipliers: Multipliers | None = None
        self._relaxed: float | None = None  # [s] the duration of the first solution near the guess

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
        stages = StageConstraints(variables, framed.limits, framed.balance, framed.ways)
        program = KnotProgram(variables, framed.limits, self._samples, stages, self._backoff)
        iterations = descent.iterations
        if descent.best is not None:
            iterations = min(iterations, NEAR_ITERATIONS)
        found, answer, multipliers = program.solve(iterations, descent.precision, self._multipliers)
        status = CONVERGED if answer.converged else "unknown"
        path = replace(framed.path(found), unsolved=answer.violation)
        near = answer.converged and path.violation.worst <= NEAR
        self._multipliers = multipliers if near else None
        if self._relaxed is None and answer.converged:
            self._relaxed = found.trajectory.duration
        return framed.solution(path, status, answer.iterations, answer.time)

    def little_to_gain(self, found: Judged[Path], before: float) -> bool:
        """True if what is certified is hardly faster than before, or as fast as where samples alone count."""
        duration, relaxed = found.solution.duration, self._relaxed or 0.0
        near = duration >= (1.0 - LARGE_GAIN) * self._begun
        settled = near and duration <= (1.0 + LITTLE_LOSS) * relaxed
        return settled or duration >= (1.0 - LITTLE_GAIN) * before

    def go_on_from(self, certified: WarmStart) -> None:
        """Begin again from a certified path, in the whole trust region and with the least backoff."""
        self.guess = certified
        self._relaxed = None
        self._radius = TRUST_RADIUS
        self._backoff[:] = FIRST_BACKOFF + self._descent.framed.reserve

    def tighten(self, solution: Solution[Path], certificate: Certificate | None) -> bool:
        """Sample where limits are exceeded, and go on from there in a smaller region.

        A path slower than the best that is certified is given up: tightening only slows it further.
        """
        best, framed, path = self._descent.best, self._descent.framed, solution.source
        if out_of_time():
            return False
        solved = path.unsolved <= SOLVED
        converged = solution.status == CONVERGED
        if (solved or converged) and best is not None and solution.duration >= best.solution.duration:
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
            excess = np.clip(violation.excess_nearby, FIRST_BACKOFF, 2.0 * MAX_BACKOFF)
            self._backoff += excess / 2.0
        return True
