"""What a refusal advises, followed: the problem is planned, or at least not refused for the same reason."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import within_time, work
from aerobat.planning import Miqp, plan
from aerobat.problem import Gate
from aerobat.studies.why import Remedy, Request, explained
from audit_measures import Attempted, attempted
from random_problems import Case

FREES = "free their problem"
FREES_TOGETHER = "free it by several changes together"
OTHERS = "name another planner, which plans it as it is"
LIFTS = "lift what refused it at sight"
NOTHING = "say that nothing tried helps"
WRONG = "advice in vain"  # the start of what is said of advice that does not help
PATIENCE = 20.0  # [s] of the processor, for following a piece of advice
ADVICE_PATIENCE = 240.0  # work limit [s] of the advice
MORE = 1.01  # times what a refusal says is needed

SIZES = re.compile(r"gate '(.*)' is .* takes ([\d.]+) cm by ([\d.]+) cm")
THRUSTS = re.compile(r"asks ([\d.]+) m/s² .* gives ([\d.]+)")
WINDOW = "widen its `at`, or use more intervals"


def followed(case: Case, asked: Miqp, message: str) -> str:
    """What following a refusal's advice led to."""
    task = Request(case.problem, case.vehicle, asked)
    eased = _at_sight(task, message)
    if eased is not None:
        return LIFTS if _planned(eased).message != message else f"{WRONG}, the same is said again"
    with within_time(ADVICE_PATIENCE, work):
        found = explained(Infeasible(message, ["attempts"]), task)
    for remedy in found.remedies:
        made = _again(remedy)
        if made.plan is None or not made.plan.certified:
            return f"{WRONG}, {remedy}: {made.status}"
    if not found.remedies:
        return NOTHING
    most = max(len(remedy.changes) for remedy in found.remedies)
    return OTHERS if most == 0 else FREES if most == 1 else FREES_TOGETHER


def _again(remedy: Remedy) -> Attempted:
    """The problem as it was changed, planned anew by the planner that is named."""
    found = remedy.plan
    return attempted(partial(plan, found.problem, found.planner, found.vehicle), PATIENCE)


def _planned(task: Request) -> Attempted:
    return attempted(partial(plan, task.problem, task.planner, task.vehicle), PATIENCE)


def _at_sight(task: Request, message: str) -> Request | None:
    """The task after what a refusal without any attempt asks for; None for other refusals."""
    assert task.vehicle is not None
    if sizes := SIZES.search(message):
        across, upward = (MORE * float(size) / 100.0 for size in sizes.groups()[1:])
        return _with_gates(task, sizes[1], partial(replace, width=across, height=upward))
    if thrusts := THRUSTS.search(message):
        factor = MORE * float(thrusts[1]) / float(thrusts[2])
        rotors = tuple(replace(r, max_thrust=factor * r.max_thrust) for r in task.vehicle.rotors)
        return replace(task, vehicle=replace(task.vehicle, rotors=rotors))
    return replace(task, planner=Miqp(intervals=40)) if WINDOW in message else None


def _with_gates(task: Request, name: str, change: Callable[[Gate], Gate]) -> Request:
    gates = tuple(change(gate) if gate.name == name else gate for gate in task.problem.gates)
    return replace(task, problem=replace(task.problem, gates=gates))
