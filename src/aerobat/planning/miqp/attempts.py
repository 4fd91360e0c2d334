"""One program at one dt, and its refinement within what the vehicle can do: attempts that are certified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from aerobat.certification import Certificate, Verdict
from aerobat.optimization import AssignmentResult, Solver, improved_in_windows
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, certified_solve
from aerobat.planning.courses import is_placed_in_windows
from aerobat.planning.miqp.diagnosis import NOT_CONVERGED, OUT_OF_TIME
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.integrator import INPUT_NAMES
from aerobat.planning.miqp.refinement import PathPoint, PathProgram, settled
from aerobat.planning.passages import PlacedStage
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

PROOF_ROUNDS = 4  # of certificates, at most, each after backing off from what the last one refutes
PROOF_BACKOFF = 5e-4  # of the ranges of constraints that are near, in each of them, at least
COURSE_SCAN_NODES = 50  # of one along a scan, for which no bound is said
COURSE_NODES = 5000  # of a search of a whole course: for its bound, windows place its stages better
SMALL_INPUT = 1e-6  # normalised: an input of this size moves nothing
MOMENT_ORDER = 4  # the lowest order whose body rates do not jump; one more for thrusts that do not


@dataclass(frozen=True, eq=False)
class Placement:
    """The answer of the program at one dt, and the path that it was refined to."""

    answer: AssignmentResult
    dt: float  # [s]
    path: PathPoint | None = None


@dataclass
class Attempts:
    """All that attempts at one problem share."""

    formulation: Formulation
    vehicle: Vehicle | None
    solver: Solver
    recorder: Recorder
    reserve: float = 0.0  # of what the vehicle can do, kept for the controller
    slots: tuple[int, ...] | None = None  # of the last solution: where the next solve begins

    def solve(self, dt: float, node_limit: int | None = None) -> AssignmentResult:
        """The paper's program at one dt; solved exactly where neither time nor nodes are limited.

        Courses of more gates than are searched at once have their stages placed in windows that move along.
        """
        program = self.formulation.program(dt)
        if not is_placed_in_windows(self.formulation.sequence):
            answer = self.solver.solve(program, node_limit=node_limit, start=self.slots)
        else:
            limit = COURSE_NODES if node_limit is None else min(node_limit, COURSE_SCAN_NODES)
            answer = self.solver.solve(program, node_limit=limit, start=self.slots)
            answer = improved_in_windows(program, answer, self.slots)
        self.slots = answer.slots or self.slots
        return answer

    def placement(self, dt: float, node_limit: int | None = None) -> Placement:
        """The program's answer at one dt, with the path that begins there, if it has one."""
        placement = Placement(self.solve(dt, node_limit), dt)
        return placement if placement.answer.x is None else replace(placement, path=self.start(placement))

    @property
    def is_over(self) -> bool:
        """True where no time is left for another; the first is made in any case."""
        return bool(self.recorder.attempts) and out_of_time()

    @property
    def jumps(self) -> bool:
        """True if the order makes what no moment, or no rotor with lag, can do; its certificate says so."""
        return self.formulation.chain.order < flyable_order(self.vehicle)

    def judge(
        self, placement: Placement, failure: str | None = None, excess: float = 0.0
    ) -> Judged[Placement]:
        """Certify a program's answer.

        Args:
            placement: The answer.
            failure: Why the vehicle cannot follow it, where that is known without a certificate.
            excess: By how much, as a fraction of a constraint's range, negative.
        """
        span = 0.0 if self.vehicle is None else float(self.vehicle.thrust_ranges.max())
        return self._certified(_Answered(self, placement, failure, excess * span or None), 1)

    def refined(self, start: Placement, find: Callable[[], PathPoint | None]) -> Judged[Placement]:
        """Certify the path that is found, backing off from what a certificate refutes."""
        return self._certified(_Refined(self, start, find), PROOF_ROUNDS)

    def start(self, placement: Placement, held: bool = False) -> PathPoint:
        """An answer as a path that can be refined: in phases, or on equal intervals that are held."""
        answer, chain = placement.answer, self.formulation.chain
        assert self.vehicle is not None
        assert answer.x is not None
        assert answer.slots is not None
        size = max(float(np.linalg.norm(answer.x)) / np.sqrt(chain.intervals), SMALL_INPUT)
        program = PathProgram(self.formulation, self.vehicle, answer.slots, held, size, held)
        program = replace(program, reserve=program.reserve + self.reserve)
        return PathPoint(program, program.chain.variables(answer.x.reshape(3, -1).T, placement.dt))

    def trajectory(self, answer: AssignmentResult, dt: float) -> Trajectory:
        """An answer's path."""
        formulation = self.formulation
        assert answer.x is not None
        return Trajectory.from_inputs(
            formulation.initial, formulation.inputs(answer.x, dt), dt, formulation.problem.heading
        )

    def placed(self, judged: Judged[Placement]) -> tuple[PlacedStage, ...]:
        """When a path passes its stages."""
        trajectory, slots = judged.solution.trajectory, judged.solution.source.answer.slots or ()
        assert trajectory is not None
        stages = zip(self.formulation.sequence.stages, slots, strict=True)
        return tuple(
            PlacedStage(s.name, slot, float(trajectory.knots[slot + 1]), s.gate) for s, slot in stages
        )

    def _certified(self, program: _Answered | _Refined, rounds: int) -> Judged[Placement]:
        problem = self.formulation.problem
        return certified_solve(
            program, problem, self.vehicle, self.recorder, rounds, self.jumps, self.reserve
        )


