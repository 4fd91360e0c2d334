"""Other ways to a plan where the intervals and the order asked for find none, or a poor one.

A problem is not refused before other settings and planners are asked, within RESCUE_TIME.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain
from math import inf
from typing import Any, cast

from aerobat.errors import Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, processor, within_share, within_time
from aerobat.planning.miqp.attempts import default_order
from aerobat.planning.miqp.integrator import INPUT_NAMES, MAX_INTERVALS
from aerobat.planning.planners import Planner, planner_class, planner_with_reserve
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.planning.turns import priced_duration
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.vehicle import Vehicle

MORE_INTERVALS = (1.3, 2.0)  # times as many
A_STAGE = 2  # intervals at least: fewer leave the path of a course no choice
MANY_INTERVALS = 40  # where that is more still: a narrow window at an end needs intervals on either side
# [s] of the processor for all other ways together, so that refusals take 5 s (benchmarks/audit.py)
RESCUE_TIME = 4.0
# [s] of the processor where there most likely is a plan, for a path was found that nearly holds
PROMISING_TIME = 15.0
ONE_WAY = 0.75  # of the time that is left, for one way, so that the next has some
# times the duration of a path that nearly held: of 300 random problems' plans those far from the best
POOR = 1.1
FREE_KNOTS = "free-knots"  # the planner that begins at other paths too, quickly
MOTION = "time-optimal"  # the planner that begins at the most paths
MOTIONS = 2  # that time-optimal starts from: further ones make motions faster, but seldom find the first,
ALL_MOTIONS = 8  # which is worth its time only where there most likely is one


@dataclass
class Rescue:
    """The search for a plan by other ways than one that found none."""

    asked: Any  # a Miqp, whose own module asks this one
    problem: Problem
    vehicle: Vehicle
    recorder: Recorder  # whose attempts come first; those that follow are passed on to its `progress`
    failed: list[str] = field(default_factory=list)  # ways that find none
    unanswered: list[str] = field(default_factory=list)  # ways for which there was too little time
    is_promising: bool = False  # whether a path was found that nearly holds, and no time was left for more

    def plan(self) -> Plan | None:
        """The first certified plan that another way finds, which says so; None where all fail."""
        with within_time(RESCUE_TIME, processor):
            found = self._first(self._ways(), self._none_found)
        if found is None and self.is_promising:
            with within_time(PROMISING_TIME, processor):
                found = self._first(iter([self._motion_from_all(ALL_MOTIONS)]), self._none_found)
        if found is None or found.keeps(self.asked.reserve):
            return found
        with within_time(RESCUE_TIME, processor):
            return self._with_reserve(found)

    @property
    def _none_found(self) -> str:
        return f"miqp found none with {self._intervals} intervals"

    @property
    def _intervals(self) -> int:
        """The number of intervals of the plan that was sought."""
        return int(self.asked.intervals_for(self._stages))

    @property
    def _stages(self) -> StageSequence:
        return self.problem.stages(self.vehicle.max_specific_thrust)

    def shortened(self, plan: Plan) -> Plan:
        """The plan, or where it is poor a better one by another way, which says so.

        It is poor where it is not certified, a program's own answer, far from all that is asked, or turns
        over more often than that. It is so where paths that nearly held are faster, and where stages have
        windows and it is suspiciously long.
        """
        # programs have a dt; of paths those that nearly hold have a cost
        paths = [made for made in self.recorder.attempts if made.dt is None and made.cost is not None]
        fastest = min((path.duration for path in paths), default=inf)
        is_fast = plan.certified and plan.bound is None and plan.duration <= POOR * fastest
        if is_fast and not self._looks_poor(plan):
            return plan
        cls: Any = planner_class(FREE_KNOTS)
        others = cls(reserve=self.asked.reserve, clearance=self.asked.clearance)
        more = with_more_intervals(self.asked, self.problem, self.vehicle)
        said = f"no fast path of miqp with {self._intervals} intervals settled"
        longest = _priced(plan) if plan.certified else inf
        with within_time(PROMISING_TIME, processor):
            return self._first(chain([(others, f"by {FREE_KNOTS}")], more), said, longest) or plan

    def _looks_poor(self, plan: Plan) -> bool:
        """True of a plan that goes astray, turns over too often, or is suspiciously long through windows."""
        found, is_timed = plan.assessment, any(stage.at != "free" for stage in self._stages.stages)
        if found is None:
            return False
        return found.goes_astray or found.extra_turns > 0 or (is_timed and found.suspicious)

    def __str__(self) -> str:
        """The ways that were tried in vain, in a part of a sentence."""
        said = ["not proven"]
        if self.failed:
            said.append(f"but none was found {', '.join(self.failed)}")
        unanswered = [how for how in self.unanswered if how not in self.failed]
        if unanswered:
            said.append(f"{RESCUE_TIME:g} s were too few to plan {', '.join(unanswered)}")
        return ", ".join(said)

    def _first(
        self,
        ways: Iterator[tuple[Planner, str]],
        failed: str,
        shorter_than: float = inf,
    ) -> Plan | None:
        """The first certified plan of several ways, which says what failed; None where none is short enough.

        Args:
            ways: Planners, and how they plan in words.
            failed: Why they are asked.
            shorter_than: The duration, turns priced, that a plan must fall short of [s].
        """
        for planner, how in ways:
            with within_share(ONE_WAY):
                plan = self._planned(planner, how)
            kept = min(self.asked.reserve, getattr(planner, "reserve", self.asked.reserve))
            if plan is not None and plan.keeps(kept) and _priced(plan) < shorter_than:
                attempts = (*self.recorder.attempts, *plan.attempts)
                return replace(plan, attempts=attempts, rescue=f"{failed}; planned {how}")
        return None

    def _planned(self, planner: Planner, how: str) -> Plan | None:
        """The plan of one way; None where there is none, which is noted."""
        if out_of_time():
            self.unanswered.append(how)
            return None
        try:
            return planner.plan(self.problem, self.vehicle, self.recorder.progress)
        except Infeasible as refusal:
            (self.unanswered if out_of_time() else self.failed).append(how)
            is_motion = isinstance(planner, planner_class(MOTION))
            self.is_promising |= is_motion and any(each.cost is not None for each in refusal.attempts)
        except SpecError:
            pass  # the planner does not take such problems
        return None

    def _ways(self) -> Iterator[tuple[Planner, str]]:
        """Planners, and how they plan in words, the likeliest first.

        Where programs have solutions, but none that the vehicle can fly, that is a motion of the rigid body;
        where they have none, more intervals.
        """
        if self.asked.reserve == FLYING_RESERVE:  # is kept where it can be
            yield replace(self.asked, reserve=0.0, rescue=False), "without a reserve"
        more = with_more_intervals(self.asked, self.problem, self.vehicle)
        if any(attempt.cost is not None for attempt in self.recorder.attempts):
            yield self._motion_from_all(MOTIONS)
            yield from more
        else:
            yield from more
            yield self._motion(None, MOTIONS), f"by {MOTION}"
        yield from self._others()

    def _motion_from_all(self, starts: int) -> tuple[Planner, str]:
        """Time-optimal from so many starts and from the path without rotors."""
        return self._motion(self._path_without_rotors(), starts), f"by {MOTION}"

    def _motion(self, start: Plan | None, starts: int) -> Planner:
        """Time-optimal with no reserve but the one that is asked: that tells soonest of none."""
        cls: Any = planner_class(MOTION)
        guess = replace(self.asked, rescue=False)
        return cast(Planner, cls(reserve=self.asked.reserve, starts=starts, guess=guess, start=start))

    def _path_without_rotors(self) -> Plan | None:
        """The MIQP's plan for no vehicle."""
        try:
            return cast(Plan, replace(self.asked, rescue=False).plan(self.problem))
        except Infeasible:
            return None

    def _with_reserve(self, found: Plan) -> Plan:
        """A path near a plan that keeps the reserve to fly by, or the plan where there is none."""
        name = MOTION if found.planner == MOTION else FREE_KNOTS
        again = self._planned(planner_with_reserve(name, self.asked.reserve, start=found), f"by {name}")
        if again is None or not again.keeps(self.asked.reserve):
            return found
        said = found.rescue if found.planner == name else f"{self._none_found}; planned by {name}"
        return replace(again, attempts=(*found.attempts, *again.attempts), rescue=said)

    def _others(self) -> Iterator[tuple[Planner, str]]:
        """The ways that seldom find what those before them do not."""
        first = default_order(self.problem, self.vehicle)
        for order in range(first, max(INPUT_NAMES) + 1):
            if order != (self.asked.order or first):
                yield replace(self.asked, order=order, rescue=False), f"with order {order}"
        if self.asked.search is not None:
            yield replace(self.asked, search=None, rescue=False), "with intervals that differ"
        if self.problem.maneuver.through_points:
            yield planner_with_reserve("min-snap", self.asked.reserve), "by min-snap"
        yield planner_with_reserve(FREE_KNOTS, self.asked.reserve), f"by {FREE_KNOTS}"


def _priced(plan: Plan) -> float:
    """The duration of a vehicle's plan [s], longer for each turn beyond those asked."""
    assert plan.evidence is not None
    return priced_duration(plan.evidence.task, plan.trajectory)


def with_more_intervals(asked: Any, problem: Problem, vehicle: Vehicle) -> Iterator[tuple[Planner, str]]:
    """Return the planner with more intervals than were asked for, the fewest first, and how in words."""
    sequence = problem.stages(vehicle.max_specific_thrust)
    first, least = asked.intervals_for(sequence), A_STAGE * len(sequence.stages)
    more = {sequence.intervals_from(max(round(factor * first), least)) for factor in MORE_INTERVALS}
    if max(more) * MORE_INTERVALS[0] < MANY_INTERVALS:
        more.add(sequence.intervals_from(MANY_INTERVALS))
    for intervals in sorted(n for n in more if n <= MAX_INTERVALS):
        yield replace(asked, intervals=intervals, rescue=False), f"with {intervals} intervals"
