"""A plan's proof: its rotor margin and its certificate for a vehicle, the problem's limits included."""

from __future__ import annotations

from dataclasses import replace

from aerobat.certification import Certificate, Envelope, certify
from aerobat.planning.feasibility import rotor_margin
from aerobat.planning.result import Plan
from aerobat.problem.problem import Problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


def certificate_for(trajectory: Trajectory, problem: Problem, vehicle: Vehicle) -> Certificate:
    """The certificate of a trajectory for the vehicle's limits and the problem's, over continuous time."""
    return certify(trajectory, vehicle, problem.environment, Envelope(limits=problem.path_limits))


def with_certificate(plan: Plan, vehicle: Vehicle) -> Plan:
    """The plan with the margin and the certificate of a vehicle, whichever it was made for."""
    return replace(
        plan,
        vehicle=vehicle,
        margin=rotor_margin(plan.trajectory, vehicle, plan.problem.environment),
        certificate=certificate_for(plan.trajectory, plan.problem, vehicle),
    )
