"""The paper's planner (Section II): a mixed-integer QP over a chain of integrators, at the smallest dt."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from math import sqrt
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from aerobat.declaration import AS_IT_IS, NonNegative
from aerobat.errors import Infeasible, Reason
from aerobat.optimization import solver
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.assessment.contradiction import is_possible
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.certified_solve import Judged
from aerobat.planning.miqp.attempts import COURSE_SCAN_NODES, Attempts, Placement, default_order
from aerobat.planning.miqp.diagnosis import leg_without_room, why_infeasible
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.miqp.integrator import MAX_INTERVALS, IntegratorChain, Intervals, Order
from aerobat.planning.miqp.rescue import Rescue
from aerobat.planning.miqp.shortest import shortest
from aerobat.planning.planners import KeptClearance, Planner, Reserve, clearance_option, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import MAX_SEGMENTS, SEGMENTS, RefinedPath, Refinement, segments_for
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.search import GridSearch, Search
from aerobat.planning.task import Task
from aerobat.planning.time_limit import TIME_LIMIT, stopped, too_short
from aerobat.problem.limits import Limits
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

INTERVALS = 20  # the paper's
MORE_INTERVALS = (1.3, 2.0)  # factors on the number of intervals where that number leads to no plan
MIN_STAGE_INTERVALS = 2  # least intervals a stage: with fewer, the path of a course has no freedom
MANY_INTERVALS = 40  # tried too if larger: a narrow window near an end needs intervals on both its sides


@planner("miqp")
class Miqp(Planner):
    """The paper's mixed-integer program (Section II), refined within what a vehicle can do.

    Without a vehicle, dt is the first feasible value of the paper's grid, or the one that `search` finds.
    With a vehicle, the programs of several dt place the stages. Then piecewise polynomials from their paths
    are refined until they are as fast as rotors, rotor commands, body rate, limits and conditions allow. With
    a vehicle and a `search` nothing is refined: the plan is the program's own path, at the first dt of the
    search that the vehicle can fly. Plans for a vehicle are certified. The exception are orders whose jumps
    no rotor can make; the certificate then names the jumps.
    """

    order: Order | None = option(
        None,
        "The derivative that is piecewise constant, 3 jerk (the paper's), 4 snap, 5 crackle. Default: 5 for "
        "rotors with lag and where a problem limits it, else 4.",
    )
    intervals: Intervals | None = option(
        None,
        f"N, the number of intervals. Default: {INTERVALS}, or more where a stage's window is narrower.",
    )
    search: Annotated[Search, AS_IT_IS] | None = None
    backend: Literal["builtin", "gurobi", "scip"] = option(
        "builtin", "The solver, builtin, gurobi or scip (the last two are optional extras)."
    )
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]
    reserve: Reserve = option(
        0.0,
        "The fraction of every limit of the vehicle that is kept from either of its ends for the controller, "
        "of the least thrusts a part of what a hover takes; with 0 a plan leaves it next to "
        "nothing. The default is given up where no plan keeps it.",
        command_default=FLYING_RESERVE,
    )
    clearance: KeptClearance = clearance_option()  # [m]
    rescue: bool = option(
        True, "Give up where nothing is found, and try no other intervals, order or planner.", off="no-rescue"
    )
    segments: Annotated[int, Field(ge=2, le=MAX_SEGMENTS)] = SEGMENTS  # of a refined path; courses have more
    # whether paths are flown in simulation and repaired by it, and refined with more segments where that is
    # faster; False where other planners only start from the path, which then gets more rounds
    flies: bool = True

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """Return the shortest plan found; with a vehicle, the plan is certified.

        Raises Infeasible, naming the bound that binds, SpecError for invalid input, and BackendMissing when
        the solver is not installed.
        """
        recorder = Recorder(progress)
        with within_time(self.time_limit):
            try:
                plan = stopped(self._planned(problem, vehicle, recorder))
                if vehicle is None or not self.rescue or self.search is not None:
                    return plan
                return Rescue(self, problem, vehicle, recorder).shortened(plan)
            except Infeasible as infeasible:
                if vehicle is None or not self.rescue or not infeasible.attempts or out_of_time():
                    raise
                rescue = Rescue(self, problem, vehicle, recorder)
                rescued = rescue.plan()
                if rescued is not None:
                    return rescued
                why = Reason(f"{infeasible.sentence}; {rescue}", infeasible.limits)
                raise Infeasible(why, infeasible.attempts) from None

    def intervals_for(self, stages: StageSequence) -> int:
        """Return the number N of intervals for these stages."""
        return stages.intervals_from(INTERVALS) if self.intervals is None else self.intervals

    def with_more_intervals(self, problem: Problem, vehicle: Vehicle) -> Iterator[Miqp]:
        """Yield this planner with more intervals and without fallbacks, fewest intervals first."""
        sequence = problem.stages(vehicle.max_specific_thrust)
        first, least = self.intervals_for(sequence), MIN_STAGE_INTERVALS * len(sequence.stages)
        more = {sequence.intervals_from(max(round(factor * first), least)) for factor in MORE_INTERVALS}
        if max(more) * MORE_INTERVALS[0] < MANY_INTERVALS:
            more.add(sequence.intervals_from(MANY_INTERVALS))
        for intervals in sorted(n for n in more if n <= MAX_INTERVALS):
            yield replace(self, intervals=intervals, rescue=False)

    def _planned(self, problem: Problem, vehicle: Vehicle | None, recorder: Recorder) -> Plan:
        order = default_order(problem, vehicle) if self.order is None else self.order
        task = Task.of(problem, vehicle, self.reserve, self.clearance)
        intervals = self.intervals_for(task.stages)
        formulation = formulate(task, order, intervals)
        attempts = Attempts(formulation, solver(self.backend), recorder)
        if vehicle is None or self.search is not None:
            found = (self.search or GridSearch()).smallest(attempts.certified)
        else:
            first = duration_lower_bound(problem, vehicle) / intervals
            leg = leg_without_room(formulation, first)
            if leg is not None:
                attempts.judge(attempts.solve(first, COURSE_SCAN_NODES))
                raise Infeasible(leg, recorder.attempts)
            least = least_duration(problem, vehicle)
            last = max(4.0, 2.0 * first, 2.0 * least / intervals)
            return self._refined(attempts, (first, last), least)
        if found is None:
            raise self._nothing_found(attempts)
        return attempts.plan(found, self.backend)

    def _refined(self, attempts: Attempts, scanned: tuple[float, float], least: float) -> Plan:
        """Return the plan of the shortest path that is refined from programs along a scan on dt.

        Args:
            attempts: Solves and records the programs.
            scanned: The scan's smallest and largest dt [s].
            least: A lower bound on the duration of any motion [s].
        """
        task, recorder = attempts.task, attempts.recorder
        whole = replace(Refinement.of(task, recorder), adds_segments=self.flies, gives_up_early=self.flies)
        segments = segments_for(task.stages, self.segments)
        found: Judged[RefinedPath] | Judged[Placement] | None = None
        for refinement in whole.with_and_without_rooms:
            found = shortest(attempts, refinement, segments, scanned, least) or found
            if found is not None and isinstance(found.solution.source, RefinedPath):
                break
        if found is None:
            raise self._nothing_found(attempts)
        if isinstance(found.solution.source, Placement):
            return attempts.plan(found, self.backend)
        if self.flies:
            found = FlownPath.of(refinement, found).through_gates().with_reserves().judged
        return found.plan(
            recorder,
            planner="miqp",
            order=attempts.formulation.chain.order,
            status=found.solution.status,
            backend=self.backend,
            stages=found.solution.source.placed,
        )

    def _nothing_found(self, attempts: Attempts) -> Infeasible:
        """Return the error: too little time, or the bound that binds."""
        made = tuple(attempts.recorder.attempts)
        if out_of_time():
            quicker = "take the backend builtin, which is quicker"
            if self.backend == "builtin":
                quicker = "use fewer intervals"
            return too_short(attempts.task.problem, self.time_limit, made, quicker)
        return Infeasible(partial(why_infeasible, attempts.formulation, made), made)


def formulate(task: Task, order: int, intervals: int) -> Formulation:
    """Return a task's program for any dt.

    Raises Infeasible when a stage asks more thrust than the vehicle has.

    Args:
        task: The task that is planned.
        order: The derivative of position that is the input.
        intervals: The number N of intervals.
    """
    if task.vehicle_if_any is not None:
        _check_thrust(task.stages, task.vehicle)
    _check_stages(task)
    return Formulation(task, IntegratorChain(order, intervals))


def _check_stages(task: Task) -> None:
    """Raise Infeasible for a stage whose conditions exclude each other at any time."""
    for stage in task.stages.linear.stages:
        bounds = [condition.bound(task.balance) for condition in stage.conditions]
        if bounds and not is_possible(bounds, Limits()):
            sentence = (
                f"the conditions of the stage '{stage.name}' exclude each other: no position, velocity and "
                "acceleration satisfies them all; change or drop one of them"
            )
            raise Infeasible(Reason(sentence, (f"stage '{stage.name}'",)))


def _check_thrust(sequence: StageSequence, vehicle: Vehicle) -> None:
    """Raise Infeasible for a stage that asks more thrust than the vehicle has, which no duration changes."""
    for stage in sequence.stages:
        for condition in stage.conditions:
            thrust = condition.min_thrust
            if thrust > vehicle.max_specific_thrust:
                where = "inverted" if condition.direction[2] < -0.99 else "along its attitude"
                sentence = (
                    f"the stage '{stage.name}' asks {thrust:.3g} m/s² {where}, {vehicle.name} gives "
                    f"{vehicle.max_specific_thrust:.3g}; lower what it asks or take a stronger vehicle"
                )
                raise Infeasible(Reason(sentence, (f"stage '{stage.name}'",)))


def duration_lower_bound(problem: Problem, vehicle: Vehicle) -> float:
    """Return the duration [s] at which the search starts: half the time from rest to rest at full thrust.

    The distance is that of straight lines through the gates.
    """
    gates = [gate.position for gate in problem.gates]
    points = [problem.start.position, *gates, problem.goal.position]
    distance = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    return max(sqrt(distance / vehicle.max_specific_thrust), 0.1)
