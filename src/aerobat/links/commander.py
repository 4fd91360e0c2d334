"""The sequence of a vehicle's session: take-off, missions from hover to hover, and landing.

It is the same for every link whose vehicle tracks points of a path: it uses times, states and goals only.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from math import dist, hypot

import numpy as np

from aerobat import so3
from aerobat.errors import SpecError
from aerobat.kernels.rigid_body import Body
from aerobat.links.goals import Observed, PathGoal, PositionGoal, yaw_of
from aerobat.links.mission import Mission, Phase
from aerobat.links.routes import DESCENT_SPEED, SPEED, Route, rest_to_rest, straight_down
from aerobat.simulation.autopilot.braking import MIN_FLOOR, Braking, nearest_heading
from aerobat.simulation.outcome import length
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

_STANDING = 1.0  # [s] for which goals stay on the ground after a landing
_RESTART_DISTANCE = 0.25  # [m] distance from its goal above which a vehicle does not climb or land as ordered
_ROUTE_TIMEOUT = 10.0  # [s] beyond a climb's or landing's duration; then the vehicle is left to itself
_SPIN_UP_TIME = 1.5  # [s] for which goals stay on the ground before a climb, while the rotors spin up
_MAX_GOAL_DISTANCE = 1.5  # [m] distance from its goal above which a vehicle does not follow its goals
_HOVER_SPEED = 0.15  # [m/s] largest speed of a hover
_HOVER_HEIGHT = 0.3  # [m] above the ground, from which a vehicle at rest counts as hovering
_MAX_STATE_AGE = 0.5  # [s] for which an observed state counts as present
_MAX_SILENCE = 1.0  # [s] without a state, after which the vehicle is left to itself


class Doing(StrEnum):
    """The activity of a vehicle."""

    NOTHING = "left to itself"
    CLIMBING = "climbing"
    HOVERING = "hovering"
    MANEUVERING = "flying a maneuver"
    BRAKING = "coming to a hover"
    LANDING = "landing"


class Commander:
    """Computes the goal of each tick from orders and observed states of the vehicle.

    Goals are given one period ahead, so that each is known when its time comes.
    """

    def __init__(
        self, vehicle: Vehicle, gravity: float, period: float, say: Callable[[str], None] = lambda _: None
    ) -> None:
        """Prepare, with the vehicle left to itself.

        Args:
            vehicle: of which the maximum thrust is used for braking.
            gravity: [m/s²] until a mission begins, whose plan has its own.
            period: from one tick to the next [s].
            say: receives sentences about the progress.
        """
        self.doing = Doing.NOTHING
        self.observed: Observed | None = None  # the last state
        self.route: Route | None = None  # the route that is followed, or at whose end the vehicle hovers
        self.ground = 0.0  # [m] the height of take-off
        self.mission: Mission[PathGoal] | None = None  # the last one
        self._vehicle, self._gravity, self._period, self._say = vehicle, gravity, period, say
        self._deadline = 0.0  # [s] time limit for reaching the top of a climb, or the ground
        self._is_landed = True  # false from a take-off to the end of a landing
        self._jumped = False  # the observed position has jumped since a climb or landing began

    def observe(self, observed: Observed) -> None:
        """Process an observed state."""
        if self.observed is not None:
            if observed.time <= self.observed.time:
                return
            moved = dist(observed.body.position, self.observed.body.position)
            self._jumped |= moved > _MAX_GOAL_DISTANCE and observed.time - self.observed.time < _MAX_STATE_AGE
        self.observed = observed
        if self.mission is not None:
            self.mission.observe(observed)

    def take_off(self, now: float, height: float) -> None:
        """Climb by `height` [m] from the ground. Raises SpecError for a vehicle that is not on the ground."""
        observed = self._recent_state(now)
        if self.doing is not Doing.NOTHING:
            raise SpecError(f"the vehicle is {self.doing} already")
        here = np.array(observed.body.position)
        if not self._is_landed and here[2] - self.ground >= _HOVER_HEIGHT:
            raise SpecError("the vehicle is in the air already; have it land first")
        self.ground, self._is_landed = float(here[2]), False
        up = rest_to_rest(here, here + height * so3.UP)
        self._deadline, self._jumped = now + _SPIN_UP_TIME + up.duration + _ROUTE_TIMEOUT, False
        self._go(Doing.CLIMBING, now + _SPIN_UP_TIME, up, yaw_of(observed.body.q_world_body))

    def hover(self, now: float) -> None:
        """Come to a hover from any activity. Raises SpecError for a vehicle that is left to itself."""
        if self.doing is Doing.NOTHING:
            raise SpecError("the vehicle is left to itself; have it take off first")
        if self.doing is Doing.MANEUVERING and self.mission is not None:
            self.mission.abort(now, "hold was called")
        self._brake(now, self._recent_state(now))

    def land(self, now: float) -> None:
        """Land from a hover. Raises SpecError where the vehicle does not hover."""
        observed = self.require_hover(now)
        here, yaw = np.array(observed.body.position), yaw_of(observed.body.q_world_body)
        if self.route is not None:  # from its end, where it hovers
            here, yaw = self.route.end, self.route.yaw
        down = straight_down(here, self.ground)
        self._deadline, self._jumped = now + down.duration + _ROUTE_TIMEOUT, False
        self._go(Doing.LANDING, now, down, yaw)

    def require_hover(self, now: float) -> Observed:
        """Return the state of a vehicle that hovers, also one left to itself. Raises SpecError otherwise."""
        observed = self._recent_state(now)
        speed, height = hypot(*observed.body.velocity), observed.body.position[2] - self.ground
        if self.doing is Doing.HOVERING and speed <= _HOVER_SPEED:
            return observed
        if self.doing is Doing.NOTHING and speed <= _HOVER_SPEED and height >= _HOVER_HEIGHT:
            return observed
        if self.doing is Doing.NOTHING and height < _HOVER_HEIGHT:
            raise SpecError("the vehicle stands on the ground; have it take off first")
        doing = self.doing if self.doing is not Doing.HOVERING else f"moving at {speed:.1f} m/s"
        raise SpecError(f"the vehicle is {doing}; wait until it hovers")

    def begin(self, now: float, mission: Mission[PathGoal]) -> None:
        """Fly a mission from a hover. Raises SpecError where the vehicle does not hover."""
        mission.join(now, self.require_hover(now))
        self.mission, self.route = mission, None
        self._gravity = mission.gravity
        self.doing = Doing.MANEUVERING

    def step(self, now: float, late: float = 0.0) -> PathGoal | None:
        """Return the goal one period after this time [s]; None where the vehicle is left to itself.

        `late`: by how much the goal is late [s].
        """
        goal = self._of_mission(now, late) if self.doing is Doing.MANEUVERING else self._of_route(now)
        return PathGoal.upright(goal, self._gravity) if isinstance(goal, PositionGoal) else goal

    def _of_route(self, now: float) -> PositionGoal | None:
        """Return the goal of a climb, hover, braking or landing; None once the vehicle is left to itself."""
        if self.route is None or self._leave_silent(now):
            return None
        if self._is_behind and not self._restart_route(now):
            return None
        if (off := self._goal_distance()) > _MAX_GOAL_DISTANCE:
            self._leave(f"the vehicle is {length(off)} off its goal")
            return None
        since = now + self._period - self.route.began
        if self.doing is not Doing.LANDING and since >= self.route.path.duration:
            self.doing = Doing.HOVERING
        if self.doing is Doing.LANDING and since > self.route.path.duration + _STANDING:
            self.doing, self.route, self._is_landed = Doing.NOTHING, None, True
            return None
        return self._goal_on_route(now)

    def _of_mission(self, now: float, late: float) -> PathGoal | PositionGoal | None:
        """Return the goal of the mission, or of the hover or braking that follows it."""
        assert self.mission is not None, "maneuvers are missions"
        phase, goal = self.mission.phase, self.mission.step(now, self._last_state, self._period, late)
        if self.mission.phase not in (phase, Phase.LAND):
            reason = f": {self.mission.reason}" if self.mission.reason else ""
            self._say(f"{self.mission.phase}{reason}")
        if self.mission.phase is Phase.LAND:  # the vehicle hovers at the mission's end
            end = self.mission.end
            at_end = rest_to_rest(end.position, end.position)
            self._go(Doing.HOVERING, now, at_end, end.yaw)
            return self._goal_on_route(now)
        if self.mission.phase is Phase.ABORTED:
            off = self.mission.error(self._last_state) if phase is Phase.MANEUVER else 0.0
            # its position jumps, and goals would too
            if off > self.mission.settings.max_error + _MAX_GOAL_DISTANCE:
                self._leave(f"the vehicle is {length(off)} off its goal")
                return None
            self._brake(now, self._last_state)
            silent = self._leave_silent(now, self.mission.settings.max_silence)
            return None if silent else self._goal_on_route(now)
        return goal

    def _brake(self, now: float, observed: Observed) -> None:
        body, floor = observed.body, self.ground + MIN_FLOOR
        motion = np.array(body.position), np.array(body.velocity)
        path = Braking.of(*motion, self._vehicle, self._gravity, floor).trajectory
        self._go(Doing.BRAKING, now, path, float(nearest_heading(np.array(body.q_world_body))))

    def _leave_silent(self, now: float, allowed: float = _MAX_SILENCE) -> bool:
        """Return True, with the vehicle left to itself, if no state was received for `allowed` [s]."""
        silence = now - self._last_state.time
        if silence <= allowed:
            return False
        self._leave(f"no news of the vehicle for {silence:.1f} s")
        return True

    @property
    def _is_behind(self) -> bool:
        """True for a vehicle that does not climb or land as ordered, and is in the air or should be.

        It may have received goals late, or hovered without goals, and does not accept goals that are far
        away.
        """
        if self.doing not in (Doing.CLIMBING, Doing.LANDING) or self._goal_distance() <= _RESTART_DISTANCE:
            return False
        return self.doing is Doing.CLIMBING or self._last_state.body.position[2] > self.ground + _HOVER_HEIGHT

    def _restart_route(self, now: float) -> bool:
        """Restart the route from where the vehicle is, and return True.

        The vehicle is left to itself, and False returned, where the order has taken too long, or where the
        observed position has jumped, since goals would jump too.
        """
        if self._jumped or now > self._deadline:
            order = "climb" if self.doing is Doing.CLIMBING else "land"
            why = ", it is seen to leap" if self._jumped else ""
            self._leave(f"the vehicle does not {order} as it is told{why}")
            return False
        end, here = self._present_route.end, np.array(self._last_state.body.position)
        speed = DESCENT_SPEED if self.doing is Doing.LANDING else SPEED
        self._go(self.doing, now, rest_to_rest(here, end, speed), self._present_route.yaw)
        return True

    def _leave(self, reason: str) -> None:
        self.doing, self.route = Doing.NOTHING, None
        self._say(f"{reason}; it is left to itself")

    @property
    def _last_state(self) -> Observed:
        assert self.observed is not None, "a vehicle is observed before it is flown"
        return self.observed

    @property
    def _present_route(self) -> Route:
        assert self.route is not None, "it is on a route"
        return self.route

    def _goal_distance(self) -> float:
        """Return the distance of the vehicle from its route [m] at its last observation."""
        goal = self._present_route.goal(self._last_state.time).position
        return float(np.linalg.norm(np.array(self._last_state.body.position) - goal))

    def _recent_state(self, now: float) -> Observed:
        if self.observed is None or now - self.observed.time > _MAX_STATE_AGE:
            raise SpecError("nothing was heard of the vehicle lately; see that its odometry comes")
        return self.observed

    def _go(self, doing: Doing, now: float, path: Trajectory, yaw: float) -> None:
        self.doing, self.route = doing, Route(path, now, yaw)

    def _goal_on_route(self, now: float) -> PositionGoal:
        return self._present_route.goal(now + self._period)


def rehearse(vehicle: Vehicle, gravity: float) -> None:
    """Fly up, to a halt, and down a vehicle that is always at its goal.

    This dry run imports all modules of a real flight before a vehicle waits for them.

    Args:
        vehicle: of which the maximum thrust is used for braking.
        gravity: [m/s²].
    """
    period, now = 0.1, 0.0  # [s]
    commander = Commander(vehicle, gravity, period)
    standing = Body((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
    commander.observe(Observed(now, standing))
    commander.take_off(now, height=1.0)
    for order in (commander.hover, commander.land, None):
        while commander.doing not in (Doing.HOVERING, Doing.NOTHING):
            goal, now = commander.step(now), now + period
            if goal is not None:
                reached = goal.position, goal.velocity, goal.q_world_body, goal.omega
                commander.observe(Observed(now, Body(*(tuple(part.tolist()) for part in reached))))
        if order is not None:
            order(now)
