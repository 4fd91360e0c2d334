"""The fastest certified path around obstacles: a quick round along every route, fine rounds for the best."""

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

QUICK_SEGMENTS = 6  # segments in a quick round: with fewer variables a round moves farther, in half the time
QUICK_PLACES = 12  # places of a segment in a quick round
QUICK = Settings(iterations=40)
QUICK_STRETCHES = (2.0, 1.6)  # factors by which durations may change in a quick round, alternating by batch
FOLLOWED = 2  # shortest quick paths that are refined at a time; the best is nearly always among the first
LONG = 12  # number of segments from which a path skips the quick round: few segments would lose its route
LONGEST = 0.5  # longest segment of a guess [s]: with longer ones, 100 m between tree trunks fail


@dataclass(frozen=True, eq=False)
class _Rough:
    """A path along a route that further rounds may turn into a plan."""

    refinement: Refinement
    path: RefinedPath


def fastest_around(refinement: Refinement, segments: int, count: int = ROUTES) -> FlownPath | None:
    """Return the fastest certified path of the first batch of guesses that leads to one, or None.

    Args:
        refinement: The refinement of a task with obstacles.
        segments: Number of segments of a path, at least.
        count: Number of routes, at most.
    """
    for batch, stretch in zip(guesses(refinement.task, count), cycle(QUICK_STRETCHES)):
        quick = sorted(
            _quickly_refined(refinement, segments, batch, stretch), key=lambda each: each.path.duration
        )
        for k in range(0, len(quick), FOLLOWED):
            rough = _refined_roughly(quick[k : k + FOLLOWED], segments)
            for found in sorted(rough, key=lambda each: each.path.duration):
                judged = found.refinement.finished(found.path)
                if judged.feasible:
                    return FlownPath.of(found.refinement, judged)
        if out_of_time():
            break
    return None


def _quickly_refined(
    refinement: Refinement, segments: int, batch: Sequence[Guess], stretch: float
) -> Iterator[_Rough]:
    """Yield the paths of guesses after one round, without those that further rounds cannot repair."""
    known: dict[float, Refinement] = {}  # by clearance, so that each is compiled once
    for guess in batch:
        own = known.setdefault(guess.task.clearance, replace(refinement, task=guess.task))
        path = guess.path.trajectory
        count = min(max(segments, path.segments, ceil(path.duration / LONGEST)), MAX_SEGMENTS)
        start = _start_path(refinement, guess, segments, stretch)
        rough = _quick(own, start, segments, stretch) if count < LONG else own.rough(start, count)
        if own.is_promising(rough):
            yield _Rough(own, rough)
        if out_of_time():
            return


def _quick(refinement: Refinement, guess: WarmStart, segments: int, stretch: float) -> RefinedPath:
    start = knots_at_stages(guess, min(segments, QUICK_SEGMENTS))
    return Rounds(refinement, start, QUICK, QUICK_PLACES, stretch=stretch).solve().source


def _refined_roughly(quick: Sequence[_Rough], segments: int) -> Iterator[_Rough]:
    """Yield the rough paths near quick ones, without those that cannot be repaired or are far slower."""
    shortest = inf
    for each in quick:
        count = max(segments, each.path.path.trajectory.segments)
        path = each.refinement.rough(each.path.path, count, shortest)
        if each.refinement.is_promising(path):
            yield _Rough(each.refinement, path)
            shortest = min(shortest, path.duration)
        if out_of_time():
            return


def _start_path(refinement: Refinement, guess: Guess, segments: int, stretch: float) -> WarmStart:
    """Return the path of a guess, first refined with the body on its side where walls require that."""
    if guess.turned is None:
        return guess.path
    start = replace(guess.path, stages=guess.turned.stages.stages)
    turned = Refinement.of(guess.turned, refinement.recorder, refinement.still_ends)
    return replace(_quick(turned, start, segments, stretch).path, stages=guess.path.stages)
