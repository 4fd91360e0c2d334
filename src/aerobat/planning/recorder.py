"""The record of planning: every attempt in order, reported as it ends."""

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
    cost: float | None  # the minimized cost, as in Plan; None: no solution, or not nearly feasible
    nodes: int  # QPs solved, or iterations
    solve_time: float = field(compare=False)  # wall-clock time [s]
    dt: float | None = None  # [s] of the intervals, where they are equal
    margin: float | None = None  # [N] of the rotors, negative: beyond their limits; None: not computed


Progress = Callable[[Attempt], None]


@dataclass
class Recorder:
    """A list of attempts that also calls `progress` with each attempt as it ends."""

    progress: Progress | None = None
    attempts: list[Attempt] = field(default_factory=list)

    def record(self, attempt: Attempt) -> None:
        """Record an attempt and report it."""
        self.attempts.append(attempt)
        if self.progress is not None:
            self.progress(attempt)
