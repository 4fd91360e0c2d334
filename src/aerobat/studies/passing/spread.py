"""The spread of flights, and the resulting changes of the next plan: narrower gates and more thrust."""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.evaluation import Score
from aerobat.planning import Plan
from aerobat.planning.passages import require_openings
from aerobat.problem import Gate, Problem
from aerobat.simulation import fly
from aerobat.studies.passing.task import PassingTask
from aerobat.vehicle import Vehicle

LEVEL = 0.95  # fraction of flights within a tube
ROWS_RATE = 100.0  # [1/s] largest rate of a tube's rows
SAMPLED = 200  # flights of which every row is used: 50 MB
MIN_TOLERANCE = 0.1  # least fraction of a gate's attitude tolerance that is left to the plan
MIN_OPENING = 0.8  # least fraction of a gate's opening that is left to the plan
TOLERANCE_FRACTION = 0.8  # of an attitude tolerance: flights should keep to it after thrust is raised
MAX_THRUST = 0.75  # fraction of the maximum specific thrust that thrust is raised to: turning needs the rest


def tube_series(task: PassingTask, plan: Plan, flights: range) -> dict[str, tuple[float, ...]]:
    """Return times, errors and margins of a plan's `Tube`, from the first flights of a range."""
    batch = fly(
        plan,
        task.vehicle,
        controller=task.controller,
        conditions=task.conditions,
        seed=task.seed,
        flights=flights[:SAMPLED],
    )
    spacing = float(batch.times[1] - batch.times[0]) if len(batch.times) > 1 else 1.0
    rows = slice(None, None, max(1, round(1.0 / (ROWS_RATE * spacing))))
    commands = batch.commands[:, rows]
    nearest_limit = np.minimum(commands - task.vehicle.min_thrusts, task.vehicle.max_thrusts - commands)
    margins = nearest_limit / task.vehicle.thrust_ranges
    series = {
        "times": batch.times[rows],
        "position_error": np.quantile(batch.position_error[:, rows], LEVEL, axis=0),
        "attitude_error": np.quantile(batch.attitude_error[:, rows], LEVEL, axis=0),
        "rotor_margin": np.quantile(margins.min(axis=-1), 1.0 - LEVEL, axis=0),
    }
    return {name: tuple(values.tolist()) for name, values in series.items()}


def with_narrower_gates(problem: Problem, vehicle: Vehicle, scores: Score) -> Problem:
    """Return the problem with openings and attitude tolerances reduced by the spread of flights at the gates.

    Openings stay as they are where the vehicle would not fit through the smaller ones.
    """
    tighter = replace(problem, gates=tuple(_with_smaller_tolerance(gate, scores) for gate in problem.gates))
    narrower = replace(
        tighter,
        gates=tuple(_with_smaller_opening(gate, scores) for gate in tighter.gates),
    )
    try:
        require_openings(narrower, vehicle)
    except SpecError:
        return tighter
    return narrower


def with_more_thrust(
    problem: Problem, vehicle: Vehicle, plan: Plan, scores: Score, fraction: float
) -> Problem:
    """Return the problem with more thrust in its stages than its plan has, where flights miss their attitude.

    A push across the thrust tilts the vehicle by the ratio of push to thrust, so that more thrust reduces the
    tilt. The problem is returned unchanged where its maneuver has no thrust conditions, or the plan's thrust
    already suffices or is at its useful maximum.

    Args:
        problem: The problem.
        vehicle: The vehicle.
        plan: The plan of the problem.
        scores: Of that plan's flights.
        fraction: Of the flights that should keep to the attitude.
    """
    strays = [(p.attitude_error_deg / p.attitude_tolerance_deg, p.planned) for p in scores.passages]
    strays += [(stage.angle_deg / stage.tolerance_deg, stage.planned) for stage in scores.attitudes]
    planned = [_planned_thrust(plan, np.asarray(times)) for _, times in strays]
    needed = [
        _excess(np.asarray(each), fraction) * f / TOLERANCE_FRACTION
        for (each, _), f in zip(strays, planned, strict=True)
    ]
    thrust = min(max(needed, default=0.0), MAX_THRUST * vehicle.max_specific_thrust)
    if thrust <= min(planned, default=0.0):
        return problem
    return replace(problem, maneuver=problem.maneuver.with_stage_thrust(problem.gates, thrust))


def _excess(strays: Array, fraction: float) -> float:
    """Return the attitude error over tolerance that a fraction of flights stays within; 0 for no flight."""
    known = strays[np.isfinite(strays)]
    return float(np.quantile(known, fraction)) if len(known) else 0.0


def _planned_thrust(plan: Plan, times: Array) -> float:
    """Return the specific thrust [m/s²] of a plan at a stage, from the times [s] of flights there."""
    if np.isnan(times).all():  # no flight came near
        return 0.0
    time = min(float(np.nanmedian(times)), plan.duration)
    acceleration = plan.trajectory.evaluate(np.array([time]), 2)[0]
    return float(np.linalg.norm(acceleration + plan.problem.environment.weight))


def _with_smaller_tolerance(gate: Gate, scores: Score) -> Gate:
    """Return the gate with its attitude tolerance reduced by the attitude error of flights."""
    strays = radians(_quantile(gate, scores, "attitude_error_deg"))
    left = max(gate.attitude_tolerance - strays, MIN_TOLERANCE * gate.attitude_tolerance)
    return replace(gate, attitude_tolerance=left)


def _with_smaller_opening(gate: Gate, scores: Score) -> Gate:
    """Return the gate with its opening reduced by the offsets of flights on both sides."""
    across, up = (
        max(1.0 - 2.0 * _quantile(gate, scores, offset) / side, MIN_OPENING)
        for side, offset in zip(gate.opening.size.tolist(), ("lateral", "up"), strict=True)
    )
    return gate.resized(across, up)


def _quantile(gate: Gate, scores: Score, field: str) -> float:
    """Return the LEVEL quantile of a field's absolute value over the flights that crossed a gate."""
    sizes = [np.abs(getattr(each, field)) for each in scores.passages if each.gate == gate.name]
    known = [each[np.isfinite(each)] for each in sizes]
    return max((float(np.quantile(each, LEVEL)) for each in known if len(each)), default=0.0)
