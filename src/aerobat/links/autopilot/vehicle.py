"""A vehicle in simulation, with the modes and the failsafe of an autopilot, stepped by whoever talks to it."""

from __future__ import annotations

from enum import StrEnum
from math import cos, degrees, sin

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.control.parameters import airframe_parameters, controller_parameters, environment_parameters
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.floats import FloatOps
from aerobat.engines.pytree import Tree, tree_map
from aerobat.environment import Environment
from aerobat.kernels.control_loops import ReferencePoint, init_position_loop
from aerobat.kernels.motors import Motion
from aerobat.links.autopilot.controller import AutopilotController
from aerobat.links.autopilot.references import AttitudeReference, PointReference, Route
from aerobat.links.goals import AttitudeGoal, PositionGoal
from aerobat.links.mission import yaw_of
from aerobat.links.routes import braking, rest_to_rest
from aerobat.simulation.bodies import bodies, body_states
from aerobat.simulation.components import (
    LogRow,
    PlantParameters,
    RigidBodyPlant,
    StateObserver,
    log_row,
)
from aerobat.simulation.loop import Clock, LoopInput, LoopParameters, compose
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

RATE = 500.0  # [1/s] of the controller and the plant
_CHUNK = 25  # ticks at most between looks at the ground and at the time of the last goal
_SPEED = 2.0  # [m/s] of the autopilot's own routes
_ACCELERATION = 2.0  # [m/s²] likewise
_DESCENT = 1.0  # [m/s] when landing
_BELOW = 0.3  # [m] under the ground, where the way of a landing ends, so that it is reached in motion
_FLOOR = 0.5  # [m] above the ground, below which no hover is sought
_BRAKING = 0.8  # [-] of what thrust can do beyond hovering, used to come to a hover
_FALLING = 0.7  # [-] of gravity, used to end a climb
_HARD_SPEED = 1.5  # [m/s] of a touchdown that is none
_HARD_TILT = 0.5  # [rad] likewise


class Mode(StrEnum):
    """Who says where to go: the client that streams goals, or the autopilot itself."""

    HOLD = "hold"
    TAKEOFF = "takeoff"
    LAND = "land"
    OFFBOARD = "offboard"


