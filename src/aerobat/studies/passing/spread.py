"""The spread of flights, and what it asks of the next plan: narrower gates, and more thrust in them."""

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

LEVEL = 0.95  # of the flights, that keep within a tube
ROWS_RATE = 100.0  # [1/s] of a tube's rows, at most
SAMPLED = 200  # flights whose every row is looked at: 50 MB
MIN_TOLERANCE = 0.1  # of a gate's tolerance, that is left to the plan however far flights stray
MIN_OPENING = 0.8  # likewise of a gate's opening
AIM = 0.8  # of a tolerance of attitude, that flights shall keep to after their thrust there is raised
MAX_THRUST = 0.75  # of the greatest specific thrust, to which it may be: turning takes the rest


def tube_series(task: PassingTask, plan: Plan, flights: range) -> dict[str, tuple[float, ...]]:
    """The times, errors and margins of a plan's `Tube`, by the first ones of some flights of it."""
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
    """The problem with openings and tolerances less by what flights stray in the gates.

    An opening stays as it is where the vehicle would not fit into a smaller one.

    Args:
        problem: What is planned.
        vehicle: What flies it.
        scores: Of the flights of its plan.
    """
    pointed = replace(problem, gates=tuple(_pointed(gate, scores) for gate in problem.gates))
    smaller = replace(pointed, gates=tuple(_smaller(gate, scores) for gate in pointed.gates))
    try:
        require_openings(smaller, vehicle)
    except SpecError:
        return pointed
    return smaller


def with_more_thrust(
    problem: Problem, vehicle: Vehicle, plan: Plan, scores: Score, fraction: float
) -> Problem:
    """The problem with more thrust in its stages than its plan has, where flights stray off their attitude.

    Against a push across the thrust the vehicle leans by their ratio: the more thrust, the less. The problem
    itself where its maneuver asks for no thrust in them, or this is as much as is useful.

    Args:
        problem: What is planned.
        vehicle: What flies it.
        plan: What was planned of it.
        scores: Of that plan's flights.
        fraction: Of the flights, that shall keep to the attitude.
    """
    strays = [(p.attitude_error_deg / p.attitude_tolerance_deg, p.planned) for p in scores.passages]
    strays += [(stage.angle_deg / stage.tolerance_deg, stage.planned) for stage in scores.attitudes]
    planned = [_planned_thrust(plan, np.asarray(times)) for _, times in strays]
    needed = [
        _excess(np.asarray(each), fraction) * f / AIM for (each, _), f in zip(strays, planned, strict=True)
    ]
    thrust = min(max(needed, default=0.0), MAX_THRUST * vehicle.max_specific_thrust)
    if thrust <= min(planned, default=0.0):
        return problem
    return replace(problem, maneuver=problem.maneuver.with_stage_thrust(problem.gates, thrust))


def _excess(strays: Array, fraction: float) -> float:
    """The attitude error, over its tolerance, that a fraction of flights stays within; 0 for no flight."""
    known = strays[np.isfinite(strays)]
    return float(np.quantile(known, fraction)) if len(known) else 0.0


def _planned_thrust(plan: Plan, times: Array) -> float:
    """The specific thrust [m/s²] of a plan as it is to pass a stage, at times [s] of flights."""
    if np.isnan(times).all():  # no flight came near
        return 0.0
    time = min(float(np.nanmedian(times)), plan.duration)
    acceleration = plan.trajectory.evaluate(np.array([time]), 2)[0]
    return float(np.linalg.norm(acceleration + plan.problem.environment.weight))


def _pointed(gate: Gate, scores: Score) -> Gate:
    """The gate with its tolerance of attitude less the attitude error of flights."""
    strays = radians(_quantile(gate, scores, "attitude_error_deg"))
    left = max(gate.attitude_tolerance - strays, MIN_TOLERANCE * gate.attitude_tolerance)
    return replace(gate, attitude_tolerance=left)


def _smaller(gate: Gate, scores: Score) -> Gate:
    """The gate with its opening less the offsets of flights, on both sides."""
    across, up = (
        max(1.0 - 2.0 * _quantile(gate, scores, offset) / side, MIN_OPENING)
        for side, offset in zip(gate.opening.size.tolist(), ("lateral", "up"), strict=True)
    )
    return gate.resized(across, up)


def _quantile(gate: Gate, scores: Score, field: str) -> float:
    """The largest size of a field over the passages of a gate, in LEVEL of the flights that crossed it."""
    sizes = [np.abs(getattr(each, field)) for each in scores.passages if each.gate == gate.name]
    known = [each[np.isfinite(each)] for each in sizes]
    return max((float(np.quantile(each, LEVEL)) for each in known if len(each)), default=0.0)
