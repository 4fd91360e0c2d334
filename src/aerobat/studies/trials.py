"""Flights of a plan under random conditions, as many as tell whether enough of all flights succeed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from aerobat.environment import Dispersion
from aerobat.studies.flights import FlightTask, fly_scores
from aerobat.studies.sweep import Share
from aerobat.studies.workers import pool

# after so many flights their share is looked at, and as soon as it decides no more are flown. Each look errs
# with 2.5 % at most, all of them together with 4 % where 95 % succeed, with 0.6 % where 94 % do; where 98 %
# succeed, 340 flights are flown on average, and 3 of 1000 plans stay undecided
LOOKS = (100, 200, 400, 800)


@dataclass(frozen=True)
class Trials:
    """A number of flights under conditions, and how many of them succeed."""

    NEEDED: ClassVar[float] = 0.95  # of all flights

    conditions: Dispersion
    seed: int
    share: Share

    @property
    def proven(self) -> bool:
        """True if so many succeed that at least NEEDED of all do, at the share's confidence."""
        return self.share.interval[0] >= self.NEEDED

    @property
    def refuted(self) -> bool:
        """True if so few succeed that less than NEEDED of all do, at the share's confidence."""
        return self.share.interval[1] < self.NEEDED


def fly_trials(task: FlightTask, progress: Callable[[int, int], None] | None = None) -> Trials:
    """Fly until it is decided whether enough of all flights succeed, or the flights of all LOOKS are flown.

    Args:
        task: What is flown, and under which conditions.
        progress: Called with the flights done, and of them those that succeeded.
    """
    flown = succeeded = 0
    with pool(1, None, 1) as flying:  # hundreds of flights are over before another process has begun
        for look in LOOKS:
            (scores,) = fly_scores(flying, (task,), range(flown, look))
            flown, succeeded = look, succeeded + int(scores.succeeded.sum())
            if progress is not None:
                progress(flown, succeeded)
            trials = Trials(task.conditions, task.seed, Share(succeeded, flown))
            if trials.proven or trials.refuted:
                break
    return trials
