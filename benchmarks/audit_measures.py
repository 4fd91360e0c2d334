"""Measures of plans, made without the code that they judge: from polynomials and flights."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import AerobatError, Infeasible
from aerobat.evaluation import score
from aerobat.flatness import reference
from aerobat.planning import Plan, Planner, plan, planner_class, planner_options
from aerobat.problem import Condition, Flip, Gate, HalfFlip, Problem, Quantity
from aerobat.simulation import Flight, fly
from aerobat.vehicle import Vehicle

PLANNERS = ("miqp", "min-snap", "free-knots", "time-optimal")
EQUAL_RESERVE = " at equal reserve"  # a planner's name with this: without any that others do not keep
PATIENCE = 120.0  # [s] of the processor, for one call
SAMPLES = 100_000
CHUNK = 10_000
ROTOR_RATE = 1000.0  # [1/s] of rotor thrusts
CROSSING_WINDOW = 0.25  # [s] around the planned instant


@dataclass(frozen=True)
class Attempted:
    """The outcome of one call of a planner."""

    plan: Plan | None
    status: str  # planned, infeasible, or the name of an exception that nobody foresaw
    message: str
    seconds: float  # of the processor


def attempted(call: Callable[[], Plan], patience: float = PATIENCE) -> Attempted:
    """The outcome of planning, whatever it is, given up after so much of the processor [s]."""
    began = time.process_time()
    found, status, message = None, "planned", ""
    signal.signal(signal.SIGVTALRM, _give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, patience)
    try:
        try:
            found = call()
        except Infeasible as error:
            status, message = "infeasible", str(error)  # which takes time: it says what binds
        except AerobatError as error:
            status, message = "refused", str(error)
    except Exception as error:
        status, message = type(error).__name__, str(error)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return Attempted(found, status, message, time.process_time() - began)


def _give_up(number: int, frame: object) -> None:
    raise TimeoutError("no answer in the time of the processor that it was given")


def at_equal_reserve(name: str) -> str:
    """The name of a planner that keeps no reserve, as the MIQP by default."""
    return name + EQUAL_RESERVE


YARDSTICK = at_equal_reserve("time-optimal")
ALL_PLANNERS = (*PLANNERS, at_equal_reserve("free-knots"), YARDSTICK)


def planner_of(name: str, **settings: Any) -> Planner:
    """A planner as the command line makes it, or without any reserve."""
    if name.endswith(EQUAL_RESERVE):
        return planner_class(name.removesuffix(EQUAL_RESERVE))(**settings)
    cls: Any = planner_class(name)
    given = {o.name: o.command_default for o in planner_options(cls) if o.command_default is not None}
    return cls(**(given | settings))  # type: ignore[no-any-return]


def plan_facts(problem: Problem, vehicle: Vehicle, name: str) -> dict[str, Any]:
    """All that tables state of one planner's plan of a problem."""
    made = attempted(lambda: plan(problem, planner_of(name), vehicle))
    row: dict[str, Any] = {"status": made.status, "message": made.message, "seconds": made.seconds}
    if made.plan is None:
        return row
    row |= {
        "duration": made.plan.duration,
        "certified": made.plan.certified,
        "why": str(made.plan.certificate),
        "said": said_of_flight(made.plan),
    }
    if name.endswith(EQUAL_RESERVE):
        return row
    row["violation"], row["violated"] = worst_violation(made.plan, vehicle)
    if made.plan.certified:
        row["thrust_excess"], row["command_excess"] = rotor_excess(made.plan, vehicle)
    try:
        flight = fly(made.plan, vehicle)
    except AerobatError as error:
        return row | {"status": "not flown", "message": str(error)}
    error = np.linalg.norm(flight.states.position - flight.setpoint.flat.position, axis=-1)
    scored = score(flight, made.plan, vehicle)
    row |= {"error": float(error.max()), "outcome": scored.outcome.name, "sentence": scored.sentence}
    if isinstance(problem.maneuver, Flip | HalfFlip):
        row |= gate_attitude(made.plan, flight, vehicle)
    return row


def said_of_flight(found: Plan) -> str:
    """The words of a plan about its own flight where it does not follow its path."""
    return "" if found.flies else str(found.flyability)


def thrust(found: Plan, vehicle: Vehicle, times: Array, drag: bool = True) -> Array:
    """The thrust per mass that a path takes [m/s²], across the drag along it left out, (..., 3)."""
    environment = found.problem.environment
    airspeed = found.trajectory.evaluate(times, 1) - environment.wind
    lateral = vehicle.drag_body[:2].mean() / vehicle.mass if drag else 0.0
    return np.asarray(found.trajectory.evaluate(times, 2) + environment.weight + lateral * airspeed)


