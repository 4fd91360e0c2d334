"""A plan's whole flight over a live link: to its start, along the plan, to a hover and down; abort criteria.

Missions are the same for every link: they use times, states and goals, but no messages.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from itertools import pairwise
from math import hypot, pi
from typing import Generic, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import Positive, declared
from aerobat.errors import SpecError
from aerobat.links.goals import Observed, PositionGoal, yaw_of
from aerobat.links.routes import goal_on, rest_to_rest
from aerobat.links.stream import SetpointStream
from aerobat.planning import Plan
from aerobat.simulation.autopilot.braking import Braking
from aerobat.simulation.outcome import length
from aerobat.trajectory import Trajectory

_START_TOLERANCE = 0.1  # [m] distance from the start within which a vehicle has reached it
_START_SPEED = 0.15  # [m/s] speed below which a vehicle has reached the start
_AT_REST = 1e-3  # [m/s], [m/s²] largest motion of a plan's start and end at a hover
_CLIMB = 1.0  # [m] least vertical climb before the approach


class Phase(StrEnum):
    """The phase of a mission."""

    READY = "ready on the ground"
    CLIMB = "climbing"
    APPROACH = "going to the plan's start"
    SETTLE = "coming to rest there"
    MANEUVER = "flying the plan"
    HOLD = "holding where it ends"
    LAND = "landing"
    ABORTED = "aborted"


@declared
class MissionSettings:
    """Settings of a flight over a live link, and its abort criteria."""

    cruise_speed: Positive = 2.0  # [m/s] on the way to the plan's start
    cruise_acceleration: Positive = 2.0  # [m/s²] on the way to the plan's start
    settling: Positive = 0.5  # [s] at rest at the start before the plan begins, and at its end
    patience: Positive = 20.0  # [s] time limit for coming to rest at the start
    max_error: Positive = 1.0  # [m] largest distance from the path
    max_silence: Positive = 0.25  # [s] longest time without a state of the vehicle while the plan is flown
    max_silence_outside: Positive = 1.0  # [s] longest time without a state at other times
    max_lateness: Positive = 0.1  # [s] largest delay of a set-point while the plan is flown


GoalT = TypeVar("GoalT")


class Mission(Generic[GoalT]):
    """The sequence of a flight: returns the goal of each tick from observed states of the vehicle."""

    def __init__(
        self,
        plan: Plan,
        settings: MissionSettings,
        stream: SetpointStream,
        command: Callable[[float, Observed], GoalT],
    ) -> None:
        """Prepare to fly a plan.

        Args:
            plan: the plan, certified for its vehicle; see `require_flyable`.
            settings: of the mission.
            stream: the set-points of the plan, in the vehicle's own frame.
            command: returns the goal at a time along the plan, from the last state of the vehicle; both
                times are since the plan's start [s].
        """
        assert plan.vehicle is not None, "a plan that is flyable has a vehicle"
        self.settings = settings
        self.phase = Phase.READY
        self.reason = ""  # the reason of an abort
        self.max_lateness = 0.0  # [s] largest delay of the plan's set-points so far
        self.log: list[Observed] = []  # states while the plan was flown, with times since its start [s]
        self.gravity = plan.problem.environment.gravity  # [m/s²]
        self.stream = stream
        self._command = command
        first, last = self.stream.flat(0.0), self.stream.flat(self.stream.duration)
        for end, state in (("begins", first), ("ends", last)):
            speed = float(np.linalg.norm(state.velocity))
            if speed > _START_SPEED:
                raise SpecError(
                    f"the plan {end} at {speed:.2f} m/s, a mission at rest; plan it from and to rest"
                )
        self._start = first.position
        self._heading = plan.trajectory.heading
        self._final_yaw = yaw_of(self.stream.at(self.stream.duration).q_world_body)
        motion = last.position, last.velocity
        self._after = Braking.of(*motion, plan.vehicle, self.gravity, -np.inf).trajectory
        self.began = np.nan  # [s] start time of the phase
        self.maneuver_began = np.nan  # [s]
        self._last_tick = np.nan
        self._rested_since = np.nan
        self._routes: list[Trajectory] = []
        self._turn = (0.0, 0.0)  # [rad] initial yaw, and the turn on the first route

    def begin(self, now: float, observed: Observed) -> None:
        """Take off with an armed vehicle that obeys; `observed` is its state on the ground."""
        here = np.array(observed.body.position)
        above = np.array([here[0], here[1], max(self._start[2], here[2] + _CLIMB)])
        self._set_out(now, observed, Phase.CLIMB, here, above)

    def join(self, now: float, observed: Observed) -> None:
        """Fly to the plan's start from a hover, whose state is `observed`."""
        self._set_out(now, observed, Phase.APPROACH, np.array(observed.body.position))

    def observe(self, observed: Observed) -> None:
        """Log a state of the vehicle while the plan is flown."""
        if self.phase is Phase.MANEUVER:
            self.log.append(self._since_start(observed))

    def step(
        self, now: float, observed: Observed, delay: float, late: float = 0.0
    ) -> PositionGoal | GoalT | None:
        """Return the goal at this time; None where the vehicle holds or lands by itself.

        Args:
            now: the time [s].
            observed: the latest state of the vehicle.
            delay: of a goal on its way to the vehicle [s].
            late: by how much this goal is late [s]; the time since the last tick counts if it is longer.
        """
        self._watch(now, observed, late)
        self._last_tick = now
        if self.phase is Phase.CLIMB:
            return self._route_goal(now, Phase.APPROACH)
        if self.phase is Phase.APPROACH:
            return self._route_goal(now, Phase.SETTLE)
        if self.phase is Phase.SETTLE:
            self._settle(now, observed)
        if self.phase is Phase.MANEUVER:
            return self._maneuver(now, observed, delay)
        if self.phase is Phase.SETTLE:
            return PositionGoal.hover(self._start, self._heading)
        if self.phase is Phase.HOLD and now - self.began > self._after.duration + self.settings.settling:
            self._enter(Phase.LAND, now)
        return goal_on(self._after, now - self.began, self._final_yaw) if self.phase is Phase.HOLD else None

    def abort(self, now: float, reason: str) -> None:
        """Abort the mission: the vehicle is to hover."""
        if self.phase not in (Phase.ABORTED, Phase.LAND):
            self.reason = reason
            self._enter(Phase.ABORTED, now)

    @property
    def end(self) -> PositionGoal:
        """The goal of the hover after the plan."""
        return goal_on(self._after, self._after.duration, self._final_yaw)

    def error(self, observed: Observed) -> float:
        """Return the distance of the vehicle from the plan at the time of the observation [m]."""
        expected = self.stream.flat(self._since_start(observed).time).position
        return float(np.linalg.norm(np.array(observed.body.position) - expected))

    def _set_out(self, now: float, observed: Observed, phase: Phase, *places: Array) -> None:
        """Enter the first phase of the way over places [m], (3,) each, to the plan's start and heading."""
        limits = (self.settings.cruise_speed, self.settings.cruise_acceleration)
        legs = pairwise((*places, self._start))
        self._routes = [rest_to_rest(begin, end, *limits) for begin, end in legs]
        yaw = yaw_of(observed.body.q_world_body)
        self._turn = yaw, (self._heading - yaw + pi) % (2 * pi) - pi
        self._enter(phase, now)

    def _since_start(self, observed: Observed) -> Observed:
        """Return a state with the time since the plan's start."""
        return observed._replace(time=observed.time - self.maneuver_began)

    def _enter(self, phase: Phase, now: float) -> None:
        self.phase, self.began = phase, now

    def _watch(self, now: float, observed: Observed, late: float) -> None:
        """Abort where an abort criterion is met: silence, lateness or position error."""
        flying = self.phase is Phase.MANEUVER
        if self.phase in (Phase.READY, Phase.ABORTED, Phase.LAND):
            return
        silence = now - observed.time
        allowed = self.settings.max_silence if flying else self.settings.max_silence_outside
        late = max(late, now - self._last_tick)
        if flying:
            self.max_lateness = max(self.max_lateness, late)
        if silence > allowed:
            self.abort(now, f"no news of the vehicle for {silence:.2f} s")
        elif flying and late > self.settings.max_lateness:
            self.abort(now, f"a set-point was {late:.2f} s late")
        elif flying and (error := self.error(observed)) > self.settings.max_error:
            self.abort(now, f"the vehicle is {length(error)} off its path")

    def _route_goal(self, now: float, following: Phase) -> PositionGoal:
        """Return the goal on the present route, and enter the next phase at its end."""
        route = self._routes[0]
        since = min(now - self.began, route.duration)
        yaw, turn = self._turn
        if since == route.duration:
            self._routes = self._routes[1:]
            self._turn = (yaw + turn, 0.0)
            self._enter(following, now)
        return goal_on(route, since, yaw + turn * since / route.duration)

    def _settle(self, now: float, observed: Observed) -> None:
        """Begin the plan once the vehicle has been at rest at its start for long enough, or abort."""
        body = observed.body
        off = float(np.linalg.norm(np.array(body.position) - self._start))
        if off > _START_TOLERANCE or hypot(*body.velocity) > _START_SPEED:
            self._rested_since = np.nan
        elif np.isnan(self._rested_since):
            self._rested_since = now
        if now - self._rested_since >= self.settings.settling:
            self._enter(Phase.MANEUVER, now)
            self.maneuver_began = now
        elif now - self.began > self.settings.patience:
            self.abort(now, f"the vehicle does not come to rest at the plan's start, it is {length(off)} off")

    def _maneuver(self, now: float, observed: Observed, delay: float) -> PositionGoal | GoalT:
        since = now - self.maneuver_began + delay
        if since >= self.stream.duration:
            self._enter(Phase.HOLD, now)
            return goal_on(self._after, 0.0, self._final_yaw)
        return self._command(since, self._since_start(observed))


