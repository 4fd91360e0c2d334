"""Fallbacks of miqp: other settings and planners where the requested ones find no plan, or a poor one.

A problem is not refused before the fallbacks are tried, within RESCUE_WORK.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from math import inf
from typing import Any, NamedTuple, cast

from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_share, within_time, work
from aerobat.planning.assessment.assessment import INSTANT
from aerobat.planning.planners import Planner, planner_class, planner_with_reserve
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import FLYING_RESERVE, KEPT_PART, Plan
from aerobat.planning.turns import priced_duration
from aerobat.problem.problem import Problem
from aerobat.problem.stage import MIN_CROSSING_SPEED, StageSequence
from aerobat.vehicle import Vehicle

RESCUE_WORK = 4.0  # work limit [s] of all fallbacks, so that refusals take 5 s (benchmarks/audit.py)
# work limit [s] where a plan most likely exists, as a path with small constraint violations was found
PROMISING_WORK = 15.0
# work limit [s] where a plan is known, but is poor or keeps no reserve (benchmarks/audit.py)
SHORTENING_WORK = 16.0
FALLBACK_FRACTION = 0.75  # fraction of the remaining work for one fallback, so that the next has some
# factor on the duration of a nearly feasible path above which a plan is poor: of the plans of 300 random
# problems, it selects those far from the best
SLOW_FACTOR = 1.07
# ratio to the lower bound above which a plan is poor where no stage is in a window of time: of 200 random
# problems, 2 % have such plans. A knife-edge pass of x500 takes 2.84 s so, not 2.97.
LONG = 2.5
FREE_KNOTS = "free-knots"  # a quick planner that starts from other paths too
HALF_RESERVE = "with half of the reserve"
# factor on the duration of a plan without a reserve up to which one with half of the reserve is taken. Of 100
# flights of the plans of six problems under `lab`, 0, 7, 71, 86, 100 and 1 succeed without, 14, 47, 87, 100,
# 100 and 34 with it.
LONGER_FOR_RESERVE = 1.5
# factor on the duration of a poor plan below which the first fallback's plan is taken. A knife-edge pass of
# section-v takes 1.85 s so, not 2.09 s.
MUCH_SHORTER = 0.95
FASTER = 2.0  # factor on the least speed through gates
TIME_OPTIMAL = "time-optimal"  # the planner that starts from the most paths
FEW_STARTS = 2  # starts of time-optimal: more starts give faster plans, but seldom the first plan


class Fallback(NamedTuple):
    """A planner in place of the requested one, and words on how it plans."""

    planner: Planner
    how: str
    stricter: Problem | None = None  # planned in place of the problem, by which the plan is judged


@dataclass
class Rescue:
    """The search for a plan by fallbacks, after a requested planner found none or a poor one."""

    requested: Any  # the requested planner, a Miqp (not imported: its module imports this one)
    problem: Problem
    vehicle: Vehicle
    recorder: Recorder  # of the requested planner; attempts of fallbacks are passed on to its `progress`
    failed: list[str] = field(default_factory=list)  # fallbacks that found no plan
    unanswered: list[str] = field(default_factory=list)  # fallbacks that the work limit ended
    # a fallback that failed, but found a path that is nearly feasible
    promising: Fallback | None = None

    def plan(self) -> Plan | None:
        """Return the first certified plan of the fallbacks, or None; its `rescue` names the fallback."""
        with within_time(RESCUE_WORK, work):
            found = self._first(self._fallbacks(), self._none_found)
        if found is None and self.promising is not None:
            promising = chain(self._faster_through_gates(), [self.promising])
            with within_time(PROMISING_WORK, work):
                return self._first(promising, self._none_found)
        if found is None or found.keeps(self.requested.reserve):
            return found
        with within_time(SHORTENING_WORK, work):
            reserve = KEPT_PART * self.requested.reserve
            half = [
                Fallback(replace(self.requested, reserve=reserve, rescue=False), HALF_RESERVE),
                Fallback(planner_with_reserve(FREE_KNOTS, reserve), f"by {FREE_KNOTS} {HALF_RESERVE}"),
            ]
            longest = LONGER_FOR_RESERVE * _priced(found)
            return self._first(iter(half), self._none_found, longest) or found

    @property
    def _none_found(self) -> str:
        return f"miqp found none with {self._intervals} intervals"

    @property
    def _intervals(self) -> int:
        """The number of intervals of the requested planner."""
        return int(self.requested.intervals_for(self._stages))

    @property
    def _stages(self) -> StageSequence:
        return self.problem.stages(self.vehicle.max_specific_thrust)

    def shortened(self, plan: Plan) -> Plan:
        """Return the plan, or where it is poor a faster plan by a fallback, which its `rescue` names."""
        fault = self._fault(plan)
        if not fault:
            return plan
        cls: Any = planner_class(FREE_KNOTS)
        others = cls(reserve=self.requested.reserve, clearance=self.requested.clearance)
        more = self._with_more_intervals()
        said = f"the path of miqp with {self._intervals} intervals {fault}"
        longest = _priced(plan) if plan.certified else inf
        fallbacks = chain([Fallback(others, f"by {FREE_KNOTS}")], more)
        with within_time(SHORTENING_WORK, work):
            faster = None if plan.certified else self._first(self._faster_through_gates(), said)
            return faster or self._much_shorter(fallbacks, said, longest) or plan

    def _much_shorter(self, fallbacks: Iterator[Fallback], failed: str, known: float) -> Plan | None:
        """Return the first plan much shorter than a known one, or the shortest if none is; None if none is.

        Args:
            fallbacks: The planners to try.
            failed: Why fallbacks are tried.
            known: The priced duration of the known plan [s]; infinite for a plan that is not certified.
        """
        best, shortest = None, known
        while best is None or shortest > MUCH_SHORTER * known:
            found = self._first(fallbacks, failed, shortest)
            if found is None:
                break
            best, shortest = found, _priced(found)
        return best

    def _fault(self, plan: Plan) -> str:
        """Return what makes a plan poor, in words; nothing for a good one."""
        # attempts of programs have a dt; attempts at paths have a cost if the path is nearly feasible
        paths = [made for made in self.recorder.attempts if made.dt is None and made.cost is not None]
        fastest = min((path.duration for path in paths), default=inf)
        if not plan.certified:
            return "was not certified"
        if plan.duration <= INSTANT:
            return ""
        if plan.bound is not None:
            return "was the program's own, not refined"
        if plan.duration > SLOW_FACTOR * fastest:
            return "was slower than one that nearly held"
        found = plan.assessment
        if found is None:
            return ""
        if found.goes_astray:
            return "went astray"
        if found.extra_turns > 0:
            return "turned over more often than asked"
        is_timed = any(stage.at != "free" for stage in self._stages.stages)
        is_long = found.suspicious and (is_timed or found.ratio > LONG)
        return "took suspiciously long" if is_long else ""

    def __str__(self) -> str:
        """The fallbacks that found no plan, as a part of a sentence."""
        said = ["not proven"]
        if self.failed:
            said.append(f"but none was found {', '.join(self.failed)}")
        unanswered = [how for how in dict.fromkeys(self.unanswered) if how not in self.failed]
        if unanswered:
            allowed = RESCUE_WORK + (0.0 if self.promising is None else PROMISING_WORK)
            said.append(f"{allowed:g} s of work were too few to plan {', '.join(unanswered)}")
        return ", ".join(said)

    def _first(self, fallbacks: Iterator[Fallback], failed: str, shorter_than: float = inf) -> Plan | None:
        """Return the first certified plan of several planners that is short enough, or None.

        Args:
            fallbacks: The planners to try.
            failed: Why fallbacks are tried, which the plan's `rescue` repeats.
            shorter_than: Upper bound of the plan's priced duration (`priced_duration`) [s].
        """
        for each in fallbacks:
            with within_share(FALLBACK_FRACTION):
                plan = self._planned(each)
            kept = min(self.requested.reserve, getattr(each.planner, "reserve", self.requested.reserve))
            if plan is not None and plan.keeps(kept) and _priced(plan) < shorter_than:
                attempts = (*self.recorder.attempts, *plan.attempts)
                return replace(plan, attempts=attempts, rescue=f"{failed}; planned {each.how}")
        return None

    def _planned(self, fallback: Fallback) -> Plan | None:
        """Return the plan of one fallback; None where there is none, which is noted in this object."""
        planner, how, stricter = fallback
        if out_of_time():
            self.unanswered.append(how)
            return None
        try:
            found = planner.plan(stricter or self.problem, self.vehicle, self.recorder.progress)
            return found if stricter is None else replace(found, problem=self.problem)
        except Infeasible as refusal:
            (self.unanswered if out_of_time() else self.failed).append(how)
            if any(each.dt is None and each.cost is not None for each in refusal.attempts):
                if isinstance(planner, planner_class(TIME_OPTIMAL)):
                    self.promising = self._time_optimal_from_all()
                elif out_of_time() and self.promising is None:
                    self.promising = fallback
        except SpecError:
            pass  # the planner does not take such problems
        return None

    def _fallbacks(self) -> Iterator[Fallback]:
        """Yield fallbacks, the most promising first.

        Where programs have solutions that the vehicle cannot fly, time-optimal comes first. Where programs
        have no solution, more intervals come first.
        """
        if self.requested.reserve == FLYING_RESERVE:  # the default, which is given up where no plan keeps it
            yield Fallback(replace(self.requested, reserve=0.0, rescue=False), "without a reserve")
        more = self._with_more_intervals()
        if any(attempt.cost is not None for attempt in self.recorder.attempts):
            yield self._time_optimal_from_all(starts=FEW_STARTS)
            yield from more
        else:
            yield from more
            yield Fallback(self._time_optimal(None, starts=FEW_STARTS), f"by {TIME_OPTIMAL}")
        if self.problem.maneuver.through_points:
            yield Fallback(planner_with_reserve("min-snap", self.requested.reserve), "by min-snap")
        yield Fallback(planner_with_reserve(FREE_KNOTS, self.requested.reserve), f"by {FREE_KNOTS}")

    def _with_more_intervals(self) -> Iterator[Fallback]:
        """Yield the requested planner with more intervals."""
        for planner in self.requested.with_more_intervals(self.problem, self.vehicle):
            yield Fallback(planner, f"with {planner.intervals} intervals")

    def _time_optimal_from_all(self, **settings: int) -> Fallback:
        """Return time-optimal, started from the path without a vehicle too."""
        return Fallback(self._time_optimal(self._path_without_rotors(), **settings), f"by {TIME_OPTIMAL}")

    def _time_optimal(self, start: Plan | None, **settings: int) -> Planner:
        """Return time-optimal with the requested reserve, zero included: a refusal comes soonest so."""
        cls: Any = planner_class(TIME_OPTIMAL)
        guess = replace(self.requested, rescue=False)
        return cast(Planner, cls(reserve=self.requested.reserve, guess=guess, start=start, **settings))

    def _path_without_rotors(self) -> Plan | None:
        """Return the MIQP's plan without a vehicle, or None."""
        try:
            return cast(Plan, replace(self.requested, rescue=False).plan(self.problem))
        except Infeasible:
            return None

    def _faster_through_gates(self) -> Iterator[Fallback]:
        """Yield the requested planner, asked to pass gates FASTER times as fast as the problem asks.

        A body that turns leaves a low gate's frame sooner so.
        """
        maneuver: Any = self.problem.maneuver
        if self.problem.gates and hasattr(maneuver, "passage"):
            speed = FASTER * max(maneuver.passage.speed, MIN_CROSSING_SPEED)
            stricter = replace(maneuver, passage=replace(maneuver.passage, speed=speed))
            planner = replace(self.requested, rescue=False)
            yield Fallback(planner, "faster through its gates", replace(self.problem, maneuver=stricter))


def _priced(plan: Plan) -> float:
    """Return the duration of a vehicle's plan [s], increased for each turn that its stages do not ask."""
    assert plan.evidence is not None
    return priced_duration(plan.trajectory, plan.evidence.task.stages, plan.evidence.task.balance)
