"""Recoveries to a hover from every instant of a path: how long they take and how much height they cost.

A recovery starts from the state that the path requires at an instant. The last attitude, body rates and
thrust are kept for the reaction time, until the loss is noticed; then the autopilot brakes to a hover.
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
from aerobat.flatness import Planned, environment_of, reference, vehicle_of
from aerobat.kernels.control_loops import Lookahead, ReferencePoint
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.autopilot.braking import MIN_FLOOR, Braking, nearest_heading, point_reference
from aerobat.simulation.autopilot.loop import COMMAND_HOLD_TIME, RATE, autopilot_inputs, autopilot_setup
from aerobat.simulation.bodies import bodies
from aerobat.simulation.loop import Signals
from aerobat.states import BodyState, Setpoint, TimeInterval
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle

HORIZON = 15.0  # [s] time limit of a recovery; a vehicle that does not hover by then never recovers
INSTANTS_RATE = 100.0  # [1/s] rate of instants, where the caller names none
MAX_INSTANTS = 2000  # largest number of instants; on a longer path they lie further apart
_CHUNK = 100  # ticks simulated at once, so that their references take little memory
_HOVER_DWELL = 0.5  # [s] time for which all copies must hover before the simulation ends early
_MAX_NAMED_SPANS = 3  # number of spans up to which a sentence names each
_HOVER_SPEED = 0.2  # [m/s] largest speed of a hover
_HOVER_ANGLE = 0.2  # [rad] largest angle of a hover between thrust axis and the thrust for rest


class UndeterminedAttitude(SpecError):
    """Thrust vanishes on the path, so that the attitude from which a recovery begins is undetermined."""


@short
@by_value
class Recoveries:
    """The recoveries from instants of a path."""

    times: Series  # [s] of the instants, (T,)
    heights: Series  # [m] of the path at the instants, (T,)
    lowest: Series  # [m] the least height from the instant on, (T,)
    durations: Series  # [s] until it hovers; infinite where it never does, (T,)
    reaction: float  # [s] for which the last command is kept before each recovery
    ground: float | None  # [m] height of the ground; None: no ground

    def __post_init__(self) -> None:
        """Check that every instant has a height, a lowest height and a duration."""
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
        """True where the recovery reaches a hover without touching the ground, (T,)."""
        floor = -inf if self.ground is None else self.ground
        return np.asarray((self.lowest > floor) & np.isfinite(self.durations))

    @property
    def no_return(self) -> tuple[TimeInterval, ...]:
        """The spans of instants without a recovery, widened to the neighbouring instants that have one."""
        lost = np.flatnonzero(~self.possible)
        runs = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1) if len(lost) else []
        last = len(self.times) - 1
        return tuple(
            TimeInterval(float(self.times[max(run[0] - 1, 0)]), float(self.times[min(run[-1] + 1, last)]))
            for run in runs
        )

    def __str__(self) -> str:
        """Return one sentence."""
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
        if len(self.no_return) <= _MAX_NAMED_SPANS:
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
    """Simulate the recovery to a hover from instants of a path.

    Raises SpecError for times outside the path, UndeterminedAttitude where the path's thrust vanishes.

    Args:
        plan: the path; a bare trajectory needs a vehicle.
        vehicle: the vehicle or its name, by default the plan's.
        times: instants [s], (T,), rising; by default 100 per second, at most 2000 evenly spaced.
        ground: the height [m], in the path's own frame, that a recovery must stay above; by default the
            environment's, which may have none.
        reaction: the time [s] for which the last command is kept before the recovery begins.
        environment: the surroundings, by default the problem's.
    """
    vehicle, environment = vehicle_of(plan, vehicle).without_dead_rotors(), environment_of(plan, environment)
    path = as_trajectory(plan)
    rate = min(INSTANTS_RATE, (MAX_INSTANTS - 1) / path.duration)
    instants = path.sample(rate) if times is None else frozen(times, "times", (None,))
    required = reference(path, vehicle, instants, environment=environment)
    if required.undetermined:
        raise UndeterminedAttitude(
            "the path's attitude is undetermined where its thrust vanishes; plan another"
        )
    batch = _RecoveryBatch(required.setpoint, required.rotor_thrusts, vehicle, environment)
    batch.keep(required.setpoint, reaction)
    ground = environment.ground if ground is None else ground
    batch.brake(-inf if ground is None else ground + MIN_FLOOR)
    return Recoveries(
        times=instants,
        heights=frozen(required.setpoint.flat.position[:, 2], "heights"),
        lowest=batch.lowest,
        durations=batch.durations,
        reaction=reaction,
        ground=ground,
    )


class _RecoveryBatch:
    """Copies of a vehicle, one at each instant, that are simulated together."""

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
        """Keep the commanded attitudes, body rates and thrusts of the instants for some time [s]."""
        since = np.arange(round(seconds * RATE)) / RATE
        for begin in range(0, len(since), _CHUNK):
            self._fly(_kept(setpoint, since[begin : begin + _CHUNK], self._vehicle), True)

    def brake(self, floor: float) -> None:
        """Brake to a hover at or above a floor [m]; the duration is infinite where a copy never hovers."""
        body, gravity = self._carry[2].body, self._environment.gravity
        velocity = from_components(body.velocity)
        braking = Braking.of(from_components(body.position), velocity, self._vehicle, gravity, floor)
        since = np.arange(round(HORIZON * RATE)) / RATE
        yaw = nearest_heading(from_components(body.q_world_body))
        begun = self._time
        for begin in range(0, len(since), _CHUNK):
            parts = braking.at(since[begin : begin + _CHUNK])
            self._fly(point_reference(*parts, yaw, gravity), False)
            if self._time > max(begun + braking.durations.max(), self.durations.max()) + _HOVER_DWELL:
                break
        self.durations[self.durations >= self._time - _CHUNK / RATE] = inf
        self.lowest.flags.writeable = self.durations.flags.writeable = False

    def _fly(self, references: ReferencePoint, by_attitude: bool) -> None:
        self._carry, body = self._loop.scan(self._carry, autopilot_inputs(references, by_attitude))
        self.lowest = np.fmin(self.lowest, np.fmin.reduce(body.position[2], axis=1))  # NaN: no longer finite
        speed = np.linalg.norm(from_components(body.velocity), axis=-1)
        moving = ~((speed <= _HOVER_SPEED) & self._holds(from_components(body.q_world_body)))
        ticks = moving.shape[1]
        latest = ticks - np.argmax(moving[:, ::-1], axis=1)
        self.durations = np.where(moving.any(axis=1), self._time + latest / RATE, self.durations)
        self._time += ticks / RATE

    def _holds(self, q_world_body: Array) -> NDArray[np.bool_]:
        """True for attitudes (..., 4) whose thrust axis is aligned with weight and drag at rest in wind."""
        carried = self._vehicle.drag_body * so3.unrotate(q_world_body, self._environment.wind)
        rest_thrust = self._vehicle.mass * self._environment.weight - so3.rotate(q_world_body, carried)
        along = np.sum(so3.thrust_axis(q_world_body) * rest_thrust, axis=-1)
        return np.asarray(along >= np.cos(_HOVER_ANGLE) * np.linalg.norm(rest_thrust, axis=-1))


def _body(signals: Signals) -> Body:
    """Return the row of the log: the body's state."""
    body: Body = signals.plant.body
    return body


def _kept(setpoint: Setpoint, since: Array, vehicle: Vehicle) -> ReferencePoint:
    """Return references that keep the commands of instants for times since [s] (T,), leaves (T, instants)."""
    age = np.minimum(since, COMMAND_HOLD_TIME)[:, None, None]
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
