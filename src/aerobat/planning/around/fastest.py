"""The fastest certified path around obstacles: one quick round along every route, the best of them finely."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from math import ceil, inf

from aerobat.optimization.deadline import out_of_time
from aerobat.optimization.interior_point import Settings
from aerobat.planning.around.guesses import ROUTES, Guess, guesses
from aerobat.planning.refinement.flown import FlownPath
from aerobat.planning.refinement.refine import (
    MAX_SEGMENTS,
    RefinedPath,
    Refinement,
    Rounds,
    knots_at_stages,
)
from aerobat.planning.warm_start import WarmStart

QUICK_SEGMENTS = 6  # of a quick round's path: with fewer variables it goes farther, in half the time
QUICK_PLACES = 12  # of a segment
QUICK = Settings(iterations=40)
QUICK_STRETCHES = (2.0, 1.6)  # the factors by which durations may differ in it, a batch each in turn
FOLLOWED = 2  # of the paths after it, the shortest ones, at a time: which is the best it tells nearly always
LONG = 12  # segments: a way of so many is refined roughly at once, few would lose it
LONGEST = 0.5  # [s] of a guess's segment: with longer ones 100 m past trunks lose their way


@dataclass(frozen=True, eq=False)
class _Rough:
    """A path along a route that further rounds may make a plan of."""

    refinement: Refinement
    path: RefinedPath

    @property
    def duration(self) -> float:
        """Of the path [s]."""
        return self.path.path.trajectory.duration


def fastest_around(refinement: Refinement, segments: int, count: int = ROUTES) -> FlownPath | None:
    """Return the fastest certified path that is found along routes around obstacles; None where none is.

    Args:
        refinement: Of a task with obstacles.
        segments: Of a path, at least.
        count: Of the routes, at most.
    """
    for batch, stretch in zip(guesses(refinement.task, count), cycle(QUICK_STRETCHES)):
        quick = sorted(_quickly_refined(refinement, segments, batch, stretch), key=lambda each: each.duration)
        for k in range(0, len(quick), FOLLOWED):
            rough = _refined_roughly(quick[k : k + FOLLOWED], segments)
            for found in sorted(rough, key=lambda each: each.duration):
                judged = found.refinement.finished(found.path)
                if judged.feasible:
                    return FlownPath.of(found.refinement, judged)
        if out_of_time():
            break
    return None


def _quickly_refined(
    refinement: Refinement, segments: int, batch: Sequence[Guess], stretch: float
) -> Iterator[_Rough]:
    """Yield the paths of guesses after one round, without those that are lost."""
    known: dict[float, Refinement] = {}  # by what is kept clear, compiled once each
    for guess in batch:
        own = known.setdefault(guess.task.clearance, replace(refinement, task=guess.task))
        count = _segments(guess.path, segments)
        begun = _begun(refinement, guess, segments, stretch)
        path = _quick(own, begun, segments, stretch) if count < LONG else own.rough(begun, count)
        if own.is_promising(path):
            yield _Rough(own, path)
        if out_of_time():
            return


def _segments(guess: WarmStart, segments: int) -> int:
    begun = guess.trajectory
    return min(max(segments, begun.segments, ceil(begun.duration / LONGEST)), MAX_SEGMENTS)


def _quick(refinement: Refinement, guess: WarmStart, segments: int, stretch: float) -> RefinedPath:
    begun = knots_at_stages(guess, min(segments, QUICK_SEGMENTS))
    return Rounds(refinement, begun, QUICK, QUICK_PLACES, stretch=stretch).solve().source


def _refined_roughly(quick: Sequence[_Rough], segments: int) -> Iterator[_Rough]:
    """Yield the rough paths near quick ones, without those that are lost or far behind one before."""
    shortest = inf
    for each in quick:
        count = max(segments, each.path.path.trajectory.segments)
        path = each.refinement.rough(each.path.path, count, shortest)
        if each.refinement.is_promising(path):
            yield _Rough(each.refinement, path)
            shortest = min(shortest, path.path.trajectory.duration)
        if out_of_time():
            return


def _begun(refinement: Refinement, guess: Guess, segments: int, stretch: float) -> WarmStart:
    """The path of a guess, refined to pass walls on its side where it has to."""
    if guess.turned is None:
        return guess.path
    begun = replace(guess.path, stages=guess.turned.stages.stages)
    turned = Refinement.of(guess.turned, refinement.recorder, refinement.still_ends)
    return replace(_quick(turned, begun, segments, stretch).path, stages=guess.path.stages)
