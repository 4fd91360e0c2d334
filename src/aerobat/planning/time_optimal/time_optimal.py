"""The fastest motion that rotors can do: the paper's reference [1] approach, the yardstick for all others.

Full nonlinear dynamics (eqs. (3) and (4)) with limits on every rotor, through a maneuver's stages in their
order, each phase between them of free duration. The body never spins about its thrust axis, as flatness and
the controller have it, so that the trajectory is flown as it was planned.

The program has many local optima. It is solved from several starts on a coarse mesh, the best of them on a
fine one, and the fastest that is certified is kept.
"""

from __future__ import annotations

from dataclasses import field, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from pydantic import Field

from aerobat.declaration import AS_IT_IS, Count, NonNegative
from aerobat.errors import Infeasible, Reason, SpecError, limits_of
from aerobat.optimization.deadline import out_of_time, within_share, within_time
from aerobat.optimization.nonlinear import import_casadi
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.polynomial.free_knots import FreeKnots
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.time_limit import TIME_LIMIT, stopped, too_short
from aerobat.planning.warm_start import MIN_INTERVALS, Reserve, flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:  # what it takes to plan is imported then: the options are those of every command that plans
    from aerobat.planning.certified_solve import Judged
    from aerobat.planning.time_optimal.collocated_program import SolvedMotion
    from aerobat.planning.time_optimal.race import Race
    from aerobat.planning.time_optimal.starts import Starts

SEGMENTS = 16  # of polynomials that are refined from its motion,
REFINED_TIME = 0.5  # of the time that is left, where there is a limit
SMOOTHING_LAG = 0.005  # [s] that rotors without lag are given, where thrusts that jump lead nowhere


@planner("time-optimal")
class TimeOptimal(Planner):
    """The full nonlinear dynamics at the rotors' limits; needs the extra casadi.

    So many `intervals` in all are allocated to the phases; a course of many stages has 20 a leg at least. Of
    several `starts` on a coarse mesh, from the plans of `guess` and of closed forms at several paces, the
    best are solved finely, and the fastest that is certified is returned; `Plan.starts` has the durations of
    all. Polynomials that are refined from there are the plan where they are faster, and where nothing else is
    found. A course begins at the closed form through its stages, and elsewhere only where that leads nowhere;
    a closed one is free-knots'. A `start`, a plan of whichever planner, comes first. Each limit is used in
    full, which leaves nothing for a controller: `reserve`, a fraction of each rotor's range of thrust, is
    kept from either of its ends for it. A `planar` plan stays in the vertical plane of its start, where that
    has one; in space there may be a faster one.
    """

    PLANS_CLOSED_COURSES: ClassVar[bool] = True

    intervals: Annotated[int, Field(ge=MIN_INTERVALS)] = 60
    reserve: Reserve = option(
        0.0,
        "The fraction of each rotor's range of thrust that is kept from either of its ends for the "
        "controller; with 0 a time-optimal plan is a yardstick that no controller follows for sure.",
        command_default=FLYING_RESERVE,
    )
    starts: Annotated[int, Field(ge=1)] = option(
        8, "The number of starts; more find a faster local optimum at times, and take longer."
    )
    planar: bool = option(False, "Stay in the maneuver's vertical plane, where it has one.")
    iterations: Count = 500  # at most, each solve
    time_limit: NonNegative | None = option(None, TIME_LIMIT)  # [s]
    guess: Miqp = field(default_factory=partial(Miqp, segments=4, flies=False))
    start: Annotated[Plan, AS_IT_IS] | None = None

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest motion found from all starts, certified for the vehicle's limits and the problem's.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when no motion is
        found that can be certified, BackendMissing without CasADi.
        """
        from aerobat.planning.time_optimal.optimal_control.collocation import BOUNDED_DERIVATIVES
        from aerobat.planning.time_optimal.race import Race, with_smoother
        from aerobat.planning.time_optimal.starts import starts

        if not problem.ends:
            return self._lap(problem, vehicle, progress)
        task = flown_task("time-optimal", problem, vehicle, self.reserve)
        if np.isfinite(problem.path_limits.of(BOUNDED_DERIVATIVES)[1]).any():
            raise SpecError(
                "limits.crackle cannot be held by the time-optimal planner, whose moments jump; drop it"
            )
        import_casadi()
        race = Race(task, Recorder(progress), self.intervals, self.iterations)
        attempts = race.recorder.attempts
        with within_time(self.time_limit):
            begun = starts(task, self.guess, self.planar, self.starts, self.start)
            for body in with_smoother(task.vehicle, SMOOTHING_LAG):
                found = race.winner(begun.motions, body)
                own = None if found is None else _plan(race.flyable(found), race)
                if out_of_time():
                    return stopped(_best_so_far(own, begun, race, self.time_limit))
                if own is not None:
                    break
            best = own if race.on_course else self._refined(own, begun, race)
            if best is not None:
                return best
        last = attempts[-1].outcome
        remedy = "ask less of its stages and limits, or give more intervals"
        if len(task.environment.pieces):
            remedy = "this planner knows no obstacles, take free-knots, which goes around them"
        sentence = (
            f"no motion of '{problem.name}' was found that {task.vehicle.name} can do: at the last attempt "
            f"{last}; {remedy}"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), attempts)

    def _refined(self, own: Plan | None, begun: Starts, race: Race) -> Plan | None:
        """The planner's own plan, or a faster one of polynomials.

        They are refined from its own plan, or from one that it began from, if that is faster.
        """
        known = begun.plans if own is None else (own, *begun.plans)
        start = min(known, key=lambda plan: plan.duration, default=None)
        if start is None:
            return None
        planner = FreeKnots(SEGMENTS, start, reserve=self.reserve)
        try:
            with within_share(REFINED_TIME):
                found = planner.plan(race.task.problem, race.task.vehicle, race.recorder.progress)
        except Infeasible:
            return own
        if own is not None and found.duration >= own.duration:
            return own
        attempts = (*race.recorder.attempts, *found.attempts)
        return replace(found, planner="time-optimal", attempts=attempts, starts=race.durations)

    def _lap(self, problem: Problem, vehicle: Vehicle | None, progress: Progress | None) -> Plan:
        """The plan of a closed course, by free knots."""
        planner = FreeKnots(reserve=self.reserve, time_limit=self.time_limit)
        return replace(planner.plan(problem, vehicle, progress), planner="time-optimal")


def _best_so_far(own: Plan | None, begun: Starts, race: Race, limit: float | None) -> Plan:
    """The planner's own plan, or that it began from where there is none or it is slower.

    Raises Infeasible where there is neither.
    """
    attempts = tuple(race.recorder.attempts)
    start = min(begun.plans, key=lambda plan: plan.duration, default=None)
    if own is not None and (start is None or own.duration <= start.duration):
        return own
    if start is None:
        raise too_short(race.task.problem, limit, attempts)
    instead = f"time-optimal found none faster in time than the path that it began from, {start.planner}'s"
    shortfalls = [] if start.certificate is None else reserve_shortfalls(start.certificate, race.task.reserve)
    if shortfalls:
        instead += f", whose {shortfalls[0]}"
    return replace(start, planner="time-optimal", attempts=attempts, rescue=instead)


def _plan(found: Judged[SolvedMotion], race: Race) -> Plan:
    """The plan of what won."""
    return found.plan(
        race.recorder,
        planner="time-optimal",
        order=4,
        status="locally optimal",
        backend="ipopt",
        stages=found.solution.source.placed,
        starts=race.durations,
    )
