"""The room that a path leaves its body in gates: from the start, and more once a flight hits them.

What room in a gate is, `limits.body_in_gate` says.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from aerobat.certification import PlannedPassage
from aerobat.limits.body_in_gate import FRAME_CLEARANCE, BodyInGate
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.flyability import FLYABLE_ERROR, OwnFlight
from aerobat.planning.task import Task
from aerobat.problem.stage import Stage
from aerobat.simulation.passages import PASSAGE_DEPTH

Found = TypeVar("Found")

MAX_ATTEMPTS = 4  # at a more direct path, of one plan
BENDING = 0.4  # of the largest specific thrust: the acceleration by which a path may bend there, at first
BENDING_IN_MANEUVER = 0.25  # likewise beside a stage that does not say where it is, as a flip's
MORE_BENDING = 1.6  # times that, where the plan's own flight does not pass
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
    in_gates: Sequence[BodyInGate], stages: Sequence[Stage], task: Task, flight: OwnFlight
) -> tuple[BodyInGate, ...]:
    """Return more room in the gates that a flight did not pass, and room in those that had none.

    Args:
        in_gates: The room that the flown path has in gates that the stages cross.
        stages: In the order of the path.
        task: Its gates are crossed.
        flight: With a passage for each stage that names a gate.
    """
    crossing = [k for k, stage in enumerate(stages) if stage.gate is not None]
    missed = {k: flown for k, flown in zip(crossing, flight.passages, strict=True) if flown.is_missed}
    found: dict[int, BodyInGate | None] = {body.stage: body for body in in_gates}
    for k, flown in missed.items():
        last = found.get(k)
        if last is None:
            found[k] = _body_in_gate(k, stages, task, BENDING_IN_MANEUVER)
        else:
            touches = flown.clearance is not None and flown.clearance >= -FRAME_CLEARANCE
            found[k] = replace(last, bending=(A_LITTLE_MORE if touches else MORE_BENDING) * last.bending)
    return tuple(body for body in found.values() if body is not None)


def cleared(
    found: Found,
    flown: Callable[[Found], OwnFlight],
    again: Callable[[Found, OwnFlight], Found | None],
) -> tuple[OwnFlight, Found]:
    """Return the best of what was found and of more direct paths through gates that its flight does not pass.

    With its flight. Only where that keeps to its path: else it is not the path that misses them.

    Args:
        found: What flies.
        flown: Its own flight.
        again: What is found with more room in gates than in a flight; None where there is nothing.
    """
    best = flight, _ = flown(found), found
    for _ in range(MAX_ATTEMPTS):
        if not (flight.lingers and flight.error <= FLYABLE_ERROR) or out_of_time():
            break
        following = again(found, flight)
        if following is None:
            break
        flight, found = flown(following), following
        best = min(best, (flight, found), key=lambda pair: pair[0].rank)
    return best


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