def require_flyable(plan: Plan, offset: Array, vehicle_name: str | None = None) -> None:
    """Check that a plan is proven for the vehicle that will fly it, and begins and ends at a hover.

    Raises SpecError, one sentence, otherwise; nothing has been armed by then.

    Args:
        plan: the plan.
        offset: position of its origin in the vehicle's frame [m], ENU, (3,).
        vehicle_name: of the vehicle that will fly it, where that is known.
    """
    label = f"the plan '{plan.problem.name}'"
    if plan.vehicle is None:
        raise SpecError(f"{label} is for no vehicle; plan it for the one that shall fly it")
    name = plan.vehicle.name
    if vehicle_name is not None and name != vehicle_name:
        raise SpecError(
            f"{label} is certified for {name}, not for {vehicle_name}; plan it for the one that is there"
        )
    if not plan.certified:
        raise SpecError(
            f"{label} is not certified for {name} ({plan.certificate}); plan it within its limits"
        )
    if not plan.flies:
        raise SpecError(f"{label} is {plan.flyability}; plan it again with a reserve")
    for time, at_end, remedy in (
        (0.0, "begins", "plan it from a hover, where a link can begin it"),
        (plan.duration, "ends", "plan it to a goal at rest, where a link can hover"),
    ):
        motion = [float(np.linalg.norm(plan.trajectory.evaluate(time, k))) for k in (1, 2)]
        if max(motion) > _AT_REST:
            raise SpecError(f"{label} {at_end} in motion; {remedy}")
    lowest = float(plan.trajectory.component_range(0)[0][2] + offset[2])
    if lowest <= 0.0:
        raise SpecError(
            f"{label} would go down to {lowest:.2f} m over where the vehicle stands; raise its origin"
        )