def gate_attitude(found: Plan, flight: Flight, vehicle: Vehicle) -> dict[str, float]:
    """The largest angle [deg] between thrust axis and upright of gates, in the plan and in its flight."""
    planned, flown, tolerances = [0.0], [0.0], [0.0]
    for stage in found.stages:
        if stage.gate is None:
            continue
        gate = found.problem.gate(stage.gate)
        planned.append(degrees_between(thrust(found, vehicle, np.array(stage.time)), gate.up))
        flown.append(degrees_between(axis_at_crossing(flight, gate, stage.time), gate.up))
        tolerances.append(float(np.rad2deg(gate.attitude_tolerance)))
    return {"planned_deg": max(planned), "flown_deg": max(flown), "tolerance_deg": max(tolerances)}


def axis_at_crossing(flight: Flight, gate: Gate, planned: float) -> Array:
    """The thrust axis where the flight crosses the gate's plane nearest the planned instant, (3,)."""
    times, ahead = flight.times, (flight.states.position - gate.position) @ gate.normal
    crossings = np.flatnonzero((ahead[:-1] < 0.0) & (ahead[1:] >= 0.0))
    near = crossings[np.abs(times[crossings] - planned) < CROSSING_WINDOW]
    k = int(np.argmin(np.abs(times - planned)))
    if len(near):
        k = int(near[np.argmin(np.abs(times[near] - planned))])
    return np.asarray(so3.thrust_axis(flight.states.q_world_body[k]))


def degrees_between(a: Array, b: Array) -> float:
    """The angle between two vectors [deg]."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def worst_violation(found: Plan, vehicle: Vehicle) -> tuple[float, str]:
    """The worst excess over limits, ground and `always` conditions in many samples, in SI units, and of what.

    Of thrust conditions the thrust with its drag counts.
    """
    problem, worst = found.problem, (0.0, "")
    sequence = problem.stages(vehicle.max_specific_thrust)
    for times in np.array_split(np.linspace(0.0, found.duration, SAMPLES), SAMPLES // CHUNK):
        for condition in sequence.path_constraints:
            values = quantity(found, vehicle, times, condition) @ condition.direction
            over = max(float(condition.lower - values.min()), float(values.max() - condition.upper))
            worst = max(worst, (over, f"always {condition.quantity.value}"))
        for derivative in range(4):
            lower, upper = problem.path_limits.of(derivative)
            if np.isinf(lower).all() and np.isinf(upper).all():
                continue
            values = found.trajectory.evaluate(times, derivative)
            over = float(np.maximum(lower - values, values - upper).max())
            worst = max(worst, (over, f"limits of derivative {derivative}"))
    return worst


def quantity(found: Plan, vehicle: Vehicle, times: Array, condition: Condition) -> Array:
    """The quantity that a condition is about, along a plan, (T, 3)."""
    if condition.quantity is Quantity.SPECIFIC_THRUST:
        return thrust(found, vehicle, times)
    return found.trajectory.evaluate(times, condition.quantity.derivative)


def rotor_excess(found: Plan, vehicle: Vehicle) -> tuple[float, float]:
    """The worst excess of rotor thrusts and of commands f + lag·f' in samples, in ranges of the rotor.

    Derivatives are differences of samples inside segments, where thrusts are smooth.
    """
    low, high, worst = vehicle.min_thrusts, vehicle.max_thrusts, np.full(2, -np.inf)
    inner = [
        np.linspace(begin, end, max(int((end - begin) * ROTOR_RATE), 5) + 2)[1:-1]
        for begin, end in pairwise(found.trajectory.knots)
    ]
    environment, times = found.problem.environment, np.concatenate(inner)
    along = reference(found.trajectory, vehicle, times, environment=environment).rotor_thrusts
    ends = np.cumsum([len(segment) for segment in inner])[:-1]
    for segment, thrusts in zip(inner, np.split(along, ends), strict=True):
        commands = thrusts + vehicle.lags * np.gradient(thrusts, segment, axis=0, edge_order=2)
        for i, values in enumerate((thrusts, commands[1:-1])):
            over = np.maximum(low - values, values - high) / (high - low)
            worst[i] = max(worst[i], float(over.max()))
    return float(worst[0]), float(worst[1])


def with_passage(problem: Problem, **changes: Any) -> Problem:
    """A flip or half-flip with another manner of passing its gate."""
    maneuver: Any = problem.maneuver
    passage = replace(maneuver.passage, **changes)
    return replace(problem, maneuver=replace(maneuver, passage=passage))
