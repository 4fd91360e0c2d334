"""Evidence for a path: its certificate, its simulated flights, and its assessment.

All evidence follows from the path, its vehicle, its problem and its placed stages, and is computed when it is
first read. So evidence never belongs to another path, and is never taken from a file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from aerobat.certification import Certificate, certify
from aerobat.optimization.deadline import count_work
from aerobat.planning.assessment.assessment import Assessment
from aerobat.planning.flyability import Flyability, own_flights
from aerobat.planning.passages import PlacedStage
from aerobat.planning.task import Task
from aerobat.trajectory import Trajectory

CERTIFICATE_WORK = 1.5e-3  # work of a certificate for each segment [s], measured (benchmarks/work.py)


@dataclass(frozen=True)
class Evidence:
    """The evidence for a path: `certificate`, `flyability` and `assessment`."""

    task: Task  # with a vehicle
    trajectory: Trajectory
    stages: tuple[PlacedStage, ...] = ()  # the certificate includes their gates and waypoints

    @cached_property
    def certificate(self) -> Certificate:
        """The proof over continuous time that all limits hold, or the violations (5 to 10 ms)."""
        task = self.task
        count_work(CERTIFICATE_WORK * self.trajectory.segments)
        return certify(self.trajectory, task.vehicle, task.environment, task.envelope(self.stages))

    @cached_property
    def flyability(self) -> Flyability:
        """The findings of the vehicle's simulated flights (tens of milliseconds)."""
        return own_flights(self.task, self.trajectory, self.stages, self.certificate)

    @cached_property
    def assessment(self) -> Assessment:
        """The path against a lower bound on durations, and against usual room and rates."""
        return Assessment.of(self.task, self.trajectory, self.certificate)

    def at(self, stages: Sequence[PlacedStage]) -> Evidence:
        """Return the evidence for the same path with other placed stages.

        The certificate is reused if no gate or waypoint is among them.
        """
        if tuple(stages) == self.stages:
            return self
        placed, envelope = replace(self, stages=tuple(stages)), self.task.envelope(stages)
        if not (envelope.passages or envelope.waypoints):
            vars(placed)["certificate"] = self.certificate
        return placed
