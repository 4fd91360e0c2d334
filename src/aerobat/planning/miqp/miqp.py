"""The paper's planner (Section II): a mixed-integer QP over a chain of integrators, at the smallest dt."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import sqrt

import numpy as np

from aerobat.certification import Certificate, Verdict
from aerobat.errors import Infeasible, SpecError
from aerobat.optimization import AssignmentResult, Solver, solver
from aerobat.planning.feasibility import RotorMargin, rotor_margin
from aerobat.planning.miqp.diagnosis import why_infeasible
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.integrator import IntegratorChain
from aerobat.planning.proof import certificate_for
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.search import BisectionSearch, GridSearch, Search
from aerobat.planning.tighten import tightened
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# without a vehicle, stages that ask a share of its thrust assume what a hexarotor in the paper's class has
ASSUMED_THRUST_TO_WEIGHT = 5.0
ROUNDS = 4  # of searching, at most, with bounds drawn in by what was exceeded
UNPROVEN = 1e-4  # [N] beyond what is exceeded, kept from rotor limits that the certificate cannot confirm

Progress = Callable[[Attempt], None]


@dataclass(frozen=True)
class Miqp:
    """How to plan: the integrator's order (3 jerk, 4 snap, 5 crackle input), N, the search on dt, the solver.

    Without a `search`, dt is the first feasible of the paper's grid when there is no vehicle, and otherwise
    the smallest, to half a percent, at which the rotors can do it. With a vehicle the problem's limits hold
    between interval ends too, and all limits by proof: where a plan exceeds any, bounds are drawn in by as
    much, and the search begins again.
    """

    order: int = 4
    intervals: int = 20
    search: Search | None = None
    backend: str = "builtin"
    time_limit: float | None = None  # [s] per program; the best plan found by then is taken, with its gap

    def __post_init__(self) -> None:
        """Check by building what they describe."""
        IntegratorChain(self.order, self.intervals)
        if self.time_limit is not None and not self.time_limit >= 0.0:
            raise SpecError(f"time_limit must be a number of seconds, zero or more, got {self.time_limit}")

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The plan of the smallest dt that the search finds.

        With a vehicle, its rotor thrusts stay within limits along the whole trajectory. Raises
        Infeasible, naming the bound that binds, SpecError for input that makes no sense, and
        BackendMissing when the solver is not installed.
        """
        formulation = formulate(problem, self.order, self.intervals, vehicle)
        planning = _Planning(self, formulation, vehicle, solver(self.backend), progress)
        found = self._smallest(planning)
        if vehicle is None:
            return planning.result(found, None)
        for _ in range(ROUNDS):
            certificate = certificate_for(found.trajectory, problem, vehicle)
            if not planning.draw_in(found.trajectory, certificate):
                break
            found = self._smallest(planning)
        return planning.result(found, certificate)

    def _smallest(self, planning: _Planning) -> _Found:
        """What the search finds. Raises Infeasible when that is nothing."""
        formulation, vehicle = planning.formulation, planning.vehicle
        found = self._search(formulation, vehicle).smallest(planning.attempt)
        if found is None:
            raise Infeasible(
                why_infeasible(formulation, planning.attempts, planning.margins, vehicle), planning.attempts
            )
        return found

    def _search(self, formulation: Formulation, vehicle: Vehicle | None) -> Search:
        if self.search is not None:
            return self.search
        if vehicle is None:
            return GridSearch()
        first = duration_lower_bound(formulation.problem, vehicle) / self.intervals
        return BisectionSearch(first, last=max(4.0, 2.0 * first))


def formulate(problem: Problem, order: int, intervals: int, vehicle: Vehicle | None = None) -> Formulation:
    """The problem's program for any dt, its stages' thrusts scaled to the vehicle.

    Raises Infeasible when a stage asks more thrust than the vehicle has.
    """
    gravity = problem.environment.gravity
    thrust = ASSUMED_THRUST_TO_WEIGHT * gravity if vehicle is None else vehicle.max_specific_thrust
    sequence = problem.stages(thrust)
    if vehicle is not None:
        _check_thrust(sequence, vehicle)
    return Formulation(problem, sequence, IntegratorChain(order, intervals))


@dataclass(frozen=True)
class _Found:
    dt: float
    trajectory: Trajectory
    cost: float
    answer: AssignmentResult
    margin: RotorMargin | None


