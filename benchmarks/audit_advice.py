"""What a refusal advises, followed: the problem is planned, or at least not refused for the same reason."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial, reduce

from aerobat.planning import Miqp, plan
from aerobat.planning.miqp.remedies import Change, Task, changes
from aerobat.problem import Gate
from audit_measures import Attempted, attempted
from random_problems import Case

FREES = "free their problem"
FREES_TOGETHER = "free it by several changes together"
LIFTS = "lift what refused it at sight"
NOTHING = "say that nothing tried helps"
WRONG = "advice in vain"  # the start of what is said of advice that does not help
PATIENCE = 20.0  # [s] of the processor, for following a piece of advice
TOGETHER = "nor with one change alone"
NONE = "find none, nor "
MORE = 1.01  # times what a refusal says is needed

SIZES = re.compile(r"gate '(.*)' is .* takes ([\d.]+) cm by ([\d.]+) cm")
THRUSTS = re.compile(r"asks ([\d.]+) m/s² .* gives ([\d.]+)")
WINDOW = "widen its `at`, or use more intervals"


def followed(case: Case, asked: Miqp, message: str) -> str:
    """What following a refusal's advice led to."""
    task = Task(asked, case.problem, case.vehicle)
    eased = _at_sight(task, message)
    if eased is not None:
        return LIFTS if _planned(eased).message != message else f"{WRONG}, the same is said again"
    said = message.rpartition("; it is planned ")
    if not said[1]:
        return NOTHING if NONE in message else f"{WRONG}, there is none"
    named = [change for change in changes(task) if change.words in said[2]]
    together = TOGETHER in said[0]
    for alternative in [named] if together else [[change] for change in named]:
        made = _planned(reduce(_after, alternative, task))
        if made.plan is None or not made.plan.certified:
            words = " and ".join(change.words for change in alternative)
            return f"{WRONG}, {words}: {made.status}"
    return FREES_TOGETHER if together else FREES


def _after(task: Task, change: Change) -> Task:
    return change.apply(task)


def _planned(task: Task) -> Attempted:
    return attempted(partial(plan, task.problem, task.planner, task.vehicle), PATIENCE)


def _at_sight(task: Task, message: str) -> Task | None:
    """The task after what a refusal without any attempt asks for; None for other refusals."""
    if sizes := SIZES.search(message):
        across, upward = (MORE * float(size) / 100.0 for size in sizes.groups()[1:])
        return _with_gates(task, sizes[1], partial(replace, width=across, height=upward))
    if thrusts := THRUSTS.search(message):
        factor = MORE * float(thrusts[1]) / float(thrusts[2])
        rotors = tuple(replace(r, max_thrust=factor * r.max_thrust) for r in task.vehicle.rotors)
        return replace(task, vehicle=replace(task.vehicle, rotors=rotors))
    return replace(task, planner=replace(task.planner, intervals=40)) if WINDOW in message else None


def _with_gates(task: Task, name: str, change: Callable[[Gate], Gate]) -> Task:
    gates = tuple(change(gate) if gate.name == name else gate for gate in task.problem.gates)
    return replace(task, problem=replace(task.problem, gates=gates))
