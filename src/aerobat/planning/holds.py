"""Problems with stages at which the vehicle holds still: the parts between holds are planned separately.

At rest only position and heading pass from one part to the next. So the parts do not depend on each other
otherwise, and planners need not know holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any, TypeVar

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import AS_IT_IS, declared
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.optimization.deadline import within_time
from aerobat.planning.passages import PlacedStage, place_stages
from aerobat.planning.recorder import Progress
from aerobat.planning.result import Plan, PlanMethod
from aerobat.problem import Gate, Heading, Maneuver, Problem, Stage, StageSequence, at_rest
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

P = TypeVar("P")


def between_holds(
    method: PlanMethod[P], planner: P, problem: Problem, vehicle: Vehicle | None, progress: Progress | None
) -> Plan:
    """Return a problem's plan by a planner's method, which plans the parts between holds one by one."""
    if not any(stage.hold for stage in problem.stages(1.0).stages):
        return method(planner, problem, vehicle, progress)
    of_part = _without_start(planner)
    found: list[Plan | Stage] = []
    heading = problem.heading.start
    with within_time(getattr(planner, "time_limit", None)):
        for part in _parts(problem):
            if isinstance(part, Stage):
                found.append(part)
                continue
            each = method(of_part, replace(part, heading=Heading(heading)), vehicle, progress)
            found.append(each)
            heading = heading if vehicle is None else _heading_at_end(each, vehicle)
    joined = _joined(problem, found)
    return joined if vehicle is None else joined.for_vehicle(vehicle)


def _without_start(planner: P) -> P:
    """Return the planner without its start, which is a plan of the whole problem."""
    changed: Any = planner
    return replace(changed, start=None) if getattr(changed, "start", None) is not None else planner


@declared
class Part(Maneuver):
    """A maneuver of some consecutive stages of another maneuver."""

    whole: Annotated[Maneuver, AS_IT_IS]
    first: int  # stage, counted from 0
    end: int  # behind the last

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return these stages, with the conditions along the path."""
        sequence = self.whole.stage_sequence(gates, max_specific_thrust)
        return replace(sequence, stages=sequence.stages[self.first : self.end])

    @property
    def through_points(self) -> bool:
        """True if the whole maneuver goes through points."""
        return self.whole.through_points


def _parts(problem: Problem) -> Iterator[Problem | Stage]:
    """Yield the problems between holds, and the stages of the holds, in order.

    No problem is yielded between equal positions without stages between.
    """
    sequence = problem.stages(1.0)
    if not sequence.ordered:
        raise SpecError("maneuver.ordered: stages in any order cannot hold; order them")
    begin, first, name = problem.start, 0, f"{problem.name} part"
    rests = [i for i, stage in enumerate(sequence.stages) if stage.hold]
    for number, i in enumerate([*rests, len(sequence.stages)], 1):
        is_last = i == len(sequence.stages)
        end = problem.goal if is_last else at_rest(sequence.stages[i].place)
        if i > first or begin != end:
            part = Part(problem.maneuver, first, i)
            yield replace(problem, name=f"{name} {number}", start=begin, goal=end, maneuver=part)
        if not is_last:
            yield sequence.stages[i]
        begin, first = end, i + 1


def _heading_at_end(plan: Plan, vehicle: Vehicle) -> float:
    """Return the heading [rad] at a plan's end, of a body that never rotates about its thrust axis."""
    end = reference(plan.trajectory, vehicle, [plan.duration], environment=plan.problem.environment)
    q_world_body = end.setpoint.q_world_body[-1]
    tilt = so3.smallest_rotation(so3.UP, so3.thrust_axis(q_world_body))
    return float(so3.twist(tilt, q_world_body))


def _joined(problem: Problem, found: Sequence[Plan | Stage]) -> Plan:
    """Return the plan that joins the plans, with the holds between them."""
    plans = [each for each in found if isinstance(each, Plan)]
    if not plans:
        raise SpecError("maneuver: nothing moves between the rests; move the goal, or plan something else")
    degree = max(plan.trajectory.degree for plan in plans)
    pieces: list[tuple[Array, Array]] = []
    stages: list[PlacedStage] = []
    time, segments = 0.0, 0
    for each in found:
        if isinstance(each, Stage):
            pieces.append((np.array([each.hold]), _padded(np.reshape(each.place, (1, 1, 3)), degree)))
            stages += place_stages((each,), (max(segments - 1, 0),), (time,))
        else:
            trajectory = each.trajectory
            pieces.append((trajectory.durations, _padded(trajectory.coefficients, degree)))
            stages += [replace(s, interval=s.interval + segments, time=s.time + time) for s in each.stages]
        time += float(pieces[-1][0].sum())
        segments += len(pieces[-1][0])
    durations, coefficients = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    statuses = {plan.status for plan in plans}
    same = statuses.pop() if len(statuses) == 1 else "feasible"
    return Plan(
        problem,
        Trajectory(durations, coefficients, problem.heading.start),
        plans[0].planner,
        order=plans[0].order,
        status="time_limit" if "time_limit" in statuses else same,
        backend=plans[0].backend,
        stages=tuple(stages),
        attempts=tuple(attempt for plan in plans for attempt in plan.attempts),
        rescue="; ".join(filter(None, dict.fromkeys(plan.rescue for plan in plans))),
    )


def _padded(coefficients: Array, degree: int) -> Array:
    """Return coefficients (S, any, 3) padded with zeros to a degree."""
    return np.pad(coefficients, ((0, 0), (0, degree + 1 - coefficients.shape[1]), (0, 0)))
