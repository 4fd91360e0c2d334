"""The room that a path leaves its body in gates: from the start, and more where its frames are not clear.

What room in a gate is, `limits.body_in_gate` says.
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
        """The findings about its body and each gate's frame."""


Found = TypeVar("Found", bound=Framed)

MAX_ATTEMPTS = 4  # at a more direct path, of one plan
BENDING = 0.4  # of the largest specific thrust: the acceleration by which a path may bend there, at first
BENDING_IN_MANEUVER = 0.25  # likewise beside a stage that does not say where it is, as a flip's
MORE_BENDING = 1.6  # times that, where the body is not clear of the frame
A_LITTLE_MORE = 1.2  # the same, where it touches the frame by no more than FRAME_CLEARANCE


def bodies_in_gates(task: Task) -> tuple[BodyInGate, ...]:
    """Return the body's room in the gates that stages cross, from the start."""
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
        in_gates: The room that the path has in gates that the stages cross.
        stages: In the order of the path.
        task: Its gates are crossed.
        frames: A finding for each stage that names a gate.
    """
    crossing = [k for k, stage in enumerate(stages) if stage.gate is not None]
    found: dict[int, BodyInGate | None] = {body.stage: body for body in in_gates}
    for k, frame in zip(crossing, frames, strict=True):
        last = found.get(k)
        if frame.verdict is Verdict.HOLDS:
            continue
        if last is None:
            found[k] = _body_in_gate(k, stages, task, BENDING_IN_MANEUVER)
        else:
            touches = frame.value >= -FRAME_CLEARANCE
            found[k] = replace(last, bending=(A_LITTLE_MORE if touches else MORE_BENDING) * last.bending)
    return tuple(body for body in found.values() if body is not None)


def cleared(found: Found, again: Callable[[Found], Found | None]) -> Found:
    """Return what was found, or the best of more direct paths where its body is not clear of gates' frames.

    Args:
        found: A certified path, its stages placed.
        again: What is found with more room in gates; None where there is nothing.
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
    """True where a body is proven clear of frames."""
    return all(frame.verdict is Verdict.HOLDS for frame in frames)


def _body_in_gate(k: int, stages: Sequence[Stage], task: Task, bending: float) -> BodyInGate | None:
    """The room in the gate that stage k crosses, in its direction; None where it crosses none.

    A gate in a wall has none: its wall is an obstacle, which the body is clear of all along.
    """
    name, problem = stages[k].gate, task.problem
    if name is None or problem.gate(name).wall is not None:
        return None
    if PlannedPassage.of(stages[k], problem.gate(name), 0.0).min_speed <= 0.0:
        return None
    reach = task.vehicle.body_radius + PASSAGE_DEPTH
    return BodyInGate(problem.gate(name), k, reach, bending * task.vehicle.max_specific_thrust)
