"""A path through waypoints, each with as many components given as one likes (paper, Section V-B)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate, unit
from aerobat.problem.maneuver import at_centre, named_gate
from aerobat.problem.stage import Condition, Quantity, Stage, StageSequence

FREE = np.nan  # a component that is not given
THRUST_FRACTION = 0.2  # of the greatest specific thrust: the least along an attitude that names no thrust
GIVEN = (Quantity.POSITION, Quantity.VELOCITY, Quantity.ACCELERATION)


def _free() -> Array:
    return np.full(3, FREE)


@dataclass(frozen=True)
class Waypoint:
    """What is given where one passes by, world frame; components that are NaN are free.

    `up` asks that the thrust points there, with exactly `thrust` per mass, or, without it, with at least a
    share of what the vehicle has. A `gate` is passed through its centre, by name. `time` is when to pass by
    at first, for planners that begin from times.

    Raises SpecError when nothing is given, a number is infinite, or acceleration and attitude both are.
    """

    position: Array = field(default_factory=_free)  # [m], (3,)
    velocity: Array = field(default_factory=_free)  # [m/s], (3,)
    acceleration: Array = field(default_factory=_free)  # [m/s²], (3,)
    up: Array | None = None  # direction of the thrust, (3,)
    thrust: float | None = None  # [m/s²] |a + g e3|
    time: float | None = None  # [s]
    gate: str | None = None

    def __post_init__(self) -> None:
        """Check and keep read-only copies."""
        for quantity in GIVEN:
            name = quantity.value
            object.__setattr__(self, name, _components(getattr(self, name), name))
        if self.up is not None:
            object.__setattr__(self, "up", unit(self.up, "up"))
        if self.thrust is not None and (self.up is None or not 0.0 < self.thrust < inf):
            raise SpecError("thrust must be a positive specific thrust in m/s² and needs up, its direction")
        if self.up is not None and not np.isnan(self.acceleration).all():
            raise SpecError("acceleration and up both fix the attitude; give one of them")
        free = all(np.isnan(getattr(self, q.value)).all() for q in GIVEN)
        if free and self.up is None and self.gate is None:
            raise SpecError("nothing is given; give at least one component of the position")
        if self.time is not None and not 0.0 < self.time < inf:
            raise SpecError(f"time must be a positive number of seconds, got {self.time}")

    def conditions(self, max_specific_thrust: float) -> Iterable[Condition]:
        """What is given, as conditions of a stage."""
        for quantity in GIVEN:
            for direction, value in zip(np.eye(3), getattr(self, quantity.value).tolist(), strict=True):
                if not np.isnan(value):
                    yield Condition(quantity, direction, value, value)
        if self.up is None:
            return
        if self.thrust is None:
            for axis in _across(self.up):
                yield Condition(Quantity.SPECIFIC_THRUST, axis, 0.0, 0.0)
            yield Condition(Quantity.SPECIFIC_THRUST, self.up, lower=THRUST_FRACTION * max_specific_thrust)
            return
        for direction, value in zip(np.eye(3), (self.thrust * self.up).tolist(), strict=True):
            yield Condition(Quantity.SPECIFIC_THRUST, direction, value, value)


@dataclass(frozen=True)
class Waypoints:
    """From start to goal through waypoints in their order.

    `duration` is that of the whole path at first, for planners that begin from times (paper, Section V-D:
    its waypoint at 0.5 s, its end at 2 s).

    Raises SpecError for an empty list and for times that do not rise.
    """

    waypoints: tuple[Waypoint, ...]
    duration: float | None = None  # [s]

    def __post_init__(self) -> None:
        """Check."""
        object.__setattr__(self, "waypoints", tuple(self.waypoints))
        if not self.waypoints:
            raise SpecError("maneuver.waypoints must hold at least one; for none take the kind 'line'")
        if self.duration is not None and not 0.0 < self.duration < inf:
            raise SpecError(f"maneuver.duration must be a positive number of seconds, got {self.duration}")
        times = [t for t in (0.0, *(w.time for w in self.waypoints), self.duration) if t is not None]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise SpecError("maneuver.waypoints: their times must rise, and duration must come last")

    @property
    def times(self) -> tuple[float, ...] | None:
        """The times of all waypoints and of the end [s], if every one is given."""
        times = [*(w.time for w in self.waypoints), self.duration]
        return None if None in times else tuple(t for t in times if t is not None)

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """A stage a waypoint, in order, each at a time that the planner chooses."""
        return StageSequence(
            tuple(self._stage(i, gates, max_specific_thrust) for i in range(len(self.waypoints)))
        )

    def as_in_paper(self) -> Waypoints:
        """Itself: Section II of the paper prints no such maneuver."""
        return self

    def _stage(self, i: int, gates: Sequence[Gate], max_specific_thrust: float) -> Stage:
        waypoint = self.waypoints[i]
        conditions = tuple(waypoint.conditions(max_specific_thrust))
        if waypoint.gate is None:
            return Stage(f"waypoint {i + 1}", conditions)
        gate = named_gate(gates, waypoint.gate)
        return Stage(gate.name, (*at_centre(gate), *conditions), gate=gate.name)


def _components(values: Array, name: str) -> Array:
    """Three numbers, NaN where free, read-only."""
    array = np.array(values, dtype=float)
    if array.shape != (3,) or np.isinf(array).any():
        raise SpecError(
            f"{name} must be three numbers, NaN for a free one, got {np.asarray(values).tolist()}"
        )
    array.flags.writeable = False
    return array


def _across(direction: Array) -> tuple[Array, Array]:
    """Two unit vectors normal to a unit vector and to each other."""
    first = unit(np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))]), "up")
    return first, unit(np.cross(direction, first), "up")
