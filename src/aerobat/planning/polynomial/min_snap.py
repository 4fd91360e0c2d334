"""The paper's alternative planner (Section V): closed-form polynomials and a line search on their times."""

from __future__ import annotations

from enum import StrEnum
from time import perf_counter
from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from aerobat.arrays import Array
from aerobat.declaration import AS_IT_IS, Count, NonNegative
from aerobat.errors import Infeasible, Reason, SpecError, limits_of
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged, Solution, judge
from aerobat.planning.passages import place_stages
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.polynomial.knots import (
    first_times,
    fixed_at_knots,
    stages_with_drag,
    violated_stage,
    without_speed_bounds,
)
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import Plan
from aerobat.planning.rotor_margin import sampled_margin
from aerobat.planning.search import BisectionSearch, GridSearch, Search
from aerobat.planning.task import Task
from aerobat.planning.time_limit import TIME_LIMIT, best_in_time
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import ContinuityRule, minimum_effort
from aerobat.vehicle import Vehicle

FIRST_GUESS_THRUST_TO_WEIGHT = 2.0  # assumed for the first times without a vehicle
STEP = 0.1  # [s] of the paper's line search (Section V-D: 12 iterations from 0.5 and 2.0 to 1.6 and 3.1 s)
SEARCH_STEPS = 100  # largest number of steps of that line search
SLOWEST = 30.0  # factor on the first duration at which the search by scaling all segments gives up
FASTEST = 0.3  # factor on the first duration at which that search begins


class TimeScaling(StrEnum):
    """The segments that a longer duration lengthens."""

    FIRST = "first"  # only the first segment, as in the paper: all knots shift by the same time
    ALL = "all"  # every segment by the same factor


@planner("min-snap")
class MinSnap(Planner):
    """Closed-form polynomials through waypoints with a line search on their times (Section V).

    The polynomials have degree 2s − 1 and the smallest duration of the search that is feasible. With s = 5,
    the paper's degree 9, the cost is the integral of crackle squared, "minimum snap" in name only. With s = 4
    it is minimum snap, with s = 3 minimum jerk. Without a `time_scaling`, waypoints with given times are
    shifted as in the paper, by 0.1 s a step; other paths are scaled as a whole. With `stop_after` the search
    ends at that attempt, whether the vehicle can fly it or not (paper, Fig. 10).
    """

    order: Annotated[int, Field(ge=3, le=5)] = option(  # s
        5, "The derivative whose square is minimized, 3 to 5; 5 gives degree 9."
    )
    rule: Annotated[ContinuityRule, Strict(False)] = ContinuityRule.VARIATIONAL
    time_scaling: Annotated[TimeScaling, Strict(False)] | None = None
    search: Annotated[Search, AS_IT_IS] | None = None
    stop_after: Count | None = option(
        None, "Stop the search at this attempt, whether the vehicle can fly it or not (paper, Fig. 10)."
    )

    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """Return the certified plan at the first duration of the search that the vehicle can fly.

        Without a vehicle, return the path at its first times. Raises Infeasible when no duration is feasible,
        and SpecError for invalid input.
        """
        planning = _Planning(self, problem, vehicle, Recorder(progress))
        first = float(planning.durations.sum())
        search = GridSearch(first, first, 1) if vehicle is None else self._search(planning.scaling, first)

        def shortest() -> Plan | None:
            found = search.smallest(planning.attempt)
            return None if found is None else planning.result(found)

        plan = best_in_time(problem, self.time_limit, planning.recorder, shortest)
        if plan is None:
            raise Infeasible(planning.why_infeasible(), planning.recorder.attempts)
        return plan

    def _search(self, scaling: TimeScaling, first: float) -> Search:
        if self.search is not None:
            return self.search
        if scaling is TimeScaling.FIRST or self.stop_after is not None:
            return GridSearch(first, first + STEP * (SEARCH_STEPS - 1), SEARCH_STEPS)
        return BisectionSearch(FASTEST * first, SLOWEST * first)


