"""The optimal control on a mesh as a program that can be solved, tightened and solved again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Solution
from aerobat.planning.passages import PlacedStage, place_stages
from aerobat.planning.warm_start import WarmStart
from aerobat.trajectory import Trajectory
from collocation.nonlinear import NonlinearResult, solve_nonlinear
from collocation.optimal_control.boundary import FixedEnds
from collocation.optimal_control.bounds import Backoff
from collocation.optimal_control.collocation import (
    CollocatedMotion,
    CollocationMesh,
    trajectory_of,
)
from collocation.optimal_control.elements import Elements
from collocation.optimal_control.program import OptimalControl
from collocation.start import Start, initial_motion

# times the reserve, of the largest collective thrust, at least: feedback turns a small thrust by a lot
THRUST_RESERVE = 3.0
WARM_BARRIER = 1e-6  # the first barrier parameter of a solve that starts from a solution


@dataclass(frozen=True, eq=False)
class SolvedMotion:
    """The motion at which a solve ended, with the program that was solved."""

    program: CollocatedProgram
    motion: CollocatedMotion
    answer: NonlinearResult

    @property
    def trajectory(self) -> Trajectory:
        """The motion's trajectory."""
        elements = self.program.control.elements
        mesh, heading = self.program.mesh, elements.task.problem.heading.start
        return trajectory_of(elements.body, mesh, self.motion, heading)

    @property
    def placed(self) -> tuple[PlacedStage, ...]:
        """When the motion passes its stages."""
        stages = self.program.control.stages
        latest = np.cumsum(self.program.mesh.intervals) - 1
        times = np.cumsum(self.motion.phases)
        return place_stages(stages, latest[: len(stages)].tolist(), times[: len(stages)].tolist())

    @property
    def failure(self) -> str:
        """The outcome of a solve that did not converge, in words, with the leg that is violated most."""
        return f"the solver {self.answer.status}, {self._worst_leg}"

    @property
    def _worst_leg(self) -> str:
        """The leg with the unknowns of the constraint that is violated most, in words."""
        mesh, program = (
            self.program.mesh,
            self.program.control.program(self.program.mesh, self.program.backoff),
        )
        g = np.asarray(program.values(self.answer.x)[1], dtype=float).reshape(-1)
        excess = np.nan_to_num(np.maximum(program.lower - g, g - program.upper), nan=np.inf)
        rows, columns = map(np.array, program.derivatives["jac_g"].sparsity_out(1).get_triplet())
        legs = mesh.leg_of_unknowns[columns[rows == int(np.argmax(excess))]]
        leg = int(legs.max(initial=0))
        names = ["the start", *(f"'{stage.name}'" for stage in self.program.control.stages), "the goal"]
        return f"worst on the leg from {names[leg]} to {names[leg + 1]}"

    @property
    def start(self) -> Start:
        """The motion as a start of other programs."""
        start = self.program.start
        times = tuple(np.cumsum(self.motion.phases)[:-1].tolist())
        guess = WarmStart(self.trajectory, start.guess.stages, times)
        return replace(start, guess=guess, aside=np.zeros(3))


class CollocatedProgram:
    """The optimal control from a start on a mesh, its bounds at nodes as tight as what lies between needs.

    Args:
        elements: Of the program's functions.
        start: The motion to begin from.
        reserve: Of each rotor's range, kept from either of its ends.
        mesh: The phases and their intervals.
        max_iterations: Of each solve.
        tolerance: Of each solve, on the scaled optimality conditions.
        barrier: The first barrier parameter; None is the solver's own, a small one keeps near the start.
    """

    def __init__(
        self,
        elements: Elements,
        start: Start,
        reserve: float,
        mesh: CollocationMesh,
        max_iterations: int,
        tolerance: float = 1e-8,
        barrier: float | None = None,
    ) -> None:
        self.control, self.start, self.mesh = optimal_control(elements, start, reserve), start, mesh
        self.duration = start.guess.trajectory.duration  # [s] of the start, or of what was solved ahead
        self._max_iterations, self._tolerance = max_iterations, tolerance
        self.backoff = Backoff.none(self.mesh.total, elements.bounds)
        self._barrier = barrier
        self._multipliers: tuple[Array, Array] | None = None
        self._x = self.mesh.pack(initial_motion(start, self.mesh, elements.task))
        self._ahead: Solution[SolvedMotion] | None = None

    def solve_ahead(self) -> None:
        """Solve, and keep the solution for the next `solve`; the duration is infinite where there is none."""
        self._ahead = self.solve()
        self.duration = np.inf if self._ahead.trajectory is None else self._ahead.duration

    def solve(self) -> Solution[SolvedMotion]:
        """The solution near the last one, or near the start."""
        if self._ahead is not None:
            ahead, self._ahead = self._ahead, None
            return ahead
        solved = self.solved()
        answer, duration = solved.answer, float(solved.motion.phases.sum())
        return Solution(
            source=solved,
            duration=duration,
            trajectory=solved.trajectory if answer.converged else None,
            status="locally optimal" if answer.converged else "unknown",
            nodes=answer.iterations,
            solve_time=answer.time,
            cost=duration if answer.converged else None,
            failure=None if answer.converged else solved.failure,
        )

    def solved(self) -> SolvedMotion:
        """The motion that the solver ends at, whether converged or not."""
        answer = solve_nonlinear(
            self.control.program(self.mesh, self.backoff),
            self._x,
            max_iterations=self._max_iterations,
            tolerance=self._tolerance,
            initial_barrier=self._barrier,
            multipliers=self._multipliers,
        )
        return SolvedMotion(self, self.mesh.read(answer.x), answer)

    def tighten(self, solution: Solution[SolvedMotion], certificate: Certificate | None) -> bool:
        """Tighten what is held at nodes by what is exceeded between them, and go on from the solution."""
        if solution.trajectory is None or certificate is None or out_of_time():
            return False
        control = self.control
        backoff = self.backoff.grown(control.elements.bounds, solution.trajectory, control.reserve)
        if backoff is None:
            return False
        answer = solution.source.answer
        self.backoff, self._barrier = backoff, WARM_BARRIER
        self._x, self._multipliers = answer.x, answer.multipliers
        return True


def optimal_control(elements: Elements, start: Start, reserve: float) -> OptimalControl:
    """The optimal control through the stages in the order of a start, a reserve kept from rotors' limits."""
    kept = THRUST_RESERVE * reserve * elements.task.vehicle.max_specific_thrust
    floor = max(elements.bounds.floor.lower, kept)
    boundary = FixedEnds(elements)
    return OptimalControl(
        elements=elements,
        boundary=boundary,
        stages=start.guess.stages,
        in_gates=start.in_gates,
        min_thrust=boundary.thrust_floor(floor),
        reserve=reserve,
    )
