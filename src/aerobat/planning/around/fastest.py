"""The fastest certified path around obstacles: refined roughly along every route, the best of them finely."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.around.guesses import guesses
from aerobat.planning.certified_solve import Judged
from aerobat.planning.refinement.refine import MAX_SEGMENTS, RefinedPath, Refinement

TRIED = 2  # paths that are refined finely, where the first is not certified


@dataclass(frozen=True, eq=False)
class Around:
    """A certified path, and the refinement that it comes from, whose task says what it keeps clear."""

    refinement: Refinement
    judged: Judged[RefinedPath]


def fastest_around(refinement: Refinement, segments: int) -> Around | None:
    """Return the fastest certified path that is found along routes around obstacles; None where none is.

    Args:
        refinement: Of a task with obstacles.
        segments: Of a path, at least.
    """
    rough: list[tuple[Refinement, RefinedPath]] = []
    known = inf
    for guess in guesses(refinement.task):
        own = replace(refinement, task=guess.task)
        count = min(max(segments, guess.path.trajectory.segments), MAX_SEGMENTS)
        path = own.rough(guess.path, count, known)
        if own.is_promising(path):
            known = min(known, path.path.trajectory.duration)
            rough.append((own, path))
        if out_of_time():
            break
    rough.sort(key=lambda pair: pair[1].path.trajectory.duration)
    for own, path in rough[:TRIED]:
        judged = own.finished(path)
        if judged.feasible:
            return Around(own, judged)
        if out_of_time():
            break
    return None
