"""The start and the end of a path, compared with the required end states."""

from __future__ import annotations

from typing import Literal

import numpy as np

from aerobat.certification.certificate import Finding, Side, Verdict
from aerobat.problem import EndState
from aerobat.problem.limits import DERIVATIVES, UNITS
from aerobat.trajectory import Trajectory

# [m, m/s, m/s²] accepted error of an end state: ten times the accumulated error of solvers
END_TOLERANCES = (1e-5, 1e-5, 1e-4)


def end_findings(trajectory: Trajectory, start: EndState | None, goal: EndState | None) -> list[Finding]:
    """Return the error of each derivative that the start and goal fix; nothing for an end that is None."""
    found = [] if start is None else _findings(trajectory, "start", start, 0.0)
    return found if goal is None else found + _findings(trajectory, "goal", goal, trajectory.duration)


def _findings(
    trajectory: Trajectory, end: Literal["start", "goal"], state: EndState, time: float
) -> list[Finding]:
    found = []
    for derivative in state.asked.tolist():
        reached = trajectory.evaluate(time, derivative)
        error = float(np.linalg.norm(reached - state.derivatives(3)[derivative]))
        verdict = Verdict.HOLDS if error <= END_TOLERANCES[derivative] else Verdict.VIOLATED
        quantity, unit = f"{DERIVATIVES[derivative]} error", UNITS[derivative]
        found.append(Finding(quantity, unit, Side.MAX, error, error, time, 0.0, verdict, end=end))
    return found
