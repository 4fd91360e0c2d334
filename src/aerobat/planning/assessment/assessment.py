"""The assessment of a plan beside its proof: its duration against a lower bound, and its room."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, dist, inf, radians

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Certificate, Side
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.task import Task
from aerobat.planning.turns import extra_turns
from aerobat.trajectory import Trajectory

POOR = 1.4  # ratio to another plan's duration above which a plan is poor
SUSPICIOUS = 2.0  # ratio to the lower bound above which a plan is suspicious: optima reach up to this ratio
INSTANT = 0.02  # duration [s] up to which no plan is suspicious: a hover has nothing to do, its bound is zero
DIVE = 1.0  # depth [m] below start, goal, gates and stages that is warned of: a common start height indoors
# distance [m] beyond the box of start, goal, gates and stages, plus the box's own size, above which a path
# goes astray: no flip needs so much room
ASTRAY = 5.0
GYRO_RANGE = radians(2000.0)  # measuring range of common gyroscopes [rad/s]

Point = tuple[float, float, float]


@dataclass(frozen=True)
class PositionRange:
    """A box along the world's axes."""

    lower: Point  # [m]
    upper: Point  # [m]

    @property
    def size(self) -> float:
        """The length of the box's diagonal [m]."""
        return dist(self.lower, self.upper)

    def excess(self, other: PositionRange) -> float:
        """Return the distance [m] by which the box exceeds another, along the axis where that is largest."""
        below = (b - a for a, b in zip(self.lower, other.lower, strict=True))
        above = (a - b for a, b in zip(self.upper, other.upper, strict=True))
        return max(*below, *above, 0.0)

    def __str__(self) -> str:
        ends = zip("xyz", self.lower, self.upper, strict=True)
        spans = (
            f"{axis} {round(low, 2) + 0.0:.2f} to {round(high, 2) + 0.0:.2f}" for axis, low, high in ends
        )
        return ", ".join(spans) + " m"  # adding 0.0 turns a rounded −0 into 0


@dataclass(frozen=True)
class SecondOpinion:
    """Another planner's answer to the same problem, made where a plan is suspicious."""

    options: str  # command-line options that give the other plan
    duration: float | None  # [s] of a shorter plan that is certified and flies; None: none was found
    missing: str = ""  # why there is no answer; empty otherwise


