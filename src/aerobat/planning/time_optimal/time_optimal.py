"""The fastest motion that rotors can do: the paper's reference [1] approach, the yardstick for all others.

Full nonlinear dynamics (eqs. (3) and (4)) with limits on every rotor, through a maneuver's stages in their
order, each phase between them of free duration. The body never spins about its thrust axis, as flatness and
the controller have it, so that the trajectory is flown as it was planned.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification import Certificate, Side
from aerobat.declaration import Count
from aerobat.environment import Environment
from aerobat.errors import Infeasible, SpecError
from aerobat.flatness import axial_drag, end_thrust, reference
from aerobat.optimization.nonlinear import import_casadi, solve_nonlinear
from aerobat.planning.certified_solve import Judged, Solution, certified_solve, tightened
from aerobat.planning.miqp import Miqp
from aerobat.planning.planners import Planner, option, planner
from aerobat.planning.recorder import Progress, Recorder
from aerobat.planning.result import PlacedStage, Plan
from aerobat.planning.rotor_margin import rotor_findings
from aerobat.planning.time_optimal.collocation import CollocatedMotion, Mesh
from aerobat.planning.time_optimal.program import BOUNDED_DERIVATIVES, End, NodeBounds, OptimalControl
from aerobat.planning.warm_start import Reserve, WarmStart, plans_to_begin_from, require_attitudes
from aerobat.problem.condition import Condition, Quantity
from aerobat.problem.problem import EndState, Limits, Problem
from aerobat.so3 import UP
from aerobat.vehicle import Vehicle

THRUST_FLOOR = 0.02  # of the largest collective thrust: more, and the attitude stays determined
MIN_INTERVALS = 4  # of a phase
ROUNDS = 6  # of solving, at most
ROTOR_BACKOFF = 1e-4  # of the largest range of thrust: how much more than was exceeded rotors keep at nodes
PLANE_TOLERANCE = 1e-6  # [m] to either side of it: equalities would repeat those of gates and waypoints in it
WARM_BARRIER = 1e-6  # the first barrier parameter of a solve that starts from a solution
SMOOTHING_LAG = 0.005  # [s] that rotors without lag are given, where thrusts that jump lead nowhere
GUESS_SCALE = 1.5  # how much longer a guess that knows no rotors takes


@planner("time-optimal")
class TimeOptimal(Planner):
    """The full nonlinear dynamics at the rotors' limits; needs the extra casadi.

    So many `intervals` in all are allocated to the phases, starting from the plan of `guess`. Each limit is
    used in full, which leaves nothing for a controller: `reserve`, a fraction of each rotor's range of
    thrust, is kept from either of its ends for it. One percent costs agile-quad's flips half a percent of
    time, and is what keeps flip-roll-translation within 6 mm of the plan, else 45 mm. A `planar` plan stays
    in the vertical plane of its guess, where that has one; in space there may be a faster one.
    """

    intervals: Annotated[int, Field(ge=MIN_INTERVALS)] = 60
    reserve: Reserve = option(
        0.0,
        "The fraction of each rotor's range of thrust that is kept from either of its ends for the "
        "controller; with 0 a time-optimal plan is a yardstick that no controller follows for sure.",
        command_default=0.03,
    )
    planar: bool = option(True, "Leave the maneuver's vertical plane where that is faster.", off="in_space")
    iterations: Count = 500  # at most, each solve
    guess: Miqp = field(default_factory=Miqp)

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest motion near the guess, certified for the vehicle's limits and the problem's.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when no motion is
        found that can be certified, BackendMissing without CasADi.
        """
        vehicle = require_attitudes("time-optimal", problem, vehicle)
        if np.isfinite(problem.path_limits.of(BOUNDED_DERIVATIVES)[1]).any():
            raise SpecError(
                "limits.crackle cannot be held by the time-optimal planner, whose moments jump; drop it"
            )
        import_casadi()
        recorder = Recorder(progress)
        for guess in self._guesses(problem, vehicle):
            for body in _with_smoother(vehicle):
                program = _CollocatedProgram(self, problem, body, guess)
                found = certified_solve(program, problem, vehicle, recorder, ROUNDS)
                if found.feasible:
                    return self._result(found, guess, program.control.intervals, recorder)
        raise Infeasible(
            f"no motion of '{problem.name}' was found that {vehicle.name} can do: at the last attempt "
            f"{recorder.attempts[-1].outcome}; ask less of its stages and limits, or give more intervals",
            recorder.attempts,
        )

    def _guesses(self, problem: Problem, vehicle: Vehicle) -> Iterator[WarmStart]:
        """The plan that the rotors can do; then one that knows of none, made longer."""
        sequence = problem.stages(vehicle.max_specific_thrust)
        for plan in plans_to_begin_from([self.guess], problem, vehicle):
            yield WarmStart.of(plan, sequence)
        yield WarmStart.of(self.guess.plan(problem), sequence).time_scaled(GUESS_SCALE)

    def _result(
        self, found: Judged[_Point], guess: WarmStart, intervals: tuple[int, ...], recorder: Recorder
    ) -> Plan:
        ends, times = np.cumsum(intervals).tolist(), np.cumsum(found.solution.source.phases).tolist()
        stages = zip(guess.stages, ends, times, strict=False)
        return found.plan(
            recorder,
            planner="time-optimal",
            order=4,
            status="locally optimal",
            backend="ipopt",
            stages=tuple(PlacedStage(s.name, end - 1, time, s.gate) for s, end, time in stages),
        )


