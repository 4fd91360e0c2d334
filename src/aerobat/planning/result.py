"""What planning returns: the plan, and every attempt on the way to it."""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.planning.feasibility import RotorMargin
from aerobat.specs.gate import Gate
from aerobat.specs.problem import Problem
from aerobat.trajectory import Trajectory


@dataclass(frozen=True)
class Attempt:
    """One duration that was tried."""

    dt: float  # [s] per interval
    duration: float  # [s]
    feasible: bool
    status: str  # of the program: optimal, time_limit (the best found by then), infeasible, unknown
    outcome: str  # a sentence
    cost: float | None  # Σ|u|², the input's units squared
    nodes: int
    solve_time: float  # [s]


@dataclass(frozen=True)
class PlacedStage:
    """Where a stage ended up."""

    name: str
    interval: int  # counted from 0; the stage holds at its end
    time: float  # [s]
    gate: Gate | None = None


@dataclass(frozen=True)
class Plan:
    """A trajectory that solves a problem, and the evidence for it."""

    problem: Problem
    trajectory: Trajectory
    planner: str
    order: int
    intervals: int
    dt: float  # [s]
    cost: float  # Σ|u|²
    status: str  # optimal, or time_limit: the best found by then
    bound: float  # Σ|u|² of any solution at this dt is at least this, proven
    gap: float  # (cost − bound) / cost
    backend: str
    nodes: int  # over all attempts
    solve_time: float  # [s] over all attempts, in the solver
    stages: tuple[PlacedStage, ...]
    attempts: tuple[Attempt, ...]
    vehicle: str | None = None
    margin: RotorMargin | None = None

    @property
    def duration(self) -> float:
        """The trajectory's duration [s]."""
        return self.trajectory.duration

    def __str__(self) -> str:
        """One line for people."""
        stages = ", ".join(f"{s.name} at {s.time:.2f} s" for s in self.stages) or "no stages"
        margin = "" if self.margin is None else f"; rotors {self.margin}"
        return (
            f"{self.problem.name}: {self.duration:.3f} s in {self.intervals} intervals of {self.dt:.4f} s, "
            f"cost {self.cost:.6g} ({self.backend}, {self.nodes} nodes); {stages}{margin}"
        )
