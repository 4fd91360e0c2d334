"""What planning returns: the plan, and every attempt on the way to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from aerobat.planning.feasibility import RotorMargin
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from aerobat.certification import Certificate


@dataclass(frozen=True)
class Attempt:
    """One program that was solved on the way: one duration that was tried, or one round of refinement."""

    duration: float  # [s]
    feasible: bool
    status: str  # of the program: optimal, time_limit (the best found by then), infeasible, unknown
    outcome: str  # a sentence
    cost: float | None  # what the planner minimizes, as in Plan
    nodes: int  # QPs solved, or iterations
    solve_time: float  # [s]
    dt: float | None = None  # [s] of the intervals, where they are equal


@dataclass(frozen=True)
class PlacedStage:
    """Where a stage ended up."""

    name: str
    interval: int  # counted from 0; the stage holds at its end
    time: float  # [s]
    gate: str | None = None  # the name of the gate that is passed there


@dataclass(frozen=True)
class Plan:
    """A trajectory that solves a problem, and the evidence for it."""

    problem: Problem
    trajectory: Trajectory
    planner: str  # miqp, min-snap, free-knots or time-optimal
    order: int  # of the derivative of position that is the input, or the closed form's cost
    cost: float  # what the planner minimizes: Σ|u|², ∫|p⁽ˢ⁾|² dt, or the duration [s]
    status: str  # optimal, time_limit (the best found by then), locally optimal, feasible, stopped
    backend: str
    stages: tuple[PlacedStage, ...]
    attempts: tuple[Attempt, ...]
    dt: float | None = None  # [s] of the intervals, where they are equal
    bound: float | None = None  # the cost of any solution at this dt is at least this, proven
    gap: float | None = None  # (cost − bound) / cost
    vehicle: Vehicle | None = None  # what it was planned or certified for
    margin: RotorMargin | None = None
    certificate: Certificate | None = None  # for the vehicle, over continuous time

    @property
    def duration(self) -> float:
        """The trajectory's duration [s]."""
        return self.trajectory.duration

    @property
    def intervals(self) -> int:
        """The trajectory's number of segments."""
        return self.trajectory.segments

    @property
    def nodes(self) -> int:
        """QPs solved, or iterations, over all attempts."""
        return sum(attempt.nodes for attempt in self.attempts)

    @property
    def solve_time(self) -> float:
        """Time in the solver over all attempts [s]."""
        return sum(attempt.solve_time for attempt in self.attempts)

    def __str__(self) -> str:
        """One line for people."""
        stages = ", ".join(f"{s.name} at {s.time:.2f} s" for s in self.stages) or "no stages"
        margin = "" if self.margin is None else f"; rotors {self.margin}"
        proof = "" if self.certificate is None else f"; {self.certificate}"
        dt = "" if self.dt is None else f" of {self.dt:.4f} s"
        return (
            f"{self.problem.name}: {self.duration:.3f} s in {self.intervals} intervals{dt}, {self.status} by "
            f"{self.planner} ({self.backend}); {stages}{margin}{proof}"
        )
