"""A simulated vehicle with the modes and the failsafe of an autopilot, stepped by its user."""

from __future__ import annotations

from math import degrees

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.rigid_body import Body
from aerobat.links.autopilot.live_body import LiveBody
from aerobat.links.autopilot.references import AttitudeReference, PathReference, PointReference
from aerobat.links.goals import AttitudeGoal, Mode, PathPiece, PositionGoal
from aerobat.links.routes import Route, rest_to_rest, straight_down
from aerobat.simulation.autopilot.braking import MIN_FLOOR, Braking, nearest_heading
from aerobat.simulation.autopilot.loop import RATE
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# [s] without goals, after which a client counts as lost: attitudes and paths lead away fast, points do not
ATTITUDE_TIMEOUT = 0.1
POINT_TIMEOUT = 0.5

_CHUNK = 5  # largest number of ticks between checks for the ground and for a silent client
_HARD_SPEED = 1.5  # [m/s] speed of touchdown from which it is a crash
_HARD_TILT = 0.5  # [rad] tilt at touchdown from which it is a crash


class SimulatedVehicle:
    """A simulated vehicle with an autopilot; initially on the ground and disarmed.

    Times are those given to `advance`. The vehicle's own frame is ENU with the origin at its initial place,
    on flat ground.
    """

    def __init__(self, vehicle: Vehicle, environment: Environment) -> None:
        """Put a vehicle on the ground.

        Args:
            vehicle: the vehicle, with the gains of its controller.
            environment: of which gravity and wind are used.
        """
        self.vehicle, self.gravity = vehicle, environment.gravity
        self.time = 0.0  # [s]
        self.mode = Mode.HOLD
        self.armed, self.landed, self.crashed = False, True, False
        self.notices: list[str] = []  # sentences for a front end, which empties the list
        self._body = LiveBody(vehicle, environment)
        self._route = Route(rest_to_rest(np.zeros(3), np.zeros(3)), self.time, 0.0)
        self._then: tuple[Array, float | None] | None = None  # [m], [rad] where to go after the hover
        self._goal: PointReference | PathReference | AttitudeReference | None = None
        self._last_goal_time = -np.inf  # [s] time of the last goal

    @property
    def state(self) -> BodyState:
        """The true state, (·,)."""
        return self._body.state

    @property
    def body(self) -> Body:
        """The true state in plain numbers."""
        return self._body.body

    @property
    def hover_fraction(self) -> float:
        """The fraction of the maximum collective thrust in hover [-]."""
        return self.vehicle.mass * self.gravity / float(self.vehicle.max_thrusts.sum())

    def arm(self) -> bool:
        """Arm the rotors; return False after a crash."""
        self.armed = not self.crashed
        return self.armed

    def disarm(self) -> bool:
        """Disarm on the ground; return False in flight."""
        if self.landed:
            self.armed = False
            self._body.stop_rotors()
        return self.landed

    def take_off(self, height: float) -> bool:
        """Climb by `height` [m] from the ground; return False if the vehicle is disarmed or flies already."""
        if not self.armed or not self.landed:
            return False
        here = self.state.position
        self._go(Mode.TAKEOFF, rest_to_rest(here, here + height * so3.UP))
        return True

    def go_to(self, position: Array, yaw: float | None = None) -> bool:
        """Come to a hover, then fly to a point [m] at a yaw [rad] and hover; return False on the ground."""
        if self.landed:
            return False
        self.hold()
        self._then = (position, yaw)
        return True

    def hold(self) -> bool:
        """Come to a hover from any motion."""
        self.mode, self._then = Mode.HOLD, None
        if not self.landed:
            motion = self.state.position, self.state.velocity
            self._go(Mode.HOLD, Braking.of(*motion, self.vehicle, self.gravity, MIN_FLOOR).trajectory)
        return True

    def land(self) -> bool:
        """Come to a hover, descend to the ground and disarm; a repeated order has no effect."""
        if self.mode is not Mode.LAND:
            self.hold()
            if not self.disarm():
                self.mode = Mode.LAND
        return True

    def go_offboard(self) -> bool:
        """Follow a client's streamed goals; return False where none came recently."""
        if self._goal is None or self.time - self._last_goal_time > POINT_TIMEOUT:
            return False
        self.mode, self._then = Mode.OFFBOARD, None
        self._restart_position_loop()
        return True

    def follow_point(self, goal: PositionGoal) -> None:
        """Accept a position goal from a client; it is followed in the mode offboard."""
        self._follow(PointReference(goal, self.time))

    def follow_path(self, piece: PathPiece) -> None:
        """Accept a piece of a path from a client; it is followed in the mode offboard."""
        self._follow(PathReference(piece))

    def follow_attitude(self, goal: AttitudeGoal, sent: float) -> None:
        """Accept an attitude goal of the time `sent` [s] by the client's clock, for the mode offboard."""
        known, self._last_goal_time = self._goal, self.time
        if isinstance(known, AttitudeReference):
            self._goal = known.followed_by(goal, sent, self.time)
        else:
            self._goal = AttitudeReference(goal, sent, self.time)

    def advance(self, now: float) -> None:
        """Simulate up to the last tick before a time [s]."""
        while (ticks := min(int((now - self.time) * RATE + 1e-6), _CHUNK)) > 0:
            self._watch_client()
            if not self.landed and self.time - self._route.began >= self._route.path.duration:
                self._go_on()
            # on the ground it waits for an order
            if self.armed and not (self.landed and self.mode is Mode.HOLD):
                self._fly(ticks)
            self.time += ticks / RATE

    def _follow(self, goal: PointReference | PathReference) -> None:
        is_another_kind = type(goal) is not type(self._goal)
        self._goal, self._last_goal_time = goal, self.time
        if is_another_kind:
            self._restart_position_loop()

    def _fly(self, ticks: int) -> None:
        references = self._references(self.time + np.arange(ticks) / RATE)
        self._body.fly(references, isinstance(self._followed, AttitudeReference), self._stays_upright)
        if self.state.position[2] <= 0.0:
            self._touch_ground()
        else:
            self.landed = False

    @property
    def _followed(self) -> Route | PointReference | PathReference | AttitudeReference:
        """The present goal."""
        if self.mode is Mode.OFFBOARD and self._goal is not None:
            return self._goal
        return self._route

    @property
    def _stays_upright(self) -> bool:
        """True unless the present goal is a piece of a path, which has attitudes of its own."""
        return not isinstance(self._followed, PathReference)

    def _references(self, times: Array) -> ReferencePoint:
        """Return references of the present goal at times [s], leaves (T,)."""
        goal = self._followed
        if isinstance(goal, AttitudeReference):
            return goal.reference(times, 1.0 / RATE, self.vehicle.mass)
        if isinstance(goal, PathReference):
            return goal.reference(times, 1.0 / RATE, self.gravity)
        return goal.reference(times, self.gravity)

    def _go(self, mode: Mode, path: Trajectory, yaw: float | None = None) -> None:
        """Begin a route of the autopilot's own."""
        own = float(nearest_heading(self.state.q_world_body)) if yaw is None else yaw
        self.mode, self._then = mode, None
        self._route = Route(path, self.time, own)
        self._restart_position_loop()

    def _go_on(self) -> None:
        """Begin the route that follows the present route, which has ended."""
        here = self._route.end
        if self._then is not None and self.mode is Mode.HOLD:
            position, yaw = self._then
            self._go(Mode.HOLD, rest_to_rest(here, position), yaw)
        elif self.mode is Mode.LAND and here[2] > 0.0:
            self._go(Mode.LAND, straight_down(here, 0.0))
        elif self.mode is Mode.TAKEOFF:
            self.mode = Mode.HOLD

    def _watch_client(self) -> None:
        """Come to a hover where a client that is obeyed has fallen silent."""
        if self.mode is not Mode.OFFBOARD:
            return
        silence = self.time - self._last_goal_time
        stays = isinstance(self._goal, PointReference)
        stays = stays or (isinstance(self._goal, PathReference) and not self._goal.ends_in_motion)
        allowed = POINT_TIMEOUT if stays else ATTITUDE_TIMEOUT
        if silence > allowed + 1e-9:
            self.notices.append(f"no set-points for {silence:.2f} s: holding")
            self.hold()

    def _restart_position_loop(self) -> None:
        if not isinstance(self._followed, AttitudeReference):
            references = self._references(np.array([self.time]))
            self._body.restart_position_loop(references, self._stays_upright)

    def _touch_ground(self) -> None:
        """Stop on the ground: landed, or crashed if the touchdown was hard."""
        state = self.state
        tilt = float(np.arccos(np.clip(so3.thrust_axis(state.q_world_body)[2], -1.0, 1.0)))
        speed = float(np.linalg.norm(state.velocity))
        if not self.landed and (speed > _HARD_SPEED or tilt > _HARD_TILT):
            self.crashed = True
            self.notices.append(f"hit the ground at {speed:.1f} m/s, tilted by {degrees(tilt):.0f}°")
        has_landed = self.mode is Mode.LAND or self.crashed
        self.landed = True
        self._body.stand()
        if has_landed:
            self.mode = Mode.HOLD
            self.disarm()
