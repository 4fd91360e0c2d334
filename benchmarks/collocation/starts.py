"""Starts of the program: other planners' plans, at their pace and at others, in a plane and in space."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import Infeasible
from aerobat.planning.courses import is_course
from aerobat.planning.gate_clearance import bodies_in_gates
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.planners import Planner
from aerobat.planning.polynomial.closed_forms import start_along_normals
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import Problem
from aerobat.problem.stage import StageSequence
from aerobat.trajectory.minimum_effort import ORDERS
from aerobat.vehicle import Vehicle
from collocation.start import Start

SLOWER = 1.5  # times the duration of a plan that knows no rotors
PACE_SPREAD = 0.4  # standard deviation of the logarithm of a phase's pace, where paces are drawn
SEED = 0
NEAR_PLANE = 0.05  # of a path's length: what leaves a plane by less may begin in it
ASIDE = 0.1  # of a path's length, by which it is bent out of its plane: symmetry is an optimum of its own


@dataclass(frozen=True, eq=False)
class Starts:
    """Motions to begin from, the likeliest first, and the plans among them that will do as they are."""

    motions: tuple[Start, ...]
    plans: tuple[Plan, ...]  # certified for the vehicle


def starts(task: Task, guess: Miqp, planar: bool, count: int, first: Plan | None) -> Starts:
    """So many motions to begin from; all in the maneuver's vertical plane where that is asked.

    Args:
        task: What is planned.
        guess: The mixed-integer planner that plans for the vehicle's rotors, then without.
        planar: Whether plans that lie in a plane keep to it.
        count: How many.
        first: A plan to begin with.

    Raises:
        Infeasible: A stage asks more thrust than the vehicle has.
    """
    sequence = task.stages
    in_gates = bodies_in_gates(task) if is_course(sequence) else ()
    if is_course(sequence):
        plans = [] if first is None else [(first, f"{first.planner}'s plan")]
        sources = [*_sources(plans, sequence), *_closed_forms(task)]
    else:
        plans = list(_plans(task.problem, task.vehicle, guess, first))
        sources = list(_sources(plans, sequence)) or list(_closed_forms(task))
    own = tuple(plan for plan, _ in plans if plan.certified and plan.vehicle == task.vehicle)
    motions = islice(_variations(sources, planar), count)
    return Starts(tuple(replace(start, in_gates=in_gates) for start in motions), own)


def _closed_forms(task: Task) -> Iterator[tuple[WarmStart, str]]:
    """Minimum-effort paths through the stages, stretched until rotors nearly follow them."""
    for order in (3, 4):
        yield start_along_normals(task, order), f"minimum {ORDERS[order]}"


def _sources(plans: Sequence[tuple[Plan, str]], sequence: StageSequence) -> Iterator[tuple[WarmStart, str]]:
    """Plans as starts; those that know no rotors also slower."""
    for plan, origin in plans:
        start = WarmStart.of(plan, sequence)
        yield start, origin
        if plan.vehicle is None:
            yield start.time_scaled(SLOWER), f"{origin}, slower"


def _plans(problem: Problem, vehicle: Vehicle, guess: Miqp, first: Plan | None) -> Iterator[tuple[Plan, str]]:
    """Plans with their origins, the likeliest first."""
    if first is not None:
        yield first, f"{first.planner}'s plan"
    for planner, rotors, origin in _planners(problem, guess, first):
        try:
            yield planner.plan(problem, vehicle if rotors else None), origin
        except Infeasible as infeasible:
            if not infeasible.attempts:  # refused at once, and whatever the planner
                raise


def _planners(problem: Problem, guess: Miqp, first: Plan | None) -> Iterator[tuple[Planner, bool, str]]:
    """Planners, whether they plan for the rotors, and what their plans are called.

    Where a plan is given to begin with, the MIQP plans for no rotors: that takes longer than all others.
    """
    guess = replace(guess, rescue=False)  # by others, which begin where this planner can itself
    if first is None:
        yield guess, True, "miqp's plan"
    if problem.maneuver.through_points:
        yield MinSnap(), True, "min-snap's plan"
    yield guess, False, "miqp's plan without a vehicle"


def _variations(sources: list[tuple[WarmStart, str]], planar: bool) -> Iterator[Start]:
    """Every source in the plane of one that lies in any, and in space; then at other paces, without end."""
    plane = next((plane for guess, _ in sources if (plane := guess.plane()) is not None), None)
    paced, rng = sources, np.random.default_rng(SEED)
    while sources:
        for guess, origin in paced:
            near = plane is not None and _distance(guess, plane) <= NEAR_PLANE * guess.extent
            if plane is not None and (near or planar):
                yield Start(guess, plane, np.zeros(3), f"{origin}, in a plane")
            if plane is None or not planar:
                aside = ASIDE * guess.extent * plane if plane is not None and near else np.zeros(3)
                yield Start(guess, None, aside, origin)
        paced = [
            (
                guess.at_other_pace(np.exp(rng.normal(0.0, PACE_SPREAD, len(guess.phases)))),
                f"{origin}, at another pace",
            )
            for guess, origin in sources
        ]


def _distance(start: WarmStart, normal: Array) -> float:
    """How far a path's segments lead from a plane through its start [m]."""
    points = start.trajectory.on_segments([0.0, 0.5, 1.0])
    return float(np.abs((points - points[0, 0]) @ normal).max())
