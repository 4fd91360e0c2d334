"""The record of planning: every attempt, kept in order and passed on as it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Attempt:
    """One program that was solved on the way: one duration that was tried, or one round of refinement."""

    duration: float  # [s]
    feasible: bool
    status: str  # of the program: optimal, time_limit (the best found by then), infeasible, unknown
    outcome: str  # a sentence
    cost: float | None  # what the planner minimizes, as in Plan
    nodes: int  # QPs solved, or iterations
    solve_time: float = field(compare=False)  # [s] of the clock
    dt: float | None = None  # [s] of the intervals, where they are equal
    margin: float | None = None  # [N] of the rotors, negative: beyond their limits; None: not looked at


Progress = Callable[[Attempt], None]


@dataclass
class Recorder:
    """Keeps attempts and calls `progress` with each as it ends."""

    progress: Progress | None = None
    attempts: list[Attempt] = field(default_factory=list)

    @property
    def last_outcome(self) -> str:
        """The sentence on the last attempt, or that there was none."""
        return self.attempts[-1].outcome if self.attempts else "no path to begin from was found"

    def record(self, attempt: Attempt) -> None:
        """Keep an attempt and pass it on."""
        self.attempts.append(attempt)
        if self.progress is not None:
            self.progress(attempt)
