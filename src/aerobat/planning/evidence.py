"""Evidence for a path: its proof, its own flights, and its duration beside what is possible.

All of it follows from the path, its vehicle, its problem and its placed stages, and is worked out when it is
first read. So it is never that of another path, and never what a file claims.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from aerobat.certification import Certificate, certify
from aerobat.planning.assessment.assess import assessment
from aerobat.planning.assessment.assessment import Assessment
from aerobat.planning.flyability import Flyability, own_flights
from aerobat.planning.passages import PlacedStage
from aerobat.planning.task import Task
from aerobat.trajectory import Trajectory


@dataclass(frozen=True)
class Evidence:
    """The evidence for a path: `certificate`, `flyability` and `assessment`."""

    task: Task  # with a vehicle
    trajectory: Trajectory
    stages: tuple[PlacedStage, ...] = ()  # the gates and waypoints among them are passed then

    @cached_property
    def certificate(self) -> Certificate:
        """The proof over continuous time that all limits hold, or what refutes it (5 to 10 ms)."""
        task = self.task
        return certify(self.trajectory, task.vehicle, task.environment, task.envelope(self.stages))

    @cached_property
    def flyability(self) -> Flyability:
        """The findings of the vehicle's own simulated flights (tens of milliseconds)."""
        return own_flights(self.task, self.trajectory, self.stages, self.certificate)

    @cached_property
    def assessment(self) -> Assessment:
        """The path beside what is possible, and beside the room and the rates that are usual."""
        return assessment(self.task, self.trajectory, self.certificate)

    def at(self, stages: Sequence[PlacedStage]) -> Evidence:
        """Return the evidence for the same path with its stages placed; what is proven of them is kept."""
        if tuple(stages) == self.stages:
            return self
        placed, envelope = replace(self, stages=tuple(stages)), self.task.envelope(stages)
        if not (envelope.passages or envelope.waypoints):
            vars(placed)["certificate"] = self.certificate
        return placed