@dataclass
class _Planning:
    """One run of the search: tries durations and keeps the record."""

    config: Miqp
    formulation: Formulation
    vehicle: Vehicle | None
    solver: Solver
    progress: Progress | None
    attempts: list[Attempt] = field(default_factory=list)
    margins: list[RotorMargin] = field(default_factory=list)
    slots: tuple[int, ...] | None = None
    spare: float = 0.0  # [N] that is kept from the rotors' limits

    def draw_in(self, trajectory: Trajectory, certificate: Certificate) -> bool:
        """Draw bounds in by what a trajectory exceeds, or is not proven to hold; whether there was any."""
        bounds, limits = self.formulation.bounds, self.formulation.problem.path_limits
        # the input itself is constant on each interval and exceeds nothing
        inside = tightened(bounds, limits, trajectory, self.formulation.chain.order)
        self.formulation = replace(self.formulation, limits=inside)
        worst = certificate.worst
        if worst is None or worst.verdict is Verdict.HOLDS:
            return inside is not bounds
        self.spare += UNPROVEN + abs(worst.margin or 0.0)
        return True

    def attempt(self, dt: float) -> _Found | None:
        """Solve at one dt; None where the program has no solution or the rotors cannot follow it."""
        program = self.formulation.program(dt)
        answer = self.solver.solve(program, time_limit=self.config.time_limit, start=self.slots)
        if answer.x is None:
            late = answer.status == "unknown"
            outcome = "no solution was found in time" if late else "the program has no solution"
            return self._record(dt, answer, None, outcome)
        self.slots = answer.slots
        inputs = self.formulation.inputs(answer.x, dt)
        trajectory = Trajectory.from_inputs(
            self.formulation.initial, inputs, dt, self.formulation.problem.heading
        )
        margin = None
        if self.vehicle is not None:
            margin = rotor_margin(trajectory, self.vehicle, self.formulation.problem.environment)
            self.margins.append(margin)
        found = _Found(dt, trajectory, self.formulation.cost(answer.cost, dt), answer, margin)
        if margin is not None and not (margin.feasible and margin.margin >= self.spare):
            return self._record(dt, answer, None, str(margin), found.cost)
        return self._record(dt, answer, found, "feasible", found.cost)

    def _record(
        self,
        dt: float,
        answer: AssignmentResult,
        found: _Found | None,
        outcome: str,
        cost: float | None = None,
    ) -> _Found | None:
        duration = dt * self.config.intervals
        feasible = found is not None
        attempt = Attempt(duration, feasible, answer.status, outcome, cost, answer.nodes, answer.time, dt)
        self.attempts.append(attempt)
        if self.progress is not None:
            self.progress(attempt)
        return found

    def result(self, found: _Found, certificate: Certificate | None) -> Plan:
        """The plan of what the search settled on."""
        stages = (
            PlacedStage(stage.name, slot, (slot + 1) * found.dt, stage.gate)
            for stage, slot in zip(self.formulation.sequence.stages, found.answer.slots or (), strict=True)
        )
        return Plan(
            problem=self.formulation.problem,
            trajectory=found.trajectory,
            planner="miqp",
            order=self.config.order,
            dt=found.dt,
            cost=found.cost,
            status=found.answer.status,
            bound=self.formulation.cost(found.answer.bound, found.dt),
            gap=found.answer.gap,
            backend=self.config.backend,
            stages=tuple(stages),
            attempts=tuple(self.attempts),
            vehicle=self.vehicle,
            margin=found.margin,
            certificate=certificate,
        )


def _check_thrust(sequence: StageSequence, vehicle: Vehicle) -> None:
    """Refuse at once what no duration can mend."""
    for stage in sequence.stages:
        for condition in stage.conditions:
            asked = condition.min_thrust
            if asked > vehicle.max_specific_thrust:
                where = "inverted" if condition.direction[2] < -0.99 else "along its attitude"
                raise Infeasible(
                    f"the stage '{stage.name}' asks {asked:.3g} m/s² {where}, {vehicle.name} gives "
                    f"{vehicle.max_specific_thrust:.3g}; lower what it asks or take a stronger vehicle"
                )


def duration_lower_bound(problem: Problem, vehicle: Vehicle) -> float:
    """Half the time that full thrust would take straight through the gates [s]: where the search starts."""
    gates = [gate.position for gate in problem.gates]
    points = [problem.start.position, *gates, problem.goal.position]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return max(sqrt(length / vehicle.max_specific_thrust), 0.1)
