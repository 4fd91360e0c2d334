"""Attempts at one program and one dt: paths that are certified directly, and paths for the refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.optimization import AssignmentResult, Solver, improved_in_windows
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, judge
from aerobat.planning.courses import is_placed_in_windows
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.integrator import INPUT_NAMES
from aerobat.planning.passages import place_stages
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

COURSE_SCAN_NODES = 50  # node limit of a course's program along a scan, where no bound is needed
COURSE_NODES = 5000  # node limit of a course's program otherwise: gives the bound, windows place the stages
MOMENT_ORDER = 4  # the lowest order without jumps of body rates; thrusts do not jump from 5 on


@dataclass(frozen=True, eq=False)
class Placement:
    """The answer of the program at one dt."""

    answer: AssignmentResult
    dt: float  # [s]

    def times(self, trajectory: Trajectory) -> list[float]:
        """Return the times [s] at which the answer's path passes the stages."""
        return [float(trajectory.knots[slot + 1]) for slot in self.answer.slots or ()]


@dataclass
class Attempts:
    """The data that attempts at one problem share."""

    formulation: Formulation
    solver: Solver
    recorder: Recorder
    slots: tuple[int, ...] | None = None  # slots of the last solution, the next solve's warm start

    def solve(self, dt: float, node_limit: int | None = None) -> Placement:
        """Return the answer of the paper's program at one dt, exact without limits on time and nodes.

        Long courses are not solved exactly: their stages are placed in moving windows.
        """
        program = self.formulation.program(dt)
        if not is_placed_in_windows(self.formulation.sequence):
            answer = self.solver.solve(program, node_limit=node_limit, start=self.slots)
        else:
            limit = COURSE_NODES if node_limit is None else min(node_limit, COURSE_SCAN_NODES)
            answer = self.solver.solve(program, node_limit=limit, start=self.slots)
            answer = improved_in_windows(program, answer, self.slots)
        self.slots = answer.slots or self.slots
        return Placement(answer, dt)

    @property
    def task(self) -> Task:
        """The task that is planned."""
        return self.formulation.task

    @property
    def is_over(self) -> bool:
        """True where no time is left for another attempt; the first one is made in any case."""
        return bool(self.recorder.attempts) and out_of_time()

    @property
    def jumps(self) -> bool:
        """True if paths of this order have jumps of body rates, or of thrusts of rotors with lag."""
        return self.formulation.chain.order < flyable_order(self.task.vehicle_if_any)

    def judge(
        self, placement: Placement, failure: str | None = None, excess: float = 0.0
    ) -> Judged[Placement]:
        """Certify a program's answer.

        Args:
            placement: The answer.
            failure: Why the vehicle cannot fly the path, where that is known without a certificate.
            excess: The constraint violation, as a fraction of a constraint's range, negative.
        """
        vehicle = self.task.vehicle_if_any
        span = 0.0 if vehicle is None else float(vehicle.thrust_ranges.max())
        answer, dt = placement.answer, placement.dt
        solved = answer.x is not None
        solution = Solution(
            source=placement,
            duration=dt * self.formulation.chain.intervals,
            trajectory=self.trajectory(placement) if solved else None,
            status=answer.status,
            nodes=answer.nodes,
            solve_time=answer.time,
            cost=self.formulation.cost(answer.cost, dt) if solved else None,
            dt=dt,
            failure=failure or (None if solved else _why_unsolved(answer)),
            margin=excess * span or None,
        )
        return judge(solution, self.task, self.recorder, self.jumps)

    def certified(self, dt: float) -> Judged[Placement] | None:
        """Return the answer at one dt if it is certified; None otherwise, or where no time is left."""
        if self.is_over:
            return None
        judged = self.judge(self.solve(dt))
        return judged if judged.feasible else None

    def trajectory(self, placement: Placement) -> Trajectory:
        """Return the path of an answer."""
        formulation, answer, dt = self.formulation, placement.answer, placement.dt
        assert answer.x is not None
        return Trajectory.from_inputs(
            formulation.initial, formulation.inputs(answer.x, dt), dt, formulation.problem.heading.start
        )

    def path(self, placement: Placement) -> WarmStart:
        """Return the path of an answer as a warm start, with the stages in the order of their times."""
        trajectory = self.trajectory(placement)
        return WarmStart.through(trajectory, self.task.stages.stages, placement.times(trajectory))

    def plan(self, judged: Judged[Placement], backend: str) -> Plan:
        """Return the plan of a program's own path, with the bound on its cost."""
        placement, trajectory = judged.solution.source, judged.solution.trajectory
        assert trajectory is not None
        answer, times = placement.answer, placement.times(trajectory)
        return judged.plan(
            self.recorder,
            planner="miqp",
            order=self.formulation.chain.order,
            status=judged.solution.status,
            backend=backend,
            stages=place_stages(self.formulation.sequence.stages, answer.slots or (), times),
            bound=self.formulation.cost(answer.bound, placement.dt),
            gap=answer.gap,
        )


def _why_unsolved(answer: AssignmentResult) -> str:
    if answer.status == "infeasible":
        return "the program has no solution"
    return "no solution was found in time" if out_of_time() else "the solver did not converge"


def flyable_order(vehicle: Vehicle | None) -> int:
    """Return the lowest order whose paths have no jumps that a vehicle cannot follow."""
    return MOMENT_ORDER + (vehicle is not None and bool(vehicle.lags.any()))


def default_order(problem: Problem, vehicle: Vehicle | None) -> int:
    """Return the lowest order that is flyable and not below any derivative that the problem limits."""
    limited = [k for k in INPUT_NAMES if np.isfinite(problem.limits.of(k)[1]).any()]
    return max([flyable_order(vehicle), *limited])
