"""The fastest certified path around obstacles: refined roughly along every route, the best of them finely."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from math import inf

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.around.guesses import ROUTES, Guess, guesses
from aerobat.planning.certified_solve import Judged
from aerobat.planning.refinement.refine import MAX_SEGMENTS, RefinedPath, Refinement
from aerobat.planning.warm_start import WarmStart


@dataclass(frozen=True, eq=False)
class Around:
    """A certified path, and the refinement that it comes from, whose task says what it keeps clear."""

    refinement: Refinement
    judged: Judged[RefinedPath]


@dataclass(frozen=True, eq=False)
class _Rough:
    """A path along a route that further rounds may make a plan of."""

    refinement: Refinement
    path: RefinedPath

    @property
    def duration(self) -> float:
        """Of the path [s]."""
        return self.path.path.trajectory.duration


def fastest_around(refinement: Refinement, segments: int, count: int = ROUTES) -> Around | None:
    """Return the fastest certified path that is found along routes around obstacles; None where none is.

    Args:
        refinement: Of a task with obstacles.
        segments: Of a path, at least.
        count: Of the routes that are tried at once.
    """
    rough: list[_Rough] = []
    tried = _refined_roughly(refinement, segments, count)
    while batch := list(islice(tried, count)):
        rough += filter(None, batch)
        rough.sort(key=lambda each: each.duration)
        while rough and not out_of_time():
            best = rough.pop(0)
            judged = best.refinement.finished(best.path)
            if judged.feasible:
                return Around(best.refinement, judged)
    return None


def _refined_roughly(refinement: Refinement, segments: int, routes: int) -> Iterator[_Rough | None]:
    """Yield the rough path of every guess, None where it is lost or far behind one before."""
    shortest = inf
    for guess in guesses(refinement.task, routes):
        own = replace(refinement, task=guess.task)
        count = min(max(segments, guess.path.trajectory.segments), MAX_SEGMENTS)
        path = own.rough(_begun(refinement, guess, count), count, shortest)
        found = _Rough(own, path) if own.is_promising(path) else None
        shortest = min(shortest, inf if found is None else found.duration)
        yield found


def _begun(refinement: Refinement, guess: Guess, segments: int) -> WarmStart:
    """The path of a guess, refined to pass walls on its side where it has to."""
    if guess.turned is None:
        return guess.path
    begun = replace(guess.path, stages=guess.turned.stages.stages)
    turned = Refinement.of(guess.turned, refinement.recorder, refinement.still_ends)
    return replace(turned.rough(begun, segments).path, stages=guess.path.stages)
