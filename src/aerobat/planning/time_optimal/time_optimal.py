"""The fastest motion that rotors can do: the paper's reference [1] approach, the yardstick for all others.

Full nonlinear dynamics (eqs. (3) and (4)) with limits on every rotor, through a maneuver's stages in their
order, each phase between them of free duration. The body never spins about its thrust axis, as flatness and
the controller have it, so that the trajectory is flown as it was planned.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification import Certificate, Side
from aerobat.environment import Environment
from aerobat.errors import Infeasible, SpecError
from aerobat.flatness import axial_drag, end_thrust
from aerobat.optimization.nonlinear import NonlinearResult, import_casadi, solve_nonlinear
from aerobat.planning.feasibility import RotorMargin, rotor_margin
from aerobat.planning.miqp import Miqp
from aerobat.planning.proof import certificate_for
from aerobat.planning.result import Attempt, PlacedStage, Plan
from aerobat.planning.tighten import SPARE, tightened
from aerobat.planning.time_optimal.initial_guess import initial_guess
from aerobat.planning.time_optimal.program import DERIVATIVES, Bounds, End, OptimalControl
from aerobat.planning.warm_start import WarmStart
from aerobat.problem.problem import EndState, Limits, Problem
from aerobat.problem.stage import Condition, Quantity
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

THRUST_FLOOR = 0.02  # of the most collective thrust: less is not asked, and the attitude stays determined
FREE_FALL = 1e-3  # of gravity: a specific thrust that gives an end no attitude
LEAST_INTERVALS = 4  # of a phase
ROUNDS = 6  # of solving, at most
THIN = 1e-6  # [m] to either side of a plane: equalities would repeat those of gates and waypoints in it
WARM = 1e-6  # the first barrier parameter of a solve that starts from a solution
LITTLE = 0.005  # [s] of lag, where thrusts that jump lead nowhere
SLOWED = 1.5  # how much longer a guess that knows no rotors takes
UP = np.array([0.0, 0.0, 1.0])

Progress = Callable[[Attempt], None]


@dataclass(frozen=True)
class TimeOptimal:
    """How to plan: so many `intervals` in all, shared among the phases, from the plan of `guess`.

    Each limit is used in full, which leaves nothing for a controller: `reserve`, a part of each rotor's range
    of thrust, is kept from either of its ends for it. One percent costs agile-quad's flips half a percent of
    time, and is what keeps flip-roll-translation within 6 mm of the plan, else 45 mm. A `planar` plan stays
    in the vertical plane of its guess, where that has one; in space there may be a faster one.
    """

    intervals: int = 60
    reserve: float = 0.0
    planar: bool = True
    iterations: int = 500  # at most, each solve
    guess: Miqp = field(default_factory=Miqp)

    def __post_init__(self) -> None:
        """Check."""
        if self.intervals < LEAST_INTERVALS:
            raise SpecError(f"intervals must be {LEAST_INTERVALS} or more, got {self.intervals}")
        if not 0.0 <= self.reserve < 0.5:
            raise SpecError(f"reserve must be a part of the range of thrust, 0 to 0.5, got {self.reserve}")
        if self.iterations < 1:
            raise SpecError(f"iterations must be 1 or more, got {self.iterations}")

    def plan(
        self, problem: Problem, vehicle: Vehicle | None = None, progress: Progress | None = None
    ) -> Plan:
        """The fastest motion near the guess, certified for the vehicle's limits and the problem's.

        Raises SpecError without a vehicle and for input that makes no sense, Infeasible when no motion is
        found that can be certified, BackendMissing without CasADi.
        """
        if vehicle is None:
            raise SpecError(
                "the time-optimal planner needs a vehicle: no limits, no least time; give --vehicle"
            )
        _check(problem, vehicle)
        import_casadi()
        attempts: list[Attempt] = []
        runs = (
            _Run(self, problem, flown, guess, attempts, progress)
            for guess in self._guesses(problem, vehicle)
            for flown in _smoother(vehicle)
        )
        for run in runs:
            if (found := run.certified()) is not None:
                return run.plan(found)
        raise Infeasible(
            f"no motion of '{problem.name}' was found that {vehicle.name} can do: at the last attempt "
            f"{attempts[-1].outcome}; ask less of its stages and limits, or give more intervals",
            attempts,
        )

    def _guesses(self, problem: Problem, vehicle: Vehicle) -> Iterator[WarmStart]:
        """The plan that the rotors can do; then one that knows of none, slowed down."""
        sequence = problem.stages(vehicle.max_specific_thrust)
        try:
            yield WarmStart.of(self.guess.plan(problem, vehicle), sequence)
        except Infeasible as infeasible:
            if not infeasible.attempts:  # a stage asks more thrust than there is
                raise
        yield WarmStart.of(self.guess.plan(problem), sequence).time_scaled(SLOWED)


@dataclass(frozen=True, eq=False)
class _Found:
    """A solution, and what it comes to."""

    x: Array
    phases: Array  # [s]
    trajectory: Trajectory
    margin: RotorMargin
    certificate: Certificate


@dataclass(frozen=True, eq=False)
class _Inside:
    """What is held at nodes, a little within what is asked everywhere."""

    limits: Limits
    below: float = 0.0  # [N] above the rotors' least thrusts
    above: float = 0.0  # [N] below their largest

    def tightened(self, found: _Found, asked: Limits, spare: float) -> _Inside:
        """Further within by what a solution exceeds, the rotors' thrusts by a `spare` [N] more."""
        low, high = (_unproven(found.certificate, side) for side in (Side.LEAST, Side.MOST))
        return _Inside(
            tightened(self.limits, asked, found.trajectory, DERIVATIVES),
            self.below + (spare + low if low > 0.0 else 0.0),
            self.above + (spare + high if high > 0.0 else 0.0),
        )