@dataclass(frozen=True, eq=False)
class _Point:
    """Where a solve ended."""

    x: Array  # the unknowns
    phases: Array  # [s]


@dataclass(frozen=True, eq=False)
class _TightenedBounds:
    """Bounds held at nodes, a little within what shall hold everywhere."""

    limits: Limits
    low_backoff: float = 0.0  # [N] above the rotors' least thrusts
    high_backoff: float = 0.0  # [N] below their largest


class _CollocatedProgram:
    """The optimal control near one guess, with bounds at nodes as tight as what lies between needs."""

    def __init__(self, config: TimeOptimal, problem: Problem, vehicle: Vehicle, guess: WarmStart) -> None:
        self.control = _control(config, problem, vehicle, guess)
        self._config, self._problem, self._vehicle = config, problem, vehicle
        self._bounds = _TightenedBounds(problem.path_limits)
        self._barrier: float | None = None
        motion = initial_guess(guess, self.control.mesh, vehicle, problem.environment)
        self._x = self.control.mesh.pack(motion)

    def solve(self) -> Solution[_Point]:
        """The solution near the last one, or near the guess."""
        program = self.control.program(self._node_bounds())
        answer = solve_nonlinear(
            program, self._x, max_iterations=self._config.iterations, initial_barrier=self._barrier
        )
        motion = self.control.mesh.read(answer.x)
        duration = float(motion.phases.sum())
        trajectory = self.control.of(motion).trajectory(self._problem.heading) if answer.converged else None
        return Solution(
            source=_Point(answer.x, motion.phases),
            duration=duration,
            trajectory=trajectory,
            status="locally optimal" if answer.converged else "unknown",
            nodes=answer.iterations,
            solve_time=answer.time,
            cost=duration if answer.converged else None,
            failure=None if answer.converged else f"the solver {answer.status}",
        )

    def tighten(self, solution: Solution[_Point], certificate: Certificate | None) -> bool:
        """Tighten what is held at nodes by what is exceeded between them, and go on from the solution."""
        if solution.trajectory is None or certificate is None:
            return False
        limits = self._problem.path_limits
        limits_at_nodes = tightened(self._bounds.limits, limits, solution.trajectory, BOUNDED_DERIVATIVES)
        if limits_at_nodes is None:
            return False
        more = ROTOR_BACKOFF * float(np.max(self._vehicle.max_thrusts - self._vehicle.min_thrusts))
        low, high = (_excess(certificate, side) for side in (Side.MIN, Side.MAX))
        self._bounds = _TightenedBounds(
            limits_at_nodes,
            self._bounds.low_backoff + (more + low if low > 0.0 else 0.0),
            self._bounds.high_backoff + (more + high if high > 0.0 else 0.0),
        )
        self._x, self._barrier = solution.source.x, WARM_BARRIER
        return True

    def _node_bounds(self) -> NodeBounds:
        low, high = self._vehicle.min_thrusts, self._vehicle.max_thrusts
        reserve = self._config.reserve * (high - low)
        return NodeBounds(
            low + reserve + self._bounds.low_backoff,
            high - reserve - self._bounds.high_backoff,
            float(max(low.sum(), THRUST_FLOOR * high.sum())),
            self._bounds.limits,
        )


