"""The paper's planner (Section II): a mixed-integer QP over a chain of integrators, at the smallest dt."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Literal

import numpy as np

from aerobat.certification import Certificate
from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.errors import Infeasible
from aerobat.optimization import AssignmentResult, Solver, solver
from aerobat.planning.certified_solve import Judged, Solution, certified_solve, refuted_by_samples, tightened
from aerobat.planning.miqp.diagnosis import why_infeasible
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.integrator import IntegratorChain, Intervals, Order
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import PlacedStage, Plan
from aerobat.planning.search import BisectionSearch, GridSearch, Search
from aerobat.problem.problem import Limits, Problem
from aerobat.problem.stage import StageSequence
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# without a vehicle, stages that ask a fraction of its thrust assume what a hexarotor in the paper's class has
ASSUMED_THRUST_TO_WEIGHT = 5.0
ROUNDS = 4  # of solving at one dt, at most, with bounds tightened by what was exceeded between interval ends
JERK_ORDER = 3  # the order whose body rates jump between intervals


@planner("miqp")
class Miqp(Planner):
    """The paper's mixed-integer program (Section II).

    Without a `search`, dt is the first feasible of the paper's grid when there is no vehicle, and otherwise
    the smallest, to half a percent, at which a plan is certified. With a vehicle the problem's limits hold
    between interval ends too: where a solution exceeds any, its bounds are tightened by as much, and it is
    solved again. Only with jerk as input, order 3, body rates jump, which its certificate then says.
    """

    order: Order = option(
        4, "The derivative that is piecewise constant, 3 jerk (the paper's), 4 snap, 5 crackle."
    )
    intervals: Intervals = option(20, "N, the number of intervals.")
    search: Annotated[Search, AS_IT_IS] | None = None
    backend: Literal["builtin", "gurobi", "scip"] = option(
        "builtin", "The solver, builtin, gurobi or scip (the last two are optional extras)."
    )
    time_limit: NonNegative | None = option(  # [s]
        None, "Seconds for each program; the best plan found by then is taken and its gap reported."
    )

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The plan of the smallest dt that the search finds.

        With a vehicle, its rotor thrusts stay within limits along the whole trajectory. Raises
        Infeasible, naming the bound that binds, SpecError for input that makes no sense, and
        BackendMissing when the solver is not installed.
        """
        formulation = formulate(problem, self.order, self.intervals, vehicle)
        planning = _Planning(self, formulation, vehicle, solver(self.backend), Recorder(progress))
        found = self._search(problem, vehicle).smallest(planning.attempt)
        if found is None:
            attempts = planning.recorder.attempts
            raise Infeasible(why_infeasible(formulation, attempts, vehicle), attempts)
        return planning.result(found)

    def _search(self, problem: Problem, vehicle: Vehicle | None) -> Search:
        if self.search is not None:
            return self.search
        if vehicle is None:
            return GridSearch()
        first = duration_lower_bound(problem, vehicle) / self.intervals
        return BisectionSearch(first, last=max(4.0, 2.0 * first))


def formulate(problem: Problem, order: int, intervals: int, vehicle: Vehicle | None = None) -> Formulation:
    """The problem's program for any dt, its stages' thrusts scaled to the vehicle.

    Raises Infeasible when a stage asks more thrust than the vehicle has.

    Args:
        problem: What is planned.
        order: Of the derivative of position that is the input.
        intervals: Their number, N.
        vehicle: What shall fly it, or nothing in particular.
    """
    gravity = problem.environment.gravity
    thrust = ASSUMED_THRUST_TO_WEIGHT * gravity if vehicle is None else vehicle.max_specific_thrust
    sequence = problem.stages(thrust)
    if vehicle is not None:
        _check_thrust(sequence, vehicle)
    return Formulation(problem, sequence, IntegratorChain(order, intervals))


