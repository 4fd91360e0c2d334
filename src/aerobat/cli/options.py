"""The commands' options, each with what its help says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Group, Parameter, validators

planning = Group("Planning", sort_key=1)
flying = Group("Flying", sort_key=2)
limiting = Group("Limits", sort_key=2)
output = Group("Output", sort_key=3)

Positive = validators.Number(gt=0)
PlannerName = Literal["miqp", "min-snap", "free-knots", "time-optimal"]


@dataclass(frozen=True, kw_only=True)
class TaskOptions:
    """What is flown and what flies, and where results go."""

    vehicle: Annotated[str | None, Parameter(group=planning)] = None
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file. Default: agile-quad, or hexarotor
    with --paper."""

    angle: Annotated[float | None, Parameter(group=planning)] = None
    """The tilt of a half-flip's gate in degrees, -90 to 90, to the right when positive."""

    out: Annotated[Path | None, Parameter(group=output)] = None
    """The folder to write to. Default: out/PROBLEM."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the report as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class PlanningOptions(TaskOptions):
    """Options of all commands that plan once."""

    planner: Annotated[PlannerName, Parameter(group=planning)] = "miqp"
    """How to plan: miqp, the paper's mixed-integer program (Section II); min-snap, its closed-form
    polynomials with a line search on their times (Section V); free-knots, such polynomials at the rotors'
    limits; time-optimal, the full nonlinear dynamics at the rotors' limits. The last two need the extra
    casadi."""

    order: Annotated[int | None, Parameter(group=planning)] = None
    """miqp: the derivative that is piecewise constant, 3 jerk (the paper's), 4 snap, 5 crackle; default 4, or
    3 with --paper. min-snap: the derivative whose square is minimized, 3 to 5; default 5, degree 9."""

    intervals: Annotated[int | None, Parameter(group=planning)] = None
    """miqp: N, the number of intervals. Default: 20."""

    backend: Annotated[str | None, Parameter(group=planning)] = None
    """miqp: the solver, builtin, gurobi or scip (the last two are optional extras). Default: builtin."""

    time_limit: Annotated[float | None, Parameter(group=planning)] = None
    """miqp: seconds for each program; the best plan found by then is taken and its gap reported."""

    stop_after: Annotated[int | None, Parameter(group=planning)] = None
    """min-snap: stop the search at this attempt, whether the vehicle can fly it or not (paper, Fig. 10)."""

    segments: Annotated[int | None, Parameter(group=planning)] = None
    """free-knots: how many polynomial segments. The default, 2, is quick and leaves something to the
    controller; 8 come closer to time-optimal."""

    reserve: Annotated[float | None, Parameter(group=planning)] = None
    """free-knots, time-optimal: the part of each rotor's range of thrust that is kept from either of its ends
    for the controller. Default: 0, or 0.03 with time-optimal, which with 0 is a yardstick that no controller
    follows for sure."""

    in_space: Annotated[bool, Parameter(group=planning, negative="", show_default=False)] = False
    """time-optimal: leave the maneuver's vertical plane where that is faster."""

    paper: Annotated[bool, Parameter(group=planning, negative="", show_default=False)] = False
    """Exactly the paper's formulation with its reference parameters: order 3, bounds per axis, unsigned and
    unordered stages, dt the first feasible of 50 steps from 0.1 to 4 s, no vehicle in planning."""


@dataclass(frozen=True, kw_only=True)
class FlyingOptions:
    """Options of the flight."""

    noise: Annotated[float, Parameter(group=flying, validator=validators.Number(gte=0))] = 0.0
    """The error of the state that the controller sees: 0 none, 1 that of motion capture and IMU fused."""

    seed: Annotated[int, Parameter(group=flying, validator=validators.Number(gte=0))] = 0
    """The seed of that noise: the same seed, the same flight."""


@dataclass(frozen=True, kw_only=True)
class CheckOptions:
    """What a trajectory is checked for, beyond its vehicle's rotors."""

    vehicle: Annotated[str, Parameter(group=limiting)] = "agile-quad"
    """The vehicle: a name that `aerobat vehicles` lists, or a TOML file."""

    heading: Annotated[float | None, Parameter(group=limiting)] = None
    """The heading at the start in degrees, carried along the path without spin. Default: the
    file's own, 0 of a CSV file."""

    rate: Annotated[float, Parameter(group=limiting, validator=Positive)] = 100.0
    """Rows a second of a CSV file without times."""

    max_speed: Annotated[float | None, Parameter(group=limiting, validator=Positive)] = None
    """The greatest speed allowed, m/s."""

    max_tilt: Annotated[float | None, Parameter(group=limiting, validator=Positive)] = None
    """The greatest tilt allowed, degrees from upright."""

    max_rate: Annotated[float | None, Parameter(group=limiting, validator=Positive)] = None
    """The greatest body rate allowed, degrees a second."""

    max_moment: Annotated[float | None, Parameter(group=limiting, validator=Positive)] = None
    """The greatest moment allowed, N m."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the certificate as JSON on standard output, and nothing else."""
