"""Solve, certify, tighten by what was exceeded, again: the one way in which planners come to a plan.

A planner states a program and bounds that can be tightened; what makes an answer a plan is decided here, by
its certificate over continuous time, which therefore is always that of the trajectory it comes with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate
from aerobat.errors import SpecError
from aerobat.planning.evidence import Evidence
from aerobat.planning.recorder import Attempt, Recorder
from aerobat.planning.result import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls, sampled_margin
from aerobat.problem.problem import Limits, Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

BACKOFF = 1e-4  # of a bound, of one at or next to zero in SI units: it is tightened by so much more
NEGLIGIBLE = 1e-9  # in SI units: an excess that means nothing

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

    problem: Problem
    vehicle: Vehicle | None
    solution: Solution[Detail]
    evidence: Evidence | None  # for the solution's path, where there is a vehicle
    feasible: bool

    @property
    def certificate(self) -> Certificate | None:
        """The certificate of the solution's path; None without a vehicle."""
        return None if self.evidence is None else self.evidence.certificate

    def plan(self, recorder: Recorder, **facts: Any) -> Plan:
        """The plan of it; `facts` are the fields of Plan that the planner alone knows."""
        trajectory = self.solution.trajectory
        assert trajectory is not None, "a plan is made of a solution that has a trajectory"
        plan = Plan(
            problem=self.problem,
            trajectory=trajectory,
            cost=self.solution.cost,
            dt=self.solution.dt,
            attempts=tuple(recorder.attempts),
            vehicle=self.vehicle,
            **facts,
        )
        return plan if self.evidence is None else replace(plan, evidence=self.evidence.at(plan.stages))


def certified_solve(
    program: Program[Detail],
    problem: Problem,
    vehicle: Vehicle | None,
    recorder: Recorder,
    rounds: int = 1,
    reserve: float = 0.0,
) -> Judged[Detail]:
    """The first solution that is certified and keeps the reserve, or the last one that was tried.

    Args:
        program: What is solved and tightened.
        problem: Its limits and its environment are certified, beside the vehicle's limits.
        vehicle: What shall fly it; without one every solution will do.
        recorder: Keeps an attempt a solve.
        rounds: Solves, at most.
        reserve: Of each rotor's range, that it must be proven to keep from either of its limits.
    """
    for left in reversed(range(rounds)):
        judged = judge(program.solve(), problem, vehicle, recorder, reserve)
        if judged.feasible or not left or not program.tighten(judged.solution, judged.certificate):
            break
    return judged


def refuted_by_samples(
    solution: Solution[Detail], problem: Problem, vehicle: Vehicle | None
) -> Solution[Detail]:
    """The solution, a failure where samples already show that the vehicle's rotors cannot follow it."""
    if vehicle is None or solution.trajectory is None or solution.failure is not None:
        return solution
    sampled = sampled_margin(solution.trajectory, vehicle, problem.environment)
    if sampled.margin >= 0.0:
        return solution
    return replace(solution, failure=sampled.reason, margin=sampled.margin)


def tightened(bounds: Limits, limits: Limits, trajectory: Trajectory, derivatives: int) -> Limits | None:
    """Bounds tighter by as much as a trajectory exceeds the limits; None where that leaves nothing.

    Args:
        bounds: What was imposed where the program could, say at nodes.
        limits: What shall hold everywhere.
        trajectory: The solution with these bounds.
        derivatives: How many of position's derivatives, itself included, are looked at.

    Where nothing is exceeded, the same object is returned.
    """
    for derivative in range(derivatives):
        (lower, upper), (least, most) = limits.of(derivative), trajectory.component_range(derivative)
        below, above = _backoff(lower - least, lower), _backoff(most - upper, upper)
        if below.any() or above.any():
            try:
                bounds = bounds.tightened(derivative, below, above)
            except SpecError:
                return None
    return bounds


def _backoff(excess: Array, bound: Array) -> Array:
    """A little more than what is exceeded, and nothing where nothing but rounding is."""
    backoff = np.zeros_like(excess)
    exceeded = excess > NEGLIGIBLE
    backoff[exceeded] = excess[exceeded] + BACKOFF * np.maximum(np.abs(bound[exceeded]), 1.0)
    return backoff


def judge(
    solution: Solution[Detail],
    problem: Problem,
    vehicle: Vehicle | None,
    recorder: Recorder,
    reserve: float = 0.0,
    jumps: bool = False,
) -> Judged[Detail]:
    """Certify a solution, and keep the attempt.

    Args:
        solution: A path, or why there is none.
        problem: Its limits and its environment are certified, beside the vehicle's limits.
        vehicle: What shall fly it; without one every solution will do.
        recorder: Keeps the attempt.
        reserve: Of each rotor's range, that it must be proven to keep from either of its limits.
        jumps: Whether body rates, or thrusts of rotors with lag, may jump between segments, which no moment
            and no rotor can do, as the certificate says.
    """
    evidence = certificate = None
    if solution.trajectory is not None and solution.failure is None and vehicle is not None:
        evidence = Evidence(problem, vehicle, solution.trajectory)
        certificate = evidence.certificate
    outcome = solution.failure
    if certificate is not None:
        within = replace(certificate, discontinuities=()) if jumps else certificate
        outcome = None if within.certified else certificate.why
        shortfalls = reserve_shortfalls(certificate, reserve)
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
    return Judged(problem, vehicle, solution, evidence, feasible)
