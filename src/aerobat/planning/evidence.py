"""Evidence for a path: its proof, its own flights, and its duration beside what is possible.

All of it follows from the path, its vehicle, its problem and its placed stages, and is worked out when it is
first read. So it is never that of another path, and never what a file claims.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from aerobat.certification import Certificate, Envelope, certify
from aerobat.certification.path.passages import passage_findings, waypoint_findings
from aerobat.planning.assessment.assess import assessment
from aerobat.planning.assessment.assessment import Assessment
from aerobat.planning.flyability import Flyability, own_flights
from aerobat.planning.passages import PlacedStage, planned_passages, planned_waypoints
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@dataclass(frozen=True)
class Evidence:
    """The evidence for a path: `certificate`, `flyability` and `assessment`."""

    problem: Problem
    vehicle: Vehicle
    trajectory: Trajectory
    stages: tuple[PlacedStage, ...] = ()  # the gates and waypoints among them are passed then

    @cached_property
    def certificate(self) -> Certificate:
        """The proof over continuous time that all limits hold, or what refutes it (5 to 10 ms)."""
        envelope = envelope_for(self.problem, self.vehicle, self.stages)
        return certify(self.trajectory, self.vehicle, self.problem.environment, envelope)

    @cached_property
    def flyability(self) -> Flyability:
        """The findings of the vehicle's own simulated flights (tens of milliseconds)."""
        margin = self.certificate.margin or 0.0
        return own_flights(self.trajectory, self.vehicle, self.problem, self.stages, margin)

    @cached_property
    def assessment(self) -> Assessment:
        """The path beside what is possible, and beside the room and the rates that are usual."""
        return assessment(self.problem, self.vehicle, self.trajectory, self.certificate)

    def at(self, stages: Sequence[PlacedStage]) -> Evidence:
        """Return the evidence for the same path with its stages placed; what is proven along it is kept."""
        placed = replace(self, stages=tuple(stages))
        passages = planned_passages(stages, self.problem)
        findings = passage_findings(self.trajectory, passages, self.vehicle, self.problem.environment)
        findings += waypoint_findings(self.trajectory, planned_waypoints(stages, self.problem))
        vars(placed)["certificate"] = self.certificate.with_passages(findings)
        return placed


def envelope_for(problem: Problem, vehicle: Vehicle, stages: Sequence[PlacedStage] = ()) -> Envelope:
    """Return the limits of a problem for a vehicle, with the gates that are passed at placed stages."""
    sequence = problem.stages(vehicle.max_specific_thrust)
    return Envelope(
        limits=problem.path_limits,
        conditions=sequence.path_constraints,
        passages=planned_passages(stages, problem),
        waypoints=planned_waypoints(stages, problem),
        start=problem.ends.get("start"),
        goal=problem.ends.get("goal"),
        closed=sequence.closed,
    )
