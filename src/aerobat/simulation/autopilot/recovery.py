"""The way back to a hover from every instant of a path: how long it takes, and how much height it costs.

What is flown is an autopilot's recovery: from the state that the path asks at an instant, the last attitude,
rates and thrust are kept for as long as it takes until the loss is noticed; then it brakes to a hover.
"""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.declaration import Finite, NonNegative, Series, by_value, short, validated
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import Tree, components, from_components
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import Planned, TimeInterval, environment_of, reference, vehicle_of
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.autopilot.braking import MIN_FLOOR, Braking, nearest_heading, point_reference
from aerobat.simulation.autopilot.loop import (
    KEPT,
    RATE,
    autopilot_inputs,
    autopilot_setup,
)
from aerobat.simulation.bodies import bodies
from aerobat.simulation.loop import Signals
from aerobat.states import BodyState, Setpoint
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle

HORIZON = 15.0  # [s] in which a recovery comes to a hover, or never does
INSTANTS_RATE = 100.0  # [1/s] of instants that nobody names
MOST_INSTANTS = 2000  # of them; a longer path has them further apart
_CHUNK = 100  # ticks flown at once, so that their references take little memory
_HOVERING = 0.5  # [s] of all of them, which are not followed any longer then
_FEW_SPANS = 3  # that a sentence names one by one
_STILL = 0.2  # [m/s] of a hover
_ALIGNED = 0.2  # [rad] likewise, of its thrust axis from the thrust that holds it there


class UndeterminedAttitude(SpecError):
    """Thrust vanishes on the way, and with it the attitude from which a recovery would begin."""


@short
@by_value
class Recoveries:
    """The recoveries from instants of a path."""

    times: Series  # [s] of the instants, (T,)
    heights: Series  # [m] of the path then, (T,)
    lowest: Series  # [m] the least height from then on, (T,)
    durations: Series  # [s] until it hovers; infinite where it never does, (T,)
    reaction: float  # [s] for which the last command is kept before each
    ground: float | None  # [m] below which there is none; None: no ground

    def __post_init__(self) -> None:
        """Check that there is one of each for every instant."""
        if not len(self.times) == len(self.heights) == len(self.lowest) == len(self.durations) > 0:
            raise SpecError(
                "recoveries need a height, a lowest height and a duration for each of their times"
            )

    @property
    def height_lost(self) -> Array:
        """The height lost in the recovery from each instant [m], down to the lowest point, (T,)."""
        return self.heights - self.lowest

    @property
    def possible(self) -> NDArray[np.bool_]:
        """True where it comes to a hover, and that above the ground, (T,)."""
        floor = -inf if self.ground is None else self.ground
        return np.asarray((self.lowest > floor) & np.isfinite(self.durations))

    @property
    def no_return(self) -> tuple[TimeInterval, ...]:
        """The spans of instants from which there is none, each out to the instants that have one."""
        lost = np.flatnonzero(~self.possible)
        runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1) if len(lost) else []
        last = len(self.times) - 1
        return tuple(
            TimeInterval(float(self.times[max(run[0] - 1, 0)]), float(self.times[min(run[-1] + 1, last)]))
            for run in runs
        )

    def __str__(self) -> str:
        """One sentence."""
        if not self.possible.any():
            above = "" if self.ground is None else " above the ground"
            return f"from no instant does it come back to a hover{above}"
        lowest = float(self.lowest[self.possible].min())
        height = (
            f"z = {lowest:.2f} m" if self.ground is None else f"{lowest - self.ground:.2f} m above the ground"
        )
        slowest = f"within {self.durations[self.possible].max():.1f} s"
        except_from = f", but not from {self._spans}" if self.no_return else ""
        return (
            f"given up at {self._instants} and noticed {self.reaction:g} s later, it hovers {slowest}, "
            f"no lower than {height}{except_from}"
        )

    @property
    def _instants(self) -> str:
        """The instants in words."""
        if len(self.times) == 1:
            return f"{self.times[0]:.2f} s"
        return f"any of {len(self.times)} instants, {1e3 * np.diff(self.times).max():.3g} ms apart at most,"

    @property
    def _spans(self) -> str:
        """The spans of no return in words."""
        if len(self.no_return) <= _FEW_SPANS:
            return " and ".join(f"{span.start:.2f} to {span.end:.2f} s" for span in self.no_return)
        first, last = self.no_return[0].start, self.no_return[-1].end
        lost = 100.0 * float(np.mean(~self.possible))
        return (
            f"{len(self.no_return)} spans between {first:.2f} and {last:.2f} s, {lost:.0f} % of the instants"
        )


@validated
def recoveries(
    plan: Planned | Trajectory,
    vehicle: Vehicle | str | None = None,
    *,
    times: ArrayLike | None = None,
    ground: Finite | None = None,
    reaction: NonNegative = 0.1,
    environment: Environment | None = None,
) -> Recoveries:
    """Fly the recovery to a hover from instants of a path.

    Raises SpecError for times outside the path, UndeterminedAttitude where its thrust vanishes.

    Args:
        plan: the path; a bare trajectory needs a vehicle.
        vehicle: what flies it, or its name, by default the plan's.
        times: of the instants [s], (T,), rising; by default a hundred a second, at most 2000 evenly.
        ground: the height [m], in the path's own frame, that a recovery must stay above; by default the
            environment's, which may have none.
        reaction: the time [s] for which the last command is kept before the recovery begins.
        environment: where, by default the problem's.
    """
    vehicle, environment = vehicle_of(plan, vehicle).without_dead_rotors(), environment_of(plan, environment)
    path = as_trajectory(plan)
    rate = min(INSTANTS_RATE, (MOST_INSTANTS - 1) / path.duration)
    instants = path.sample(rate) if times is None else frozen(times, "times", (None,))
    required = reference(path, vehicle, instants, environment=environment)
    if required.undetermined:
        raise UndeterminedAttitude(
            "the path's attitude is undetermined where its thrust vanishes; plan another"
        )
    flock = _Flock(required.setpoint, required.rotor_thrusts, vehicle, environment)
    flock.keep(required.setpoint, reaction)
    ground = environment.ground if ground is None else ground
    flock.brake(-inf if ground is None else ground + MIN_FLOOR)
    return Recoveries(
        times=instants,
        heights=frozen(required.setpoint.flat.position[:, 2], "heights"),
        lowest=flock.lowest,
        durations=flock.durations,
        reaction=reaction,
        ground=ground,
    )


