"""Flights of a study: of one plan and one seed, cut into chunks that any worker may fly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

from pydantic import Field

from aerobat.control import ControlLaw, Controller
from aerobat.engines import choose
from aerobat.environment import Dispersion
from aerobat.evaluation.score import Score
from aerobat.evaluation.score_flights import score_flights
from aerobat.planning import Plan
from aerobat.simulation import FlightConfig, Outcome
from aerobat.simulation.nested import joined
from aerobat.studies.share import Share, Trials
from aerobat.studies.workers import Pool
from aerobat.vehicle import Vehicle

CHUNK = 50  # flights that are flown, kept and resumed as a unit, whatever the batches and the workers
CHUNKS_PER_GROUP = 40  # largest number of chunks sent to a worker at once: a second of flying
# Numbers of flights after which the share is tested; flying stops at the first decision (sequential test).
# Each test errs with probability 2.5 % at most. All tests together err with 4 % at a true probability of
# 95 %, and with 0.6 % at 94 %. At 98 %, 340 flights are flown on average, and 3 of 1000 plans stay undecided.
LOOKS = (100, 200, 400, 800)
Flights = Annotated[int, Field(ge=1, le=10**6, description="whole number from 1 to a million")]


@dataclass(frozen=True)
class FlightTask:
    """A plan that a study flies, and the settings of its flights."""

    plan: Plan
    vehicle: Vehicle  # the nominal vehicle of plan and controller
    conditions: Dispersion
    seed: int
    controller: Controller | ControlLaw
    engine: str = "auto"
    batch: int = CHUNK  # flights that are flown side by side

    def config(self, flights: range) -> FlightConfig:
        """Return the settings of some flights. The engine, and its rounding, is the same for any number."""
        config = FlightConfig(
            controller=self.controller, conditions=self.conditions, seed=self.seed, flights=flights
        )
        ticks = round(self.plan.duration * config.control_rate)
        return replace(config, engine=choose(self.engine, CHUNK, ticks).name)


def cut(flights: range, size: int = CHUNK) -> list[range]:
    """Cut flights into ranges of one size, the last one perhaps smaller."""
    return [flights[first : first + size] for first in range(0, len(flights), size)]


def fly_scores(flying: Pool, tasks: tuple[FlightTask, ...], flights: range) -> list[Score]:
    """Score the flights of these numbers, the same ones of each task."""
    parts = [(k, numbers) for k in range(len(tasks)) for numbers in cut(flights)]
    found = dict(flying.results(_score_chunk, tasks, parts, together=CHUNKS_PER_GROUP, compiles=True))
    return [joined([found[k, numbers] for numbers in cut(flights)]) for k in range(len(tasks))]


def fly_trials(task: FlightTask, progress: Callable[[int, int], None] | None = None) -> Trials:
    """Fly until the share of successes is decided, or the flights of all LOOKS are flown.

    `progress` is called with the number of finished flights and of successful ones.
    """
    flown, failures = 0, list[Outcome]()
    here = Pool()  # this process: hundreds of flights end before another one starts
    for look in LOOKS:
        (scores,) = fly_scores(here, (task,), range(flown, look))
        flown, failures = look, [*failures, *(end for end in scores.outcomes if not end.is_success)]
        share = Share(flown - len(failures), flown)
        if progress is not None:
            progress(flown, share.count)
        trials = Trials(task.conditions, task.seed, share, tuple(failures))
        if trials.proven or trials.refuted:
            break
    return trials


def passed(scores: Score) -> Share:
    """Return the share of flights that pass."""
    return Share.where(scores.succeeded)


def _score_chunk(tasks: tuple[FlightTask, ...], part: tuple[int, range]) -> Score:
    number, flights = part
    task = tasks[number]
    return score_flights(task.plan, task.vehicle, config=task.config(flights))