@dataclass
class _Answered:
    """A program's own answer."""

    attempts: Attempts
    placement: Placement
    failure: str | None
    margin: float | None  # [N] of the rotors, where it is known to be negative

    def solve(self) -> Solution[Placement]:
        """The answer, whatever it is."""
        answer, dt = self.placement.answer, self.placement.dt
        solved = answer.x is not None
        return Solution(
            source=self.placement,
            duration=dt * self.attempts.formulation.chain.intervals,
            trajectory=self.attempts.trajectory(answer, dt) if solved else None,
            status=answer.status,
            nodes=answer.nodes,
            solve_time=answer.time,
            cost=self.attempts.formulation.cost(answer.cost, dt) if solved else None,
            dt=dt,
            failure=self.failure or (None if solved else self._why_unsolved()),
            margin=self.margin,
        )

    def tighten(self, solution: Solution[Placement], certificate: Certificate | None) -> bool:
        """Nothing to tighten."""
        return False

    def _why_unsolved(self) -> str:
        if self.placement.answer.status == "infeasible":
            return "the program has no solution"
        return OUT_OF_TIME if out_of_time() else NOT_CONVERGED


@dataclass
class _Refined:
    """A path found by refinement; what a certificate refutes is backed off from."""

    attempts: Attempts
    start: Placement
    find: Callable[[], PathPoint | None]

    def solve(self) -> Solution[Placement]:
        """The path; a failure where none is found."""
        began = perf_counter()
        path = self.find()
        placement, seconds = replace(self.start, path=path), perf_counter() - began
        if path is None:
            return Solution(
                source=placement,
                duration=self.start.dt * self.attempts.formulation.chain.intervals,
                trajectory=None,
                status="unknown",
                nodes=0,
                solve_time=seconds,
                dt=self.start.dt,
                failure="no path through its slots was found within what the vehicle can do",
            )
        trajectory, held = path.trajectory, path.program.held
        return Solution(
            source=placement,
            duration=trajectory.duration,
            trajectory=trajectory,
            status="feasible" if held else "locally optimal",
            nodes=0,
            solve_time=seconds,
            cost=self._effort(path) if held else trajectory.duration,
            dt=self.start.dt if held else None,
        )

    def _effort(self, path: PathPoint) -> float:
        """The sum of |u|² over intervals, in SI units."""
        inputs, _, mean = path.program.chain.unpack(path.x)
        return self.attempts.formulation.cost(float(np.sum(inputs**2)), mean)

    def tighten(self, solution: Solution[Placement], certificate: Certificate | None) -> bool:
        """Back off everywhere, and settle again."""
        path = solution.source.path
        if path is None or certificate is None:
            return False
        excess = max(self._excess(certificate), PROOF_BACKOFF)
        program = path.program.backed_off(excess * path.near(2.0 * excess))
        self.find = lambda: settled(PathPoint(program, path.x))
        return True

    def _excess(self, certificate: Certificate) -> float:
        """The largest that a certificate refutes, or misses of the reserve, as a fraction of its range."""
        refuted = (f for f in certificate.findings if f.verdict is Verdict.VIOLATED and f.limit is not None)
        beyond = [-(f.margin or 0.0) / (f.size or max(abs(f.limit or 0.0), 1.0)) for f in refuted]
        missed = [shortfall.size for shortfall in reserve_shortfalls(certificate, self.attempts.reserve)]
        return max([*beyond, *missed], default=0.0)


def flyable_order(vehicle: Vehicle | None) -> int:
    """The lowest order whose paths jump in nothing that a vehicle cannot make jump."""
    return MOMENT_ORDER + (vehicle is not None and bool(vehicle.lags.any()))


def default_order(problem: Problem, vehicle: Vehicle | None) -> int:
    """The lowest order that is flyable, and whose input the problem's limits bound or leave alone."""
    limited = [k for k in INPUT_NAMES if np.isfinite(problem.limits.of(k)[1]).any()]
    return max([flyable_order(vehicle), *limited])


def plan_of(attempts: Attempts, judged: Judged[Placement], backend: str) -> Plan:
    """The plan of what a search settled on; a bound on the cost is said only of the program's own answer."""
    placement = judged.solution.source
    answer = placement.answer
    own = placement.path is None
    return judged.plan(
        attempts.recorder,
        planner="miqp",
        order=attempts.formulation.chain.order,
        status=judged.solution.status,
        backend=backend,
        stages=attempts.placed(judged),
        bound=attempts.formulation.cost(answer.bound, placement.dt) if own else None,
        gap=answer.gap if own else None,
    )