class _Flock:
    """Copies of a vehicle, one at each instant, that fly at once."""

    def __init__(
        self, setpoint: Setpoint, thrusts: Array, vehicle: Vehicle, environment: Environment
    ) -> None:
        self._vehicle, self._environment = vehicle, environment
        flat, count = setpoint.flat, len(thrusts)
        start = bodies(BodyState(flat.position, flat.velocity, setpoint.q_world_body, setpoint.omega_body))
        first = first_row(autopilot_inputs(_kept(setpoint, np.zeros(1), vehicle), True))
        engine = choose("auto", count, round(HORIZON * RATE))
        self._loop = autopilot_setup(start, vehicle, environment).compile_for(engine, first, _body)
        observer, controller, motion = self._loop.init(first)
        turning = components(np.clip(thrusts, vehicle.min_thrusts, vehicle.max_thrusts))
        self._carry: Tree = (
            observer,
            controller._replace(thrusts=turning),
            VehicleState(motion.body, turning),
        )
        self._time = 0.0
        self.lowest = flat.position[:, 2].copy()
        self.durations = np.zeros(count)

    def keep(self, setpoint: Setpoint, seconds: float) -> None:
        """Fly on by the commands of the instants for so many seconds."""
        since = np.arange(round(seconds * RATE)) / RATE
        for begin in range(0, len(since), _CHUNK):
            self._fly(_kept(setpoint, since[begin : begin + _CHUNK], self._vehicle), True)

    def brake(self, floor: float) -> None:
        """Come to a hover, no lower than a floor [m]; a copy that does not by the horizon never does."""
        body, gravity = self._carry[2].body, self._environment.gravity
        velocity = from_components(body.velocity)
        way = Braking.of(from_components(body.position), velocity, self._vehicle, gravity, floor)
        since = np.arange(round(HORIZON * RATE)) / RATE
        yaw = nearest_heading(from_components(body.q_world_body))
        begun = self._time
        for begin in range(0, len(since), _CHUNK):
            parts = way.at(since[begin : begin + _CHUNK])
            self._fly(point_reference(*parts, yaw, gravity), False)
            if self._time > max(begun + way.durations.max(), self.durations.max()) + _HOVERING:
                break
        self.durations[self.durations >= self._time - _CHUNK / RATE] = inf
        self.lowest.flags.writeable = self.durations.flags.writeable = False

    def _fly(self, references: ReferencePoint, by_attitude: bool) -> None:
        self._carry, body = self._loop.scan(self._carry, autopilot_inputs(references, by_attitude))
        self.lowest = np.fmin(self.lowest, np.fmin.reduce(body.position[2], axis=1))  # NaN: it flew to pieces
        speed = np.linalg.norm(from_components(body.velocity), axis=-1)
        moving = ~((speed <= _STILL) & self._holds(from_components(body.q_world_body)))
        ticks = moving.shape[1]
        latest = ticks - np.argmax(moving[:, ::-1], axis=1)
        self.durations = np.where(moving.any(axis=1), self._time + latest / RATE, self.durations)
        self._time += ticks / RATE

    def _holds(self, q_world_body: Array) -> NDArray[np.bool_]:
        """True for attitudes (..., 4) whose thrust points where it holds the vehicle still in the wind."""
        carried = self._vehicle.drag_body * so3.unrotate(q_world_body, self._environment.wind)
        needed = self._vehicle.mass * self._environment.weight - so3.rotate(q_world_body, carried)
        along = np.sum(so3.thrust_axis(q_world_body) * needed, axis=-1)
        return np.asarray(along >= np.cos(_ALIGNED) * np.linalg.norm(needed, axis=-1))


def _body(signals: Signals) -> Body:
    """The row of a log."""
    body: Body = signals.plant.body
    return body


def _kept(setpoint: Setpoint, since: Array, vehicle: Vehicle) -> ReferencePoint:
    """Commands of instants, kept for so long [s] (T,), leaves (T, instants)."""
    age = np.minimum(since, KEPT)[:, None, None]
    omega_body = np.broadcast_to(setpoint.omega_body, (len(since), *setpoint.omega_body.shape))
    q = so3.multiply(setpoint.q_world_body, so3.exp(age * omega_body))
    thrust = (setpoint.wrench.thrust / vehicle.mass)[:, None] * so3.thrust_axis(q)
    zero = components(np.zeros_like(omega_body))
    omega = components(so3.rotate(q, omega_body))
    return ReferencePoint(
        zero,
        zero,
        components(thrust),
        zero,
        components(q),
        omega,
        zero,
        Lookahead(np.zeros(q.shape[:-1]), omega, zero),
    )