class _Planning:
    """One run of the search: the data that all attempts share."""

    def __init__(
        self, config: MinSnap, problem: Problem, vehicle: Vehicle | None, recorder: Recorder
    ) -> None:
        weight = problem.environment.gravity
        thrust = FIRST_GUESS_THRUST_TO_WEIGHT * weight if vehicle is None else vehicle.max_specific_thrust
        self.config, self.task, self.recorder = config, Task.of(problem, vehicle), recorder
        fixed = fixed_at_knots(self.task, config.order, np.zeros((len(self.task.stages.stages), 3)))
        self.durations = first_times(problem, fixed, thrust)
        timed = TimeScaling.ALL if problem.maneuver.first_times is None else TimeScaling.FIRST
        self.scaling = config.time_scaling or timed

    def attempt(self, duration: float) -> Judged[None] | None:
        """Return the judged path of one duration, or None if it misses a stage or the vehicle cannot fly it.

        All attempts but the first also return None where no time is left.
        """
        if self.recorder.attempts and out_of_time():
            return None
        judged = judge(self._closed_form(duration), self.task, self.recorder)
        stopped = len(self.recorder.attempts) == self.config.stop_after
        return judged if judged.feasible or stopped else None

    def _scaled(self, duration: float) -> Array:
        """Return the durations of the segments [s] for a total duration [s]."""
        durations = self.durations.copy()
        if self.scaling is TimeScaling.ALL:
            return np.asarray(durations * (duration / durations.sum()))
        durations[0] += duration - durations.sum()
        if durations[0] <= 0.0:
            raise SpecError(
                f"search: a duration of {duration:g} s leaves the first segment no time; begin with more"
            )
        return durations

    def why_infeasible(self) -> Reason:
        """Return a sentence from the slowest attempt and the one that rotors can most nearly fly."""
        attempts = self.recorder.attempts
        longest = max(attempts, key=lambda attempt: attempt.duration)
        shortest = min(attempt.duration for attempt in attempts)
        flown = [attempt for attempt in attempts if attempt.margin is not None and attempt is not longest]
        nearest = min(flown, key=lambda made: (max(-(made.margin or 0.0), 0.0), made.duration), default=None)
        before = "" if nearest is None else f"at {nearest.duration:.3g} s {nearest.outcome}; "
        remedy = (
            "scale the times of all segments, or give others"
            if self.scaling is TimeScaling.FIRST
            else "give the waypoints other times or fix fewer components, or take the planner free-knots"
        )
        sentence = (
            f"'{self.task.problem.name}' has no closed-form path that flies at any duration from "
            f"{shortest:.3g} to {longest.duration:.3g} s: {before}at the last, {longest.outcome}; {remedy}"
        )
        return Reason(sentence, limits_of(longest.outcome))

    def result(self, found: Judged[None]) -> Plan:
        """Return the plan of the path that the search found."""
        return found.plan(
            self.recorder,
            planner="min-snap",
            order=self.config.order,
            status="feasible" if found.feasible else "stopped",
            backend="closed form",
            stages=found.solution.placed,
        )

    def _closed_form(self, duration: float) -> Solution[None]:
        """Return the path of one duration, with a failure if it misses a stage or samples exceed limits.

        Lower bounds on speed are first left free. If a stage is missed then, speeds are fixed at the bounds.
        """
        started = perf_counter()
        task, durations, margin = self.task, self._scaled(duration), None
        for variant in (without_speed_bounds(task), task):
            trajectory = self._trajectory(variant, durations)
            failure = violated_stage(task, trajectory)
            if failure is None:
                break
        solve_time = perf_counter() - started
        if failure is None and task.vehicle_if_any is not None:
            sampled = sampled_margin(trajectory, task.vehicle, task.environment)
            if sampled.margin < 0.0:
                failure, margin = sampled.reason, sampled.margin
        times = np.cumsum(durations)[:-1].tolist()
        return Solution(
            source=None,
            duration=duration,
            trajectory=trajectory,
            status="optimal",
            nodes=1,
            solve_time=solve_time,
            cost=trajectory.effort(self.config.order),
            failure=failure,
            margin=margin,
            placed=place_stages(task.stages.stages, range(len(times)), times),
        )

    def _trajectory(self, task: Task, durations: Array) -> Trajectory:
        """Return the closed form through stages with drag consistent with its own velocities there.

        Velocities at the stages are an affine function v ↦ M v + c of the velocities used for drag. M is
        found column by column, then v = M v + c is solved. Columns of stages that fix only positions are
        zero: their closed form does not depend on the drag.
        """
        stages, heading = len(task.stages.stages), task.problem.heading.start

        def with_drag_of(velocities: Array) -> Trajectory:
            fixed = fixed_at_knots(task, self.config.order, velocities)
            return minimum_effort(fixed, durations, self.config.rule, heading)

        trajectory = with_drag_of(np.zeros((stages, 3)))
        columns = [3 * k + axis for k in stages_with_drag(task) for axis in range(3)]
        if not columns:
            return trajectory
        there, one = trajectory.knots[1:-1], np.eye(3 * stages)
        constant = trajectory.evaluate(there, 1).ravel()
        own = np.zeros_like(one)
        for column in columns:
            unit = one[column].reshape(stages, 3)
            own[:, column] = with_drag_of(unit).evaluate(there, 1).ravel() - constant
        return with_drag_of(np.asarray(np.linalg.solve(one - own, constant)).reshape(stages, 3))