class SimulatedVehicle:
    """Rigid body, rotors and controller in the simulation's loop; on the ground at first, disarmed.

    Times are those of a clock that `advance` is told. Its own frame is ENU with the origin where it stands.
    """

    # [s] after which a client that streams points, or attitudes, is taken for lost: attitudes lead away fast
    point_timeout = 0.5
    attitude_timeout = 0.1

    def __init__(self, vehicle: Vehicle, environment: Environment, now: float = 0.0) -> None:
        """Put a vehicle on the ground.

        Args:
            vehicle: which; its controller's gains count.
            environment: where; its ground is taken to be at 0.
            now: the time [s].
        """
        vehicle.require_hover(environment.gravity)
        self.vehicle, self.gravity = vehicle, environment.gravity
        self.time = now
        self.armed, self.landed = False, True
        self.mode = Mode.HOLD
        self.told: list[str] = []  # sentences for whoever listens, emptied by them
        self.crashed = False
        self.lowest = np.inf  # [m] the least height in flight
        fleet = Fleet.of([vehicle])
        model = controller_parameters(vehicle.controller, fleet, environment)
        plant = PlantParameters(airframe_parameters(fleet), environment_parameters(environment, 1))
        controller = AutopilotController(vehicle.controller.feature_flags)
        parts = (StateObserver(), controller, RigidBodyPlant.for_rate(RATE))
        start = BodyState(*(np.zeros((1, n)) for n in (3, 3)), so3.IDENTITY[None], np.zeros((1, 3)))
        self._gains = tree_map(float, tree_map(lambda leaf: np.ravel(leaf)[0], model.gains))
        self._route = Route(rest_to_rest(np.zeros(3), np.zeros(3), _SPEED, _ACCELERATION), now, 0.0)
        self._goal: PointReference | AttitudeReference | None = None
        self._heard = -np.inf  # [s] when the last goal came
        inputs = self._inputs(np.array([now]))
        engine = choose("auto", 1, 10**6)
        parameters = LoopParameters(bodies(start), ((), model, plant))
        self._loop = engine.compile(*compose(parts, log_row), parameters, first_row(inputs))
        self._carry: Tree = self._loop.init(first_row(inputs))
        self._state = start
        self._stop_rotors()

    @property
    def state(self) -> BodyState:
        """The true state, (·,)."""
        return BodyState(*(part[0] for part in vars(self._state).values()))

    @property
    def hover_fraction(self) -> float:
        """The fraction of all rotors' greatest thrust at which it hovers [-]."""
        return self.vehicle.mass * self.gravity / float(self.vehicle.max_thrusts.sum())

    def arm(self) -> bool:
        """Let the rotors turn; false after a crash."""
        self.armed = not self.crashed
        return self.armed

    def disarm(self) -> bool:
        """Stop the rotors, on the ground only; false in flight."""
        if not self.landed:
            return False
        self.armed = False
        self._stop_rotors()
        return True

    def take_off(self, height: float) -> bool:
        """Climb by so much [m] from the ground; false where it is disarmed or flies already."""
        if not self.armed or not self.landed:
            return False
        here = self.state.position
        self._go(Mode.TAKEOFF, rest_to_rest(here, here + [0.0, 0.0, height], _SPEED, _ACCELERATION))
        return True

    def go_to(self, position: Array, yaw: float | None = None) -> bool:
        """Fly to a point [m] and hover there; false on the ground."""
        if self.landed:
            return False
        away = self._braking()
        stop = away.evaluate(away.duration)
        # from a motion it comes to a hover first
        moving = np.linalg.norm(self.state.velocity) > 0.1
        path = away if moving else rest_to_rest(stop, position, _SPEED, _ACCELERATION)
        self._go(Mode.HOLD, path, yaw)
        self._then = (position, yaw) if moving else None
        return True

    def hold(self) -> bool:
        """Come to a hover from whatever it does."""
        if self.landed:
            self.mode = Mode.HOLD
        else:
            self._go(Mode.HOLD, self._braking())
        return True

    def land(self) -> bool:
        """Come to a hover, and from there down to the ground."""
        if self.landed:
            return True
        self.hold()
        self.mode = Mode.LAND
        return True

    def go_offboard(self) -> bool:
        """Follow the goals that a client streams; false where none came lately."""
        if self.time - self._heard > self.point_timeout:
            return False
        self.mode, self._then = Mode.OFFBOARD, None
        return True

    def follow_point(self, goal: PositionGoal) -> None:
        """Take a goal from a client; it is followed in the mode OFFBOARD."""
        self._heard = self.time
        switching = not isinstance(self._goal, PointReference)
        self._goal = PointReference(goal, self.time)
        if switching and self.mode is Mode.OFFBOARD:
            self._restart_position_loop()

    def follow_attitude(self, goal: AttitudeGoal, sent: float) -> None:
        """Take a goal from a client, `sent` [s] by the client's clock; it is followed in the mode OFFBOARD."""
        self._heard = self.time
        if isinstance(self._goal, AttitudeReference):
            self._goal = self._goal.followed_by(goal, sent, self.time)
        else:
            self._goal = AttitudeReference.first(goal, sent, self.time)

    def advance(self, now: float) -> None:
        """Go on to a time [s], to the last tick before it."""
        while (ticks := min(int((now - self.time) * RATE + 1e-6), _CHUNK)) > 0:
            self._watch_link()
            self._go_on_with_route()
            if self.armed and not (self.landed and self.mode is Mode.HOLD):  # then it waits for an order
                self._fly(ticks)
            self.time += ticks / RATE

    def _fly(self, ticks: int) -> None:
        times = self.time + np.arange(ticks) / RATE
        self._carry, rows = self._loop.scan(self._carry, self._inputs(times))
        self._state = body_states(self._carry[2].body)
        del rows
        if self.state.position[2] <= 0.0:
            self._touch_ground()
        elif self.landed:
            self.landed = False
            self.lowest = np.inf
        if not self.landed:
            self.lowest = min(self.lowest, float(self.state.position[2]))

    def _inputs(self, times: Array) -> LoopInput:
        """The loop's inputs at times [s], leaves (T,)."""
        period = np.full(len(times), 1.0 / RATE)
        commanded = 0.0
        goal = self._goal if self.mode is Mode.OFFBOARD else self._route
        reference: ReferencePoint
        if isinstance(goal, AttitudeReference):
            reference = goal.reference(times, 1.0 / RATE, self.vehicle.mass)
            commanded = 1.0
        else:
            assert goal is not None, "who goes offboard has been given a goal"
            reference = goal.reference(times, self.gravity)
        own = ((), np.full(len(times), commanded), ())
        return LoopInput(Clock(period, period), ((), (), ()), reference, own)

    def _braking(self) -> Trajectory:
        """The way to a hover from its present motion."""
        deceleration = _BRAKING * (self.vehicle.max_specific_thrust - self.gravity)
        state = self.state
        return braking(state.position, state.velocity, deceleration, _FLOOR, _FALLING * self.gravity)

    _then: tuple[Array, float | None] | None = None  # where to go once it hovers

    def _go(self, mode: Mode, path: Trajectory, yaw: float | None = None) -> None:
        """Take a way of its own."""
        own = yaw_of(self.state.q_world_body) if yaw is None else yaw
        self.mode, self._then = mode, None
        self._route = Route(path, self.time, own)
        self._restart_position_loop()

    def _go_on_with_route(self) -> None:
        """Begin what follows the present way once that has ended."""
        if self.landed or self.time - self._route.began < self._route.path.duration:
            return
        here = self._route.path.evaluate(self._route.path.duration)
        if self._then is not None and self.mode is Mode.HOLD:
            position, yaw = self._then
            self._go(Mode.HOLD, rest_to_rest(here, position, _SPEED, _ACCELERATION), yaw)
        elif self.mode is Mode.LAND and here[2] > 0.0:
            down = np.array([here[0], here[1], -_BELOW])
            self._go(Mode.LAND, rest_to_rest(here, down, _DESCENT, _ACCELERATION))
        elif self.mode is Mode.TAKEOFF:
            self.mode = Mode.HOLD

    def _watch_link(self) -> None:
        """Come to a hover where a client that was obeyed is silent."""
        if self.mode is not Mode.OFFBOARD:
            return
        by_attitude = isinstance(self._goal, AttitudeReference)
        allowed = self.attitude_timeout if by_attitude else self.point_timeout
        if self.time - self._heard > allowed + 1e-9:
            self.told.append(f"no set-points for {self.time - self._heard:.2f} s: holding")
            self.hold()

    def _restart_position_loop(self) -> None:
        """Have the outer loop begin anew, without the error of what was followed before."""
        observer, controller, motion = self._carry
        reference = tree_map(lambda leaf: leaf[0].item(), self._inputs(np.array([self.time])).reference)
        body = tree_map(lambda leaf: leaf[0].item(), motion.body)
        outer = tree_map(
            lambda leaf: np.array([leaf]), init_position_loop(FloatOps, self._gains, body, reference)
        )
        self._carry = (observer, controller._replace(outer=outer), motion)

    def _touch_ground(self) -> None:
        """Stand on the ground, or lie there."""
        state = self.state
        tilt = float(np.arccos(np.clip(so3.thrust_axis(state.q_world_body)[2], -1.0, 1.0)))
        speed = float(np.linalg.norm(state.velocity))
        if not self.landed and (speed > _HARD_SPEED or tilt > _HARD_TILT):
            self.crashed = True
            self.told.append(f"hit the ground at {speed:.1f} m/s, tilted by {degrees(tilt):.0f}°")
        landing = self.mode is Mode.LAND or self.crashed
        if not self.landed:
            self.landed = True
        self._put(state.position[:2], yaw_of(state.q_world_body))
        if landing:
            self.mode, self.armed = Mode.HOLD, False
            self._stop_rotors()

    def _put(self, place: Array, yaw: float) -> None:
        """Have it at rest on the ground, its rotors as they turn."""
        q = np.array([[cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)]])
        position = np.array([[*place, 0.0]])
        self._state = BodyState(position, np.zeros((1, 3)), q, np.zeros((1, 3)))
        observer, controller, motion = self._carry
        self._carry = (observer, controller, Motion(bodies(self._state), motion.thrusts))

    def _stop_rotors(self) -> None:
        observer, controller, motion = self._carry
        idle = tuple(np.array([least]) for least in self.vehicle.min_thrusts)
        idle_controller = controller._replace(
            thrusts=idle, commands=controller.commands._replace(thrusts=idle)
        )
        self._carry = (observer, idle_controller, Motion(motion.body, idle))


__all__ = ["RATE", "LogRow", "Mode", "SimulatedVehicle"]