def _unproven(certificate: Certificate, side: Side) -> float:
    """By how much [N] the thrust of some rotor is not proven to stay on the right side of its limit."""
    rotors = (f for f in certificate.findings if f.quantity.startswith("rotor ") and f.side is side)
    return -min((f.margin for f in rotors if f.margin is not None), default=0.0)


class _Run:
    """The planner on one guess."""

    def __init__(
        self,
        config: TimeOptimal,
        problem: Problem,
        vehicle: Vehicle,
        guess: WarmStart,
        attempts: list[Attempt],
        progress: Progress | None,
    ) -> None:
        self._config, self._problem, self._vehicle, self._guess = config, problem, vehicle, guess
        self._attempts, self._progress = attempts, progress
        self._control = _control(config, problem, vehicle, guess)

    def certified(self) -> _Found | None:
        """Solve, and draw bounds at nodes in by what is exceeded between nodes, until nothing is."""
        mesh, inside, barrier = self._control.mesh, _Inside(self._problem.path_limits), None
        spare = SPARE * float(np.max(self._vehicle.max_thrusts - self._vehicle.min_thrusts))
        x = mesh.pack(initial_guess(self._guess, mesh, self._vehicle, self._problem.environment))
        for _ in range(ROUNDS):
            found = self._solved(x, inside, barrier)
            if found is None or found.certificate.certified:
                return found
            try:
                inside = inside.tightened(found, self._problem.path_limits, spare)
            except SpecError:  # nothing is left between limits
                return None
            x, barrier = found.x, WARM
        return None

    def plan(self, found: _Found) -> Plan:
        """The plan of a solution."""
        ends, times = np.cumsum(self._control.intervals), np.cumsum(found.phases)
        stages = tuple(
            PlacedStage(stage.name, end - 1, time, stage.gate)
            for stage, end, time in zip(self._guess.stages, ends.tolist(), times.tolist(), strict=False)
        )
        return Plan(
            problem=self._problem,
            trajectory=found.trajectory,
            planner="time-optimal",
            order=4,
            cost=found.trajectory.duration,
            status="locally optimal",
            backend="ipopt",
            stages=stages,
            attempts=tuple(self._attempts),
            vehicle=self._vehicle,
            margin=found.margin,
            certificate=found.certificate,
        )

    def _solved(self, x: Array, inside: _Inside, barrier: float | None) -> _Found | None:
        """The solution near x; None where there is none."""
        program = self._control.program(_bounds(self._vehicle, self._config.reserve, inside))
        answer = solve_nonlinear(program, x, max_iterations=self._config.iterations, initial_barrier=barrier)
        motion = self._control.mesh.read(answer.x)
        if not answer.converged:
            return self._record(answer, motion.phases, None, f"the solver {answer.status}")
        trajectory = self._control.of(motion).trajectory(self._problem.heading)
        margin = rotor_margin(trajectory, self._vehicle, self._problem.environment)
        certificate = certificate_for(trajectory, self._problem, self._vehicle)
        found = _Found(answer.x, motion.phases, trajectory, margin, certificate)
        outcome = "feasible" if certificate.certified else certificate.why
        return self._record(answer, motion.phases, found, outcome)

    def _record(
        self, answer: NonlinearResult, phases: Array, found: _Found | None, outcome: str
    ) -> _Found | None:
        duration, feasible = float(phases.sum()), found is not None and found.certificate.certified
        status, cost = ("unknown", None) if found is None else ("locally optimal", duration)
        attempt = Attempt(duration, feasible, status, outcome, cost, answer.iterations, answer.time)
        self._attempts.append(attempt)
        if self._progress is not None:
            self._progress(attempt)
        return found


