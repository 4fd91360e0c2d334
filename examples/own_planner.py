"""A planner of one's own, known by its name as the built-in ones are; its fields are how to plan.

On the command line: aerobat fly line --import examples/own_planner.py --planner gentle --max-rate 60
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import radians

import numpy as np

import aerobat as ab
from aerobat.planning import Attempt, Recorder


@ab.planner("gentle")
@dataclass(frozen=True)
class Gentle:
    """One polynomial from start to goal, the shortest that turns no faster than it may."""

    max_rate: float = ab.option(90.0, "The greatest body rate, degrees a second.")
    step: float = 0.1  # [s] by which longer and longer durations are tried

    def plan(
        self,
        problem: ab.Problem,
        vehicle: ab.Vehicle | None = None,
        progress: Callable[[Attempt], None] | None = None,
    ) -> ab.Plan:
        """Return the first whose certificate proves the rate, for the vehicle; or raise Infeasible."""
        if vehicle is None:
            raise ab.SpecError("the planner gentle needs a vehicle")
        envelope = ab.Envelope(body_rate=radians(self.max_rate), limits=problem.path_limits)
        ends = np.stack([problem.start.derivatives(5), problem.goal.derivatives(5)])
        recorder = Recorder(progress)
        for duration in np.arange(self.step, 20.0, self.step).tolist():
            path = ab.minimum_effort(ends, [duration], heading=problem.heading.start)
            found = ab.certify(path, vehicle, problem.environment, envelope)
            recorder.record(
                Attempt(duration, found.certified, "certified", str(found), None, 0, 0.0, None, found.margin)
            )
            if found.certified:
                return ab.Plan(problem, path, "gentle", attempts=tuple(recorder.attempts), vehicle=vehicle)
        raise ab.Infeasible("no duration up to 20 s is gentle enough; raise max_rate", recorder.attempts)


if __name__ == "__main__":
    for rate in (30.0, 120.0):
        plan = ab.plan(ab.load_problem("line"), Gentle(max_rate=rate), ab.load_vehicle("agile-quad"))
        print(
            f"{rate:.0f} °/s: {plan.duration:.1f} s after {len(plan.attempts)} attempts; {plan.certificate}"
        )
