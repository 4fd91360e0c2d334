"""The fastest motion that rotors can do: the paper's reference [1] approach, the yardstick for refined plans.

Full nonlinear dynamics (eqs. (3) and (4)) with limits on every rotor, through a maneuver's stages in their
order, each phase between them of free duration. The body never spins about its thrust axis, as flatness and
the controller have it, so that the trajectory is flown as it was planned.

The program has many local optima. It is solved from several starts on a coarse mesh, the best of them on a
fine one, and the fastest that is certified is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from aerobat.errors import Infeasible, Reason, SpecError, limits_of
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.planners import Planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import Plan
from aerobat.planning.time_limit import stopped, too_short
from aerobat.planning.warm_start import flown_task
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle
from collocation.collocated_program import SolvedMotion
from collocation.nonlinear import import_casadi
from collocation.optimal_control.collocation import BOUNDED_DERIVATIVES
from collocation.race import Race, with_smoother
from collocation.starts import starts

SMOOTHING_LAG = 0.005  # [s] that rotors without lag are given, where thrusts that jump lead nowhere


@dataclass(frozen=True)
class Collocation(Planner):
    """The full nonlinear dynamics at the rotors' limits; needs CasADi.

    So many `intervals` in all are allocated to the phases; a course of many stages has 20 a leg at least. Of
    several `starts` on a coarse mesh, from the plans of `guess` and of closed forms at several paces, the
    best are solved finely, and the fastest that is certified is returned; `Plan.starts` has the durations of
    all. A course begins at the closed form through its stages, and elsewhere only where that leads nowhere. A
    `start`, a plan of whichever planner, comes first. Each limit is used in full, which leaves nothing for a
    controller: `reserve`, a fraction of each rotor's range of thrust, is kept from either of its ends for it.
    A `planar` plan stays in the vertical plane of its start, where that has one; in space there may be a
    faster one.
    """

    intervals: int = 60
    reserve: float = 0.0
    starts: int = 8
    planar: bool = False
    iterations: int = 500  # at most, each solve
    time_limit: float | None = None  # [s]
    guess: Miqp = field(default_factory=partial(Miqp, segments=4, flies=False))
    start: Plan | None = None

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest motion found from all starts, certified for the vehicle's limits and the problem's.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when no motion is
        found that can be certified, BackendMissing without CasADi.
        """
        task = flown_task("collocation", problem, vehicle, self.reserve)
        if np.isfinite(problem.path_limits.of(BOUNDED_DERIVATIVES)[1]).any():
            raise SpecError(
                "limits.crackle cannot be held by the collocation planner, whose moments jump; drop it"
            )
        import_casadi()
        race = Race(task, Recorder(progress), self.intervals, self.iterations)
        attempts = race.recorder.attempts
        with within_time(self.time_limit):
            begun = starts(task, self.guess, self.planar, self.starts, self.start)
            for body in with_smoother(task.vehicle, SMOOTHING_LAG):
                found = race.winner(begun.motions, body)
                own = None if found is None else _plan(race.flyable(found), race)
                if own is not None:
                    return stopped(own)
            if out_of_time():
                raise too_short(problem, self.time_limit, attempts)
        last = attempts[-1].outcome
        remedy = "ask less of its stages and limits, or give more intervals"
        if len(task.environment.pieces):
            remedy = "this planner knows no obstacles, take free-knots, which goes around them"
        sentence = (
            f"no motion of '{problem.name}' was found that {task.vehicle.name} can do: at the last attempt "
            f"{last}; {remedy}"
        )
        raise Infeasible(Reason(sentence, limits_of(last)), attempts)


def _plan(found: Judged[SolvedMotion], race: Race) -> Plan:
    """The plan of what won."""
    return found.plan(
        race.recorder,
        planner="collocation",
        order=4,
        status="locally optimal",
        backend="ipopt",
        stages=found.solution.source.placed,
        starts=race.durations,
    )
