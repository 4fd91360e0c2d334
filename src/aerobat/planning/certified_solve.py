"""Solve, certify, tighten by what was exceeded, again: the one way in which planners come to a plan.

A planner states a program and bounds that can be tightened; what makes an answer a plan is decided here, by
its certificate over continuous time, which therefore is always that of the trajectory it comes with.
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
    """Answer of a planner's program: a trajectory, or a sentence about why there is none."""

    source: Detail  # whatever the planner tightens by and reads its stages from
    duration: float  # [s]
    trajectory: Trajectory | None
    status: str  # of the program, as in Attempt
    nodes: int
    solve_time: float  # [s]
    cost: float | None = None
    dt: float | None = None  # [s]
    failure: str | None = None  # why it cannot be a plan, found without a certificate
    margin: float | None = None  # [N] of the rotors, where samples have shown it to be negative
    placed: tuple[PlacedStage, ...] = ()  # those that are proven at once


class Program(Protocol[Detail]):
    """A planner's program with bounds that can be tightened."""

    def solve(self) -> Solution[Detail]:
        """Return the program's solution with the bounds as they are."""
        ...

    def tighten(self, solution: Solution[Detail], certificate: Certificate | None) -> bool:
        """Tighten by what a solution exceeds; False where that leads nowhere.

        There is no certificate where the solution is a failure.
        """
        ...


@dataclass(frozen=True, eq=False)
class Judged(Generic[Detail]):
    """A solution and what decides about it: its own certificate, where there is a vehicle."""

    task: Task
    solution: Solution[Detail]
    evidence: Evidence | None  # for the solution's path, where there is a vehicle
    feasible: bool

    @property
    def certificate(self) -> Certificate | None:
        """The certificate of the solution's path; None without a vehicle."""
        return None if self.evidence is None else self.evidence.certificate

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about the body and the frames of gates that are passed at placed stages."""
        return () if self.certificate is None else self.certificate.frames

    def at(self, stages: Sequence[PlacedStage]) -> Judged[Detail]:
        """Return the same with its stages placed."""
        return replace(self, evidence=None if self.evidence is None else self.evidence.at(stages))

    def plan(self, recorder: Recorder, **facts: Any) -> Plan:
        """The plan of it; `facts` are the fields of Plan that the planner alone knows."""
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
    """The first solution that is certified and keeps the reserve, or the last one that was tried.

    Args:
        program: What is solved and tightened.
        task: What is certified.
        recorder: Keeps an attempt a solve.
        rounds: Solves, at most.
    """
    for left in reversed(range(rounds)):
        judged = judge(program.solve(), task, recorder)
        if judged.feasible or not left or not program.tighten(judged.solution, judged.certificate):
            break
    return judged


def judge(solution: Solution[Detail], task: Task, recorder: Recorder, jumps: bool = False) -> Judged[Detail]:
    """Certify a solution, its reserve included, and keep the attempt.

    Args:
        solution: A path, or why there is none.
        task: What is certified; without a vehicle every path will do.
        recorder: Keeps the attempt.
        jumps: Whether body rates, or thrusts of rotors with lag, may jump between segments, which no moment
            and no rotor can do, as the certificate says.
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
