"""The fastest certified path around obstacles: refined roughly along every route, the best of them finely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.around.guesses import ROUTES, Guess, guesses
from aerobat.planning.certified_solve import Judged
from aerobat.planning.refinement.refine import MAX_SEGMENTS, RefinedPath, Refinement
from aerobat.planning.warm_start import WarmStart

LONGEST = 0.5  # [s] of a guess's segment: with longer ones 100 m past trunks lose their way


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
        count: Of the routes, at most.
    """
    for batch in guesses(refinement.task, count):
        for found in sorted(_refined_roughly(refinement, segments, batch), key=lambda each: each.duration):
            judged = found.refinement.finished(found.path)
            if judged.feasible:
                return Around(found.refinement, judged)
        if out_of_time():
            break
    return None


def _refined_roughly(refinement: Refinement, segments: int, batch: Sequence[Guess]) -> Iterator[_Rough]:
    """Yield the rough paths of guesses, without those that are lost or far behind one before."""
    shortest = inf
    for guess in batch:
        own = replace(refinement, task=guess.task)
        begun = guess.path.trajectory
        count = min(max(segments, begun.segments, ceil(begun.duration / LONGEST)), MAX_SEGMENTS)
        path = own.rough(_begun(refinement, guess, count), count, shortest)
        if own.is_promising(path):
            yield _Rough(own, path)
            shortest = min(shortest, path.path.trajectory.duration)
        if out_of_time():
            return


def _begun(refinement: Refinement, guess: Guess, segments: int) -> WarmStart:
    """The path of a guess, refined to pass walls on its side where it has to."""
    if guess.turned is None:
        return guess.path
    begun = replace(guess.path, stages=guess.turned.stages.stages)
    turned = Refinement.of(guess.turned, refinement.recorder, refinement.still_ends)
    return replace(turned.rough(begun, segments).path, stages=guess.path.stages)
