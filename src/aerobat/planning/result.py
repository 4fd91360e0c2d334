"""What planning returns: a trajectory that solves a problem, and the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aerobat.certification import Certificate
from aerobat.planning.recorder import Attempt
from aerobat.planning.rotor_margin import RotorMargin
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


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
    planner: str  # its registered name
    order: int | None = None  # of the derivative of position that is the input, or the closed form's cost
    cost: float | None = None  # what the planner minimizes: Σ|u|², ∫|p⁽ˢ⁾|² dt, or the duration [s]
    status: str = "feasible"  # or optimal, time_limit (the best found by then), locally optimal, stopped
    backend: str = ""  # what solved it
    stages: tuple[PlacedStage, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    dt: float | None = None  # [s] of the intervals, where they are equal
    bound: float | None = None  # the cost of any solution at this dt is at least this, proven
    gap: float | None = None  # (cost − bound) / cost
    vehicle: Vehicle | None = None  # what it was planned or certified for
    certificate: Certificate | None = None  # for the vehicle, over continuous time

    @property
    def duration(self) -> float:
        """The trajectory's duration [s]."""
        return self.trajectory.duration

    @property
    def certified(self) -> bool:
        """True if it is proven that its vehicle can fly it within all limits."""
        return self.certificate is not None and self.certificate.certified

    @property
    def margin(self) -> RotorMargin | None:
        """The certificate's findings about rotors, in short; None without a vehicle."""
        return None if self.certificate is None else RotorMargin.of(self.certificate)

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

    def save(self, path: str | Path) -> None:
        """Write the whole plan as one file, whole or not at all; `load_plan` reads it back.

        Raises SpecError when the file cannot be written.
        """
        from aerobat.planning.plan_file import save_plan

        save_plan(self, path)

    def __str__(self) -> str:
        """One line for people."""
        stages = ", ".join(f"{s.name} at {s.time:.2f} s" for s in self.stages) or "no stages"
        margin = "" if self.margin is None else f"; rotors {self.margin}"
        proof = "" if self.certificate is None else f"; {self.certificate}"
        dt = "" if self.dt is None else f" of {self.dt:.4f} s"
        backend = f" ({self.backend})" if self.backend else ""
        return (
            f"{self.problem.name}: {self.duration:.3f} s in {self.intervals} intervals{dt}, {self.status} by "
            f"{self.planner}{backend}; {stages}{margin}{proof}"
        )
