"""References that the controller tracks, computed on demand in blocks of ticks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.engine import read_only
from aerobat.engines.pytree import Tree, components, tree_map
from aerobat.environment import Environment
from aerobat.flatness.inverse_dynamics import axial_drag, force_balance, has_unequal_drag
from aerobat.flatness.references import reference
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.simulation.loop import Due, StepClock, due_ticks
from aerobat.simulation.nested import joined, rows_of
from aerobat.states import BodyState, Setpoint
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

BLOCK = 4096  # ticks; blocks begin at multiples, so that chunk sizes do not change a bit of a reference


@dataclass(frozen=True)
class ReferenceSource:
    """The set-points of a trajectory for a nominal vehicle, at the ticks of a loop."""

    trajectory: Trajectory
    vehicle: Vehicle  # the nominal one
    environment: Environment
    rate: float  # [1/s] of the ticks
    every: int = 1  # ticks from one step of the controller to the next
    delay: float = 0.0  # [s] until commands take effect; set-points are those of `delay` later

    @cached_property
    def times(self) -> Array:
        """The instants of the ticks [s], (ticks,)."""
        return self.trajectory.sample(self.rate)

    @property
    def start(self) -> BodyState:
        """The state of a vehicle that starts without error, no leading axis."""
        first = self.setpoint(np.array([0]))
        return BodyState(
            first.flat.position[0], first.flat.velocity[0], first.q_world_body[0], first.omega_body[0]
        )

    @property
    def max_rate(self) -> float:
        """The largest rate [rad/s] of the reference about any axis of the body."""
        return float(np.abs(self.setpoint(np.arange(len(self.times))).omega_body).max())

    def setpoint(self, ticks: NDArray[np.intp]) -> Setpoint:
        """Return the set-points of some ticks, in rising order."""
        in_blocks = np.split(ticks, np.flatnonzero(np.diff(ticks // BLOCK)) + 1)
        parts = [rows_of(_block(self, int(each[0]) // BLOCK).setpoint, each % BLOCK) for each in in_blocks]
        return joined(parts)

    def chunk(self, begin: int, end: int) -> ReferencePoint:
        """Return the controller's references at the ticks from `begin` to before `end`, within one block."""
        number, first = divmod(begin, BLOCK)
        rows = slice(first, first + end - begin)
        points: ReferencePoint = tree_map(lambda leaf: leaf[rows], _block(self, number).points)
        return points

    def clock(self, begin: int, end: int, every: int = 1) -> StepClock:
        """Return the step clock at ticks from `begin` to before `end` of components with period `every`.

        All periods but the last are equal to the last bit, so that an engine can detect that they are.
        """
        steps = np.arange(begin, end) // every
        return StepClock(
            self._period_after(np.maximum(steps - 1, 0), every), self._period_after(steps, every)
        )

    def due(self, every: int, begin: int, end: int) -> Due:
        """Return at which of these ticks a component with period `every` steps, and its step clock."""
        return Due(due_ticks(every, begin, end), self.clock(begin, end, every))

    def _period_after(self, steps: NDArray[np.intp], every: int) -> Array:
        """Return the period [s] that begins with each step; the last step begins none."""
        final = len(self.times) - 1
        begins = np.minimum(steps * every, final)
        ends = np.minimum(begins + every, final)
        whole = ends < final
        return np.where(whole, every * (1.0 / self.rate), self.times[ends] - self.times[begins])


@dataclass(frozen=True, eq=False)
class _Block:
    """Set-points of the ticks of a block."""

    setpoint: Setpoint
    points: ReferencePoint  # the set-points as kernels read them, leaves (ticks,), read-only


@lru_cache(maxsize=16)  # of 2 MB each: the flights of a study share a few plans, whatever else they draw
def _block(source: ReferenceSource, number: int) -> _Block:
    """Return the block with this number of a source."""
    grid, every = source.times, source.every
    vehicle, environment = source.vehicle, source.environment
    first, last = number * BLOCK, len(grid) - 1
    ticks = min(BLOCK, len(grid) - first)
    known = grid[np.minimum(np.arange(first, first + ticks + every), last)]
    times = np.minimum(known + source.delay, grid[last])
    rows = reference(source.trajectory, vehicle, times, environment=environment).setpoint
    setpoint, following = rows_of(rows, slice(ticks)), np.arange(every, every + ticks)
    points = reference_points(setpoint, rows_of(rows, following), environment, vehicle)
    return _Block(setpoint, tree_map(read_only, points))


def reference_points(
    setpoint: Setpoint, following: Setpoint, environment: Environment, vehicle: Vehicle
) -> ReferencePoint:
    """Return set-points as kernels read them.

    Args:
        setpoint: at ticks, leading axis (ticks,).
        following: the set-points one step of the controller later.
        environment: of which gravity and wind are used.
        vehicle: the nominal vehicle, of which mass and drag are used.
    """
    flat, q = setpoint.flat, setpoint.q_world_body

    def in_world(rate_body: Array) -> Tree:
        return components(so3.rotate(q, rate_body))

    return ReferencePoint(
        components(flat.position),
        components(flat.velocity),
        components(flat.acceleration + environment.weight),
        components(flat.jerk),
        components(q),
        in_world(setpoint.omega_body),
        in_world(setpoint.omega_dot_body),
        Lookahead(
            _specific_collective(following, environment, vehicle)
            - _specific_collective(setpoint, environment, vehicle),
            in_world(following.omega_body),
            in_world(following.omega_dot_body),
        ),
    )


def _specific_collective(setpoint: Setpoint, environment: Environment, vehicle: Vehicle) -> Array:
    """Return collective thrust over mass [m/s²], (ticks,): without drag the same for vehicles of any mass."""
    if has_unequal_drag(vehicle):
        return setpoint.wrench.thrust / vehicle.mass
    flat = setpoint.flat
    thrust = force_balance(environment, vehicle).specific_thrust(flat.velocity, flat.acceleration)
    airspeed = flat.velocity - environment.wind
    along = np.sum(so3.thrust_axis(setpoint.q_world_body) * airspeed, axis=-1)
    return np.asarray(np.linalg.norm(thrust, axis=-1) + axial_drag(vehicle) * along)