def _smoother(vehicle: Vehicle) -> tuple[Vehicle, ...]:
    """The vehicle; if its rotors have no lag, next one of a little: thrusts that jump are harder to find."""
    if vehicle.lags.any():
        return (vehicle,)
    return vehicle, replace(vehicle, rotors=tuple(replace(rotor, lag=LITTLE) for rotor in vehicle.rotors))


def _control(config: TimeOptimal, problem: Problem, vehicle: Vehicle, guess: WarmStart) -> OptimalControl:
    """The optimal control through the stages in the guess's order."""
    sequence = problem.stages(vehicle.max_specific_thrust)
    start = _end(problem.start, vehicle, problem.environment)
    upright = so3.smallest_rotation(UP, start.thrust / np.linalg.norm(start.thrust))
    return OptimalControl(
        vehicle=vehicle,
        environment=problem.environment,
        intervals=guess.allocate_intervals(config.intervals, LEAST_INTERVALS),
        start=start,
        q_start=so3.multiply(upright, so3.about_axis(UP, np.array(problem.heading))),
        goal=_end(problem.goal, vehicle, problem.environment),
        stages=tuple(stage.conditions for stage in guess.stages),
        always=(*sequence.path_constraints, *(_within_plane(problem, guess) if config.planar else ())),
    )


def _within_plane(problem: Problem, guess: WarmStart) -> tuple[Condition, ...]:
    normal = guess.plane()
    if normal is None:
        return ()
    place = float(normal @ problem.start.position)
    return (Condition(Quantity.POSITION, normal, place - THIN, place + THIN),)


def _end(state: EndState, vehicle: Vehicle, environment: Environment) -> End:
    """What an end state asks of the thrust."""
    thrust = end_thrust(state.velocity, state.acceleration, vehicle, environment)
    size = float(np.linalg.norm(thrust))
    along = float(thrust @ (state.velocity - environment.wind)) / max(size, FREE_FALL)
    return End(state.position, state.velocity, thrust, vehicle.mass * (size + axial_drag(vehicle) * along))


def _bounds(vehicle: Vehicle, reserve: float, inside: _Inside) -> Bounds:
    kept = reserve * (vehicle.max_thrusts - vehicle.min_thrusts)
    return Bounds(
        vehicle.min_thrusts + kept + inside.below,
        vehicle.max_thrusts - kept - inside.above,
        float(max(vehicle.min_thrusts.sum(), THRUST_FLOOR * vehicle.max_thrusts.sum())),
        inside.limits,
    )


def _check(problem: Problem, vehicle: Vehicle) -> None:
    """Refuse what cannot be asked of this planner."""
    if np.isfinite(problem.path_limits.of(DERIVATIVES)[1]).any():
        raise SpecError(
            "limits.crackle cannot be held by the time-optimal planner, whose moments jump; drop it"
        )
    for name, state in (("start", problem.start), ("goal", problem.goal)):
        if np.linalg.norm(_end(state, vehicle, problem.environment).thrust) < (
            FREE_FALL * problem.environment.gravity
        ):
            raise SpecError(
                f"{name}.acceleration asks no thrust, which leaves the attitude there open; change it"
            )
