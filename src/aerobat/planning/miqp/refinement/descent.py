"""From a start to a path within all constraints: descents, and what settles the rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.prox_linear import prox_linear
from aerobat.planning.miqp.refinement.path_program import PathPoint, PathProgram

DENSE_PARTS = 16  # at whose ends they are looked at afterwards
SECOND_STEPS = 20  # of another, once backed off
ROUNDS = 8  # of settling, at most
MENDABLE = 2e-3  # of a constraint's range: an excess that settling mends
MAX_STEPS = 30  # of a descent
FEW_STEPS = 20  # in which a descent converges that others from the same slots end beside
TOLERATED = 1e-4  # of a constraint's range: what a descent may leave to settling
SETTLING_STRETCH = 3e-4  # of the mean interval: leaves room for meeting all constraints exactly
SETTLING_STEPS = 8  # at most


@dataclass(frozen=True, eq=False)
class Descent:
    """Where a descent ended."""

    path: PathPoint | None  # its end, or the last within all constraints, if it ends far from that
    direct: bool  # it converged in few steps


def descent(program: PathProgram, start: Array, max_steps: int = MAX_STEPS) -> Descent:
    """Descend from a start to a local optimum, or as near as the steps lead.

    Args:
        program: What is sought.
        start: The variables to begin with.
        max_steps: Of the descent, at most.
    """
    point = program.at(start)
    if point is None:
        return Descent(None, False)
    found = prox_linear(program, point, max_steps, TOLERATED, gives_up=True)
    path = found.feasible if found.point.violation > MENDABLE else found.point
    return Descent(path, found.converged and found.steps <= FEW_STEPS)


def on_equal_intervals(point: PathPoint) -> PathPoint | None:
    """A path of the same duration and equal intervals, within all constraints; None where that fails."""
    inputs = 3 * point.program.chain.intervals
    program = replace(point.program, equal=True, held=True)
    found = descent(program, np.concatenate([point.x[:inputs], [1.0, point.x[-1]]])).path
    if found is None:
        return None
    return PathPoint(point.program, np.concatenate([found.x[:inputs], point.x[inputs:]]))


def finished(point: PathPoint) -> PathPoint | None:
    """What a descent ended at, within all constraints between places too; None where that fails.

    Once more down, backed off from what is exceeded between places; what is then left takes a trifle of time.
    """
    backed_off = point.program.backed_off(point.excess(DENSE_PARTS))
    return settled(descent(backed_off, point.x, SECOND_STEPS).path or point)


def settled(point: PathPoint) -> PathPoint | None:
    """The path flown a trifle slower, within all constraints; None where that is not enough."""
    stretch = 0.0
    for _ in range(ROUNDS):
        excess = point.excess(DENSE_PARTS)
        if point.violation <= 0.0 and not excess.any():
            return point
        held = point.program.held
        program = replace(point.program.backed_off(excess), held=True)
        x = point.x.copy()
        if not held:
            stretch = max(2.0 * stretch, SETTLING_STRETCH)
            x[-1] += stretch
        moved = program.at(x)
        if moved is None:
            return None
        moved = prox_linear(program, moved, SETTLING_STEPS).point
        point = PathPoint(replace(program, held=held), moved.x)
    return None