@dataclass
class _Planning:
    """One run of the search: what all attempts share."""

    config: Miqp
    formulation: Formulation
    vehicle: Vehicle | None
    solver: Solver
    recorder: Recorder
    slots: tuple[int, ...] | None = None  # of the last solution: where the next solve begins

    def attempt(self, dt: float) -> Judged[AssignmentResult] | None:
        """Outcome of one dt; None where nothing is found that the rotors can follow within all limits."""
        program = _ProgramAtDt(self, dt)
        jumps = self.config.order <= JERK_ORDER + 1
        judged = certified_solve(
            program, self.formulation.problem, self.vehicle, self.recorder, ROUNDS, jumps
        )
        return judged if judged.feasible else None

    def result(self, found: Judged[AssignmentResult]) -> Plan:
        """The plan of what the search settled on."""
        answer, dt = found.solution.source, found.solution.dt or 0.0
        stages = zip(self.formulation.sequence.stages, answer.slots or (), strict=True)
        return found.plan(
            self.recorder,
            planner="miqp",
            order=self.config.order,
            status=answer.status,
            backend=self.config.backend,
            stages=tuple(PlacedStage(s.name, slot, (slot + 1) * dt, s.gate) for s, slot in stages),
            bound=self.formulation.cost(answer.bound, dt),
            gap=answer.gap,
        )


@dataclass
class _ProgramAtDt:
    """The program at one dt, with bounds at interval ends that are as tight as what lies between needs."""

    planning: _Planning
    dt: float
    bounds: Limits | None = None  # tighter than the problem's limits

    def solve(self) -> Solution[AssignmentResult]:
        """Its solution; a failure where it has none, or where samples show that the rotors cannot follow."""
        planning, formulation = self.planning, self.planning.formulation
        program = formulation.program(self.dt, self.bounds)
        answer = planning.solver.solve(program, time_limit=planning.config.time_limit, start=planning.slots)
        if answer.x is None:
            late = answer.status == "unknown"
            failure = "no solution was found in time" if late else "the program has no solution"
            return self._solution(answer, failure=failure)
        planning.slots = answer.slots
        trajectory = Trajectory.from_inputs(
            formulation.initial,
            formulation.inputs(answer.x, self.dt),
            self.dt,
            formulation.problem.heading,
        )
        solution = self._solution(answer, trajectory, formulation.cost(answer.cost, self.dt))
        return refuted_by_samples(solution, formulation.problem, planning.vehicle)

    def tighten(self, solution: Solution[AssignmentResult], certificate: Certificate | None) -> bool:
        """Tighten bounds on the state; the input itself is constant on each interval and exceeds nothing."""
        if solution.trajectory is None or certificate is None or (certificate.margin or 0.0) < 0.0:
            return False  # rotors are helped by a longer dt only
        chain, limits = self.planning.formulation.chain, self.planning.formulation.problem.path_limits
        imposed = limits if self.bounds is None else self.bounds
        bounds = tightened(imposed, limits, solution.trajectory, chain.order)
        if bounds is None or bounds is imposed:
            return False
        self.bounds = bounds
        return True

    def _solution(
        self,
        answer: AssignmentResult,
        trajectory: Trajectory | None = None,
        cost: float | None = None,
        failure: str | None = None,
    ) -> Solution[AssignmentResult]:
        return Solution(
            source=answer,
            duration=self.dt * self.planning.config.intervals,
            trajectory=trajectory,
            status=answer.status,
            nodes=answer.nodes,
            solve_time=answer.time,
            cost=cost,
            dt=self.dt,
            failure=failure,
        )


def _check_thrust(sequence: StageSequence, vehicle: Vehicle) -> None:
    """Refuse at once what no duration can mend."""
    for stage in sequence.stages:
        for condition in stage.conditions:
            thrust = condition.min_thrust
            if thrust > vehicle.max_specific_thrust:
                where = "inverted" if condition.direction[2] < -0.99 else "along its attitude"
                raise Infeasible(
                    f"the stage '{stage.name}' asks {thrust:.3g} m/s² {where}, {vehicle.name} gives "
                    f"{vehicle.max_specific_thrust:.3g}; lower what it asks or take a stronger vehicle"
                )


def duration_lower_bound(problem: Problem, vehicle: Vehicle) -> float:
    """Half the time that full thrust would take straight through the gates [s]: where the search starts."""
    gates = [gate.position for gate in problem.gates]
    points = [problem.start.position, *gates, problem.goal.position]
    distance = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return max(sqrt(distance / vehicle.max_specific_thrust), 0.1)
