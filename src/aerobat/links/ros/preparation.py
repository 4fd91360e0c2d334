"""Planning for a node, in a process of its own so that goals are not delayed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.errors import AerobatError, Infeasible, SpecError
from aerobat.interchange.exports.crazyflie import Pieces, fitted_pieces
from aerobat.links.mission import require_flyable
from aerobat.links.stream import SetpointStream
from aerobat.planning import Plan, Planner, plan
from aerobat.problem import Problem, at_rest
from aerobat.simulation.autopilot import recoveries
from aerobat.vehicle import Vehicle

# the paper's services, and the built-in problems that they fly
MANEUVERS = {
    "line": "line",
    "flip": "flip-roll",
    "flip_pitch": "flip-pitch",
    "flip_trans": "flip-roll-translation",
    "window": "half-flip",
}


@dataclass(frozen=True)
class ManeuverRequest:
    """A request for a plan: the problem, the planner, and the vehicle's hover."""

    problem: Problem
    vehicle: Vehicle
    planner: Planner
    position: Array  # [m] of the hovering vehicle, (3,)
    yaw: float  # [rad] of the hovering vehicle
    ground: float  # [m] the height of the ground
    in_world: bool  # whether gates and goal keep their world positions; else they move with the start
    in_pieces: bool = False  # whether a Crazyflie flies the plan by itself


@dataclass(frozen=True, eq=False)
class Prepared:
    """A plan that is ready to be flown."""

    plan: Plan
    stream: SetpointStream  # from where the vehicle hovers
    announcement: str
    pieces: Pieces | None = None  # for a Crazyflie that flies them by itself, from the plan's origin


def shared_gravity(problems: Iterable[Problem]) -> float:
    """Return the gravity of problems [m/s²]; without problems, the Earth's.

    Raises SpecError where they differ: routes, hovers and a board's thrusts are computed for one gravity.
    """
    names = {problem.environment.gravity: problem.name for problem in problems}
    if len(names) > 1:
        found = " and ".join(f"'{name}' has {gravity:g} m/s²" for gravity, name in names.items())
        raise SpecError(f"a vehicle flies in one gravity, but {found}; name problems of one gravity")
    return next(iter(names), Environment().gravity)


def prepare(request: ManeuverRequest) -> Prepared | str:
    """Return the plan from where the vehicle hovers, or a sentence that says why there is none."""
    try:
        return _prepared(request)
    except Infeasible as error:
        return error.sentence
    except AerobatError as error:
        return str(error)


def _prepared(request: ManeuverRequest) -> Prepared:
    problem, offset = _from_here(request)
    found = plan(problem, request.planner, request.vehicle)
    height = offset - (0.0, 0.0, request.ground)
    require_flyable(found, height)
    way_back = recoveries(found, ground=-float(height[2]))
    if way_back.no_return:
        raise SpecError(f"{way_back}; climb, or raise its gates")
    through = f" through {len(problem.gates)} gate(s)" if problem.gates else ""
    announcement = f"'{problem.name}' in {found.duration:.2f} s{through}, {found.planner}; {way_back}"
    assert found.vehicle is not None, "it was planned for one"
    stream = SetpointStream(found.trajectory, found.vehicle, problem.environment, offset)
    pieces = fitted_pieces(found)[0] if request.in_pieces else None
    return Prepared(found, stream, announcement, pieces)


def _from_here(request: ManeuverRequest) -> tuple[Problem, Array]:
    """Return the problem from where the vehicle hovers, and the position of its origin in the world [m]."""
    problem = replace(request.problem, heading=replace(request.problem.heading, start=request.yaw))
    if request.in_world:
        return replace(problem, start=at_rest(request.position)), np.zeros(3)
    offset = request.position - problem.start.position
    if problem.environment.ground is None:
        return problem, offset
    below = request.ground - float(offset[2])
    return replace(problem, environment=replace(problem.environment, ground=below)), offset