@dataclass(frozen=True)
class Assessment:
    """A plan beside what is possible, and beside the room and the rates that are usual."""

    duration: float  # [s] of the plan
    least_duration: float  # [s] lower bound on the duration of any motion of the vehicle
    room: PositionRange  # bounding box of the path
    asked: PositionRange  # bounding box of start, goal, gates and positions of stages
    max_speed: float  # [m/s]
    max_tilt: float | None  # [rad]; None where no attitude is determined
    max_body_rate: float | None  # [rad/s]; None where no attitude is determined
    ground: float | None = None  # [m] height of the environment's ground
    rate_limit: float = inf  # [rad/s] the vehicle's limit on body rate
    obstructed: bool = False  # whether there are obstacles, which the lower bound ignores
    extra_turns: int = 0  # number of turns upside down that no stage asks
    opinion: SecondOpinion | None = None  # None where no other planner was asked

    @classmethod
    def of(cls, task: Task, trajectory: Trajectory, certificate: Certificate) -> Assessment:
        """Return the assessment of a path by its task and its certificate."""
        lowest, highest = trajectory.component_range(0)
        return cls(
            duration=trajectory.duration,
            least_duration=least_duration(task.problem, task.vehicle),
            room=PositionRange(_point(lowest), _point(highest)),
            asked=_asked(task),
            max_speed=_largest(certificate, "speed") or 0.0,
            max_tilt=_largest(certificate, "tilt"),
            max_body_rate=_largest(certificate, "body rate"),
            ground=task.environment.ground,
            rate_limit=task.vehicle.max_body_rate,
            obstructed=bool(task.environment.obstacles),
            extra_turns=extra_turns(trajectory, task.stages, task.balance),
        )

    @property
    def lowest(self) -> float:
        """The height of the lowest point [m]."""
        return self.room.lower[2]

    @property
    def dive(self) -> float:
        """The depth of the lowest point below start, goal, gates and stages [m]."""
        return max(self.asked.lower[2] - self.lowest, 0.0)

    @property
    def ratio(self) -> float:
        """The duration over the lower bound; infinite where that is zero."""
        return self.duration / self.least_duration if self.least_duration else inf

    @property
    def goes_astray(self) -> bool:
        """True if the path leaves the box of start, goal, gates and stages by its size and ASTRAY more."""
        return self.room.excess(self.asked) > ASTRAY + self.asked.size

    @property
    def suspicious(self) -> bool:
        """True if the duration is so far above the lower bound that only another plan can judge it."""
        return self.ratio > SUSPICIOUS and self.duration > INSTANT and not self.obstructed

    @property
    def poor(self) -> bool:
        """True if the duration is more than POOR times that of the second opinion."""
        known = None if self.opinion is None else self.opinion.duration
        return known is not None and self.duration > POOR * known

    @property
    def sentence(self) -> str:
        """A sentence, without its full stop, that compares the duration with the shortest possible."""
        at_most = "how near to the shortest possible is not known"
        if self.ratio < inf:
            least = f"{self.least_duration:.3f} s or more"
            free = " if nothing stood in the way" if self.obstructed else ""
            at_most = f"at most {self.ratio:.2f} times the shortest possible{free}, which takes {least}"
            if self.ratio < 1.0:
                at_most = f"beyond the vehicle's limits, within which the shortest possible takes {least}"
        if self.opinion is None:
            return at_most
        if self.opinion.missing:
            return f"{at_most}; no second opinion: {self.opinion.missing}"
        if self.opinion.duration is None:
            return f"{at_most}; {self.opinion.options} finds none that is shorter"
        if self.poor:
            at_most = f"poor: {self.duration / self.opinion.duration:.1f} times as long as need be"
        planner = self.opinion.options.removeprefix("--planner ").partition(" ")[0]
        return f"{at_most}; {planner} finds {self.opinion.duration:.3f} s ({self.opinion.options})"

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings to a person who is about to fly the plan, each a sentence without its full stop."""
        found = [self.sentence] if self.poor else []
        if self.goes_astray:
            found.append(
                f"goes astray: {self.room.excess(self.asked):.0f} m beyond start, goal, gates and stages, "
                f"which lie within {self.asked.size:.3g} m; give limits.lower and limits.upper"
            )
        if self.extra_turns:
            often = "once" if self.extra_turns == 1 else f"{self.extra_turns} times"
            found.append(
                f"turns over {often} more than the stages ask; another --planner may spare that, "
                "or a start and a goal that are slower or further apart"
            )
        if self.ground is None and self.dive > DIVE:
            found.append(
                f"dives {self.dive:.1f} m below start, goal, gates and stages, to z = {self.lowest:.2f} m; "
                "give environment.ground to keep it above"
            )
        if self.rate_limit == inf and (self.max_body_rate or 0.0) > GYRO_RANGE:
            found.append(
                f"turns at {degrees(self.max_body_rate or 0.0):.0f}°/s, more than common gyroscopes measure, "
                f"{degrees(GYRO_RANGE):.0f}°/s; give the vehicle's max_body_rate"
            )
        return tuple(found)

    def __str__(self) -> str:
        """The assessment in one sentence without its full stop."""
        return "; ".join([*self.warnings] if self.poor else [self.sentence, *self.warnings])


def _asked(task: Task) -> PositionRange:
    """Return the bounding box of start, goal, gates and stages' positions along the world's axes."""
    problem = task.problem
    places = [end.position for end in problem.ends.values()] + [gate.position for gate in problem.gates]
    points = np.reshape(places, (-1, 3))
    lower, upper = points.min(axis=0, initial=inf), points.max(axis=0, initial=-inf)
    for stage in task.stages.stages:
        for condition in stage.where:
            axes = np.flatnonzero(condition.direction)
            if len(axes) == 1:
                for bound in (condition.lower, condition.upper):
                    if abs(bound) < inf:
                        place = bound / condition.direction[axes[0]]
                        lower[axes[0]] = min(lower[axes[0]], place)
                        upper[axes[0]] = max(upper[axes[0]], place)
    return PositionRange(_point(lower), _point(upper))


def _largest(certificate: Certificate, quantity: str) -> float | None:
    """Return the largest value of a quantity along the path; None where the certificate has none."""
    asked = (
        f.value for f in certificate.findings if (f.quantity, f.side, f.place) == (quantity, Side.MAX, None)
    )
    return max(asked, default=None)


def _point(vector: Array) -> Point:
    x, y, z = vector.tolist()
    return x, y, z