def initial_guess(
    guess: WarmStart, mesh: Mesh, vehicle: Vehicle, environment: Environment
) -> CollocatedMotion:
    """States and inputs of the vehicle along a guess at the mesh's nodes, inputs within twice their scale."""
    knots = np.concatenate([[0.0], np.cumsum(guess.phases @ mesh.fractions)])
    times = np.minimum(knots, guess.trajectory.duration)
    setpoint = reference(guess.trajectory, vehicle, times, environment=environment).setpoint
    flat, rates = setpoint.flat, setpoint.omega_body[:, :2]
    states = np.concatenate([flat.position, flat.velocity, setpoint.q_world_body, rates], axis=1).T
    inputs = np.concatenate([setpoint.wrench.thrust[:, None], setpoint.omega_dot_body[:, :2]], axis=1).T
    bound = 2.0 * mesh.input_scale[:, None]
    inputs = np.clip(inputs, -bound, bound)
    return CollocatedMotion(guess.phases, states, inputs[:, :-1], inputs[:, 1:])


def _excess(certificate: Certificate, side: Side) -> float:
    """By how much [N] the thrust of some rotor is not proven to stay on the right side of its limit."""
    return -min((f.margin for f in rotor_findings(certificate, side) if f.margin is not None), default=0.0)


def _with_smoother(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """The vehicle; if its rotors have no lag, next one of a little: thrusts that jump are harder to find."""
    if vehicle.lags.any():
        return (vehicle,)
    rotors = tuple(replace(rotor, lag=SMOOTHING_LAG) for rotor in vehicle.rotors)
    return vehicle, replace(vehicle, rotors=rotors)


def _control(config: TimeOptimal, problem: Problem, vehicle: Vehicle, guess: WarmStart) -> OptimalControl:
    """The optimal control through the stages in the guess's order."""
    sequence = problem.stages(vehicle.max_specific_thrust)
    start = _end(problem.start, vehicle, problem.environment)
    upright = so3.smallest_rotation(UP, start.thrust / np.linalg.norm(start.thrust))
    return OptimalControl(
        vehicle=vehicle,
        environment=problem.environment,
        intervals=guess.allocate_intervals(config.intervals, MIN_INTERVALS),
        start=start,
        q_start=so3.multiply(upright, so3.about_axis(UP, np.array(problem.heading))),
        goal=_end(problem.goal, vehicle, problem.environment),
        stages=tuple(stage.conditions for stage in guess.stages),
        path_constraints=(
            *sequence.path_constraints,
            *(_within_plane(problem, guess) if config.planar else ()),
        ),
    )


def _within_plane(problem: Problem, guess: WarmStart) -> tuple[Condition, ...]:
    normal = guess.plane()
    if normal is None:
        return ()
    place = float(normal @ problem.start.position)
    lower, upper = place - PLANE_TOLERANCE, place + PLANE_TOLERANCE
    return (Condition(Quantity.POSITION, normal, lower, upper),)


def _end(state: EndState, vehicle: Vehicle, environment: Environment) -> End:
    """Thrust that an end state asks for."""
    thrust = end_thrust(state.velocity, state.acceleration, vehicle, environment)
    norm = float(np.linalg.norm(thrust))
    along = float(thrust @ (state.velocity - environment.wind)) / norm
    return End(state.position, state.velocity, thrust, vehicle.mass * (norm + axial_drag(vehicle) * along))
