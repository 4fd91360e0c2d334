"""The loop of all planners: solve, certify, tighten the limits that are violated, and solve again.

A planner states a program with limits that can be tightened. Whether a solution becomes a plan is decided
here, by the certificate of its trajectory over continuous time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

from aerobat.certification import Certificate, Finding
from aerobat.planning.evidence import Evidence
from aerobat.planning.passages import PlacedStage
from aerobat.planning.recorder import Attempt, Recorder
from aerobat.planning.result import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.task import Task
from aerobat.trajectory import Trajectory

Detail = TypeVar("Detail")


@dataclass(frozen=True, eq=False)
class Solution(Generic[Detail]):
    """The solution of a planner's program: a trajectory, or a sentence about why there is none."""

    source: Detail  # the planner's own data, for tightening and for the stages
    duration: float  # [s]
    trajectory: Trajectory | None
    status: str  # of the program, as in Attempt
    nodes: int  # QPs solved, or iterations
    solve_time: float  # [s]
    cost: float | None = None
    dt: float | None = None  # [s] of the intervals, where they are equal
    failure: str | None = None  # why the solution cannot be a plan, where that needs no certificate
    margin: float | None = None  # [N] of the rotors, where samples have shown a negative one
    placed: tuple[PlacedStage, ...] = ()  # the stages that the certificate includes


class Program(Protocol[Detail]):
    """A planner's program with bounds that can be tightened."""

    def solve(self) -> Solution[Detail]:
        """Return the program's solution with the bounds as they are."""
        ...

    def tighten(self, solution: Solution[Detail], certificate: Certificate | None) -> bool:
        """Tighten limits by a solution's violations; return False where that leads nowhere.

        There is no certificate where the solution is a failure.
        """
        ...


@dataclass(frozen=True, eq=False)
class Judged(Generic[Detail]):
    """A solution with its verdict: feasible if its certificate, where there is a vehicle, proves it."""

    task: Task
    solution: Solution[Detail]
    evidence: Evidence | None  # for the solution's path; None without a vehicle
    feasible: bool

    @property
    def certificate(self) -> Certificate | None:
        """The certificate of the solution's path; None without a vehicle."""
        return None if self.evidence is None else self.evidence.certificate

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about the body's clearance from the frames of gates at placed stages."""
        return () if self.certificate is None else self.certificate.frames

    def at(self, stages: Sequence[PlacedStage]) -> Judged[Detail]:
        """Return the judged solution with its stages placed."""
        return replace(self, evidence=None if self.evidence is None else self.evidence.at(stages))

    def plan(self, recorder: Recorder, **facts: Any) -> Plan:
        """Return the solution's plan; `facts` are the fields of Plan that only the planner knows."""
        trajectory = self.solution.trajectory
        assert trajectory is not None, "a plan is made of a solution that has a trajectory"
        plan = Plan(
            problem=self.task.problem,
            trajectory=trajectory,
            cost=self.solution.cost,
            dt=self.solution.dt,
            attempts=tuple(recorder.attempts),
            vehicle=self.task.vehicle_if_any,
            **facts,
        )
        return plan if self.evidence is None else replace(plan, evidence=self.evidence.at(plan.stages))


def certified_solve(
    program: Program[Detail], task: Task, recorder: Recorder, rounds: int = 1
) -> Judged[Detail]:
    """Return the first solution that is certified and keeps the reserve, or the last solution tried.

    Args:
        program: The program that is solved and tightened.
        task: The task that solutions are certified for.
        recorder: Records one attempt a solve.
        rounds: Largest number of solves.
    """
    for remaining in reversed(range(rounds)):
        judged = judge(program.solve(), task, recorder)
        if judged.feasible or not remaining or not program.tighten(judged.solution, judged.certificate):
            break
    return judged


def judge(solution: Solution[Detail], task: Task, recorder: Recorder, jumps: bool = False) -> Judged[Detail]:
    """Certify a solution, its reserve included, and record the attempt.

    Args:
        solution: A path, or why there is none.
        task: The task that is certified; without a vehicle every path is feasible.
        recorder: Records the attempt.
        jumps: Whether jumps of body rates, or of thrusts of rotors with lag, are allowed between segments.
            No vehicle can follow them; the certificate still lists them.
    """
    evidence = certificate = None
    if solution.trajectory is not None and solution.failure is None and task.vehicle_if_any is not None:
        evidence = Evidence(task.as_proven, solution.trajectory, solution.placed)
        certificate = evidence.certificate
    outcome = solution.failure
    if certificate is not None:
        within = replace(certificate, discontinuities=()) if jumps else certificate
        outcome = None if within.certified else certificate.why
        shortfalls = reserve_shortfalls(certificate, task.reserve)
        if outcome is None and shortfalls:
            outcome = shortfalls[0].reason
    feasible = outcome is None
    margin = solution.margin if certificate is None else certificate.margin
    recorder.record(
        Attempt(
            duration=solution.duration,
            feasible=feasible,
            status=solution.status,
            outcome=outcome or "feasible",
            cost=solution.cost,
            nodes=solution.nodes,
            solve_time=solution.solve_time,
            dt=solution.dt,
            margin=margin,
        )
    )
    return Judged(task, solution, evidence, feasible)
