"""Flights of a study: of one plan and one seed, cut into chunks that any worker may fly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from aerobat.control import ControlLaw, Controller
from aerobat.engines import choose
from aerobat.environment import Dispersion
from aerobat.evaluation.score import Score
from aerobat.evaluation.score_flights import score_flights
from aerobat.planning import Plan
from aerobat.simulation import FlightConfig, Outcome
from aerobat.studies.share import Share, Trials
from aerobat.studies.workers import Pool, pool
from aerobat.vehicle import Vehicle

CHUNK = 50  # flights that are flown, kept and resumed as one, whatever the batches and the workers
TOGETHER = 10  # chunks at most that a worker is handed at once: a quarter of a second of flying
# after so many flights their share is looked at, and as soon as it decides no more are flown. Each look errs
# with 2.5 % at most, all of them together with 4 % where 95 % succeed, with 0.6 % where 94 % do; where 98 %
# succeed, 340 flights are flown on average, and 3 of 1000 plans stay undecided
LOOKS = (100, 200, 400, 800)
Flights = Annotated[int, Field(ge=1, le=10**6, description="whole number from 1 to a million")]


@dataclass(frozen=True)
class FlightTask:
    """A plan that a study flies, and the settings of its flights."""

    plan: Plan
    vehicle: Vehicle  # that plan and controller know
    conditions: Dispersion
    seed: int
    controller: Controller | ControlLaw
    engine: str = "auto"
    batch: int = CHUNK  # flights that are flown side by side

    def config(self, flights: range) -> FlightConfig:
        """Settings of some flights. An engine has its own rounding, so that one flies all, few or many."""
        config = FlightConfig(
            controller=self.controller, conditions=self.conditions, seed=self.seed, flights=flights
        )
        ticks = round(self.plan.duration * config.control_rate)
        return replace(config, engine=choose(self.engine, CHUNK, ticks).name)


def cut(flights: range, size: int = CHUNK) -> list[range]:
    """Cut flights into ranges of one size, the last one perhaps smaller."""
    return [flights[first : first + size] for first in range(0, len(flights), size)]


def fly_scores(flying: Pool, tasks: tuple[FlightTask, ...], flights: range) -> list[Score]:
    """Score the same flights of each task.

    Args:
        flying: What flies them.
        tasks: What is flown.
        flights: Their numbers.
    """
    parts = [(k, numbers) for k in range(len(tasks)) for numbers in cut(flights)]
    found = dict(flying.results(_score_chunk, tasks, parts, together=TOGETHER, compiles=True))
    return [joined([found[k, numbers] for numbers in cut(flights)]) for k in range(len(tasks))]


def fly_trials(task: FlightTask, progress: Callable[[int, int], None] | None = None) -> Trials:
    """Fly until it is decided whether enough of all flights succeed, or the flights of all LOOKS are flown.

    Args:
        task: What is flown, and under which conditions.
        progress: Called with the flights done, and of them those that succeeded.
    """
    flown, failures = 0, list[Outcome]()
    with pool(1, None, 1) as flying:  # hundreds of flights are over before another process has begun
        for look in LOOKS:
            (scores,) = fly_scores(flying, (task,), range(flown, look))
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


def joined(parts: list[Any]) -> Any:
    """Join scores of consecutive flights into one: arrays are concatenated, in tuples and dataclasses too."""
    first = parts[0]
    if isinstance(first, np.ndarray):
        return np.concatenate(parts)
    if isinstance(first, tuple):
        return tuple(joined(list(each)) for each in zip(*parts, strict=True))
    if is_dataclass(first) and not isinstance(first, type):
        names = [field.name for field in fields(first)]
        return replace(first, **{name: joined([getattr(part, name) for part in parts]) for name in names})
    return first
