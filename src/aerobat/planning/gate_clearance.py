"""The room for the body in gates that a path has to leave, which grows where a frame is not clear.

See `limits.body_in_gate` for the definition of room.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol, TypeVar

from aerobat.certification import Finding, Verdict
from aerobat.limits.body_in_gate import FRAME_CLEARANCE, BodyInGate
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.task import Task
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.problem.stage import Stage


class Framed(Protocol):
    """A path through gates."""

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about the body's clearance from each gate's frame."""


Found = TypeVar("Found", bound=Framed)

MAX_ATTEMPTS = 4  # largest number of more direct paths tried for one plan
# lateral acceleration of a path in a gate for which room is left at first, relative to the largest specific
# thrust
BENDING = 0.4
BENDING_IN_MANEUVER = 0.25  # the same beside a stage without position, such as a flip's
MORE_BENDING = 1.6  # factor on that acceleration where the body is not clear of the frame
A_LITTLE_MORE = 1.2  # the same where the body overlaps the frame by FRAME_CLEARANCE at most
MORE_TURNING = 1.5  # factor on the fraction of the reach at which a turning body must be clear


def bodies_in_gates(task: Task) -> tuple[BodyInGate, ...]:
    """Return the initial room for the body in the gates that stages cross."""
    found, stages = [], task.stages.stages
    for k in range(len(stages)):
        on_course = all(each.is_placed for each in stages[max(k - 1, 0) : k + 2])
        bending = BENDING if on_course else BENDING_IN_MANEUVER
        found.append(_body_in_gate(k, stages, task, bending))
    return tuple(filter(None, found))


def more_direct(
    in_gates: Sequence[BodyInGate], stages: Sequence[Stage], task: Task, frames: Sequence[Finding]
) -> tuple[BodyInGate, ...]:
    """Return more room in the gates whose frames are not clear, and room in those that had none.

    Args:
        in_gates: The present room in the gates that stages cross.
        stages: The stages, in the order of the path.
        task: The task, whose gates are crossed.
        frames: The findings about frames, one for each stage that names a gate.
    """
    crossing = [k for k, stage in enumerate(stages) if stage.gate is not None]
    found: dict[int, BodyInGate | None] = {body.stage: body for body in in_gates}
    for k, frame in zip(crossing, frames, strict=True):
        last = found.get(k)
        if frame.verdict is Verdict.HOLDS:
            continue
        if last is None:
            found[k] = _body_in_gate(k, stages, task, BENDING_IN_MANEUVER)
            continue
        touches = frame.value >= -FRAME_CLEARANCE
        acceleration = (A_LITTLE_MORE if touches else MORE_BENDING) * last.lateral_acceleration
        turning = min(MORE_TURNING * last.turning, 1.0)
        found[k] = replace(last, lateral_acceleration=acceleration, turning=turning)
    return tuple(body for body in found.values() if body is not None)


def cleared(found: Found, again: Callable[[Found], Found | None]) -> Found:
    """Return a path, or the best of more direct paths where its body is not clear of gates' frames.

    Args:
        found: A certified path, its stages placed.
        again: A function that returns the path with more room in gates, or None where there is none.
    """
    best = latest = found
    for _ in range(MAX_ATTEMPTS):
        following = None if is_clear(latest.frames) or out_of_time() else again(latest)
        if following is None:
            break
        latest = following
        best = max(best, latest, key=lambda each: min(frame.bound for frame in each.frames))
    return best


def is_clear(frames: Sequence[Finding]) -> bool:
    """Return whether the body is proven clear of all frames."""
    return all(frame.verdict is Verdict.HOLDS for frame in frames)


def _body_in_gate(k: int, stages: Sequence[Stage], task: Task, bending: float) -> BodyInGate | None:
    """Return the room in the gate that stage k crosses in the gate's direction; None without such a gate.

    None is also returned for a gate in a wall. The wall is an obstacle, from which clearance is kept anyway.
    """
    name, problem = stages[k].gate, task.problem
    if name is None or problem.gate(name).wall is not None:
        return None
    if PlannedPassage.of(stages[k], problem.gate(name), 0.0).min_speed <= 0.0:
        return None
    reach = task.vehicle.body_radius + PASSAGE_DEPTH
    return BodyInGate(problem.gate(name), k, reach, bending * task.vehicle.max_specific_thrust)
