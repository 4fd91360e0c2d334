"""What happens on the way: a maneuver is a list of stages, each a set of linear conditions at one interval.

The paper's Section II gives four; all of them, and whatever follows, are such lists.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import ClassVar, Protocol

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate, unit
from aerobat.problem.stage import Condition, Course, Quantity, Stage

PAPER_LATERAL = 18.0  # [m/s²] ε_y and ε_x of the authors' reference code
PAPER_INVERTED = 25.0  # [m/s²] ε_z of the authors' reference code
UP = np.array([0.0, 0.0, 1.0])


class Maneuver(Protocol):
    """Anything that can say its stages, given the gate and the greatest specific thrust [m/s²] to be had."""

    needs_gate: ClassVar[bool]

    def course(self, gate: Gate | None, max_specific_thrust: float) -> Course:
        """The maneuver's stages."""
        ...

    def as_in_paper(self) -> Maneuver:
        """The same maneuver exactly as the paper prints it, with the reference code's numbers."""
        ...


@dataclass(frozen=True)
class Passing:
    """How a gate is passed, beyond meeting its centre.

    A `square` passage moves along the gate's direction of passage, at `speed` or faster, and not across it,
    so that a vehicle of some size fits through. The gate is met at half the duration when `centred`, and
    otherwise one interval later, at the end of interval N/2, as in the authors' reference code; there
    the velocity is free.
    """

    square: bool = True
    speed: float = 0.0  # [m/s]
    centred: bool = True

    def __post_init__(self) -> None:
        """Check."""
        if not 0.0 <= self.speed < inf:
            raise SpecError(f"maneuver.speed must be a speed in m/s, zero or more, got {self.speed}")

    def stage(self, gate: Gate | None, conditions: Sequence[Condition]) -> Stage:
        """The stage of passing `gate` with `conditions` on top. Raises SpecError without a gate."""
        if gate is None:
            raise no_gate()
        velocity = [Condition(Quantity.VELOCITY, gate.normal, lower=self.speed)]
        velocity += [Condition(Quantity.VELOCITY, across, 0.0, 0.0) for across in (gate.lateral, gate.up)]
        asked = (*at_centre(gate), *(velocity if self.square else ()), *conditions)
        return Stage("gate", asked, at=0.5, late=0 if self.centred else 1, gate=gate)


PAPER_PASSING = Passing(square=False, centred=False)


@dataclass(frozen=True)
class Flip:
    """A full turn about a horizontal axis, upside down in the gate (paper, Sections II-A to II-C).

    Five stages: thrust at 45°, 90°, upside down in the gate, at 270° and at 315° of the turn. Each asks
    for thrust along that direction: none across it in the plane of the turn, and at least `lateral`
    (at 45°, 90°, 270°, 315°) or `inverted` (in the gate) along it, in m/s²; by default shares of what
    the vehicle can give. As the paper prints it (`signed` and `ordered` False) the stages at 45° and 315°
    take either sign and the solver may turn either way. The gate is passed as `Passing` says.
    """

    axis_deg: float = 0.0  # heading of the axis of the turn, right-handed: 0 turns about +x, 90 about +y
    lateral: float | None = None  # [m/s²]
    inverted: float | None = None  # [m/s²]
    signed: bool = True
    ordered: bool = True
    passing: Passing = Passing()
    needs_gate: ClassVar[bool] = True

    LATERAL_SHARE: ClassVar[float] = 0.2  # of the greatest specific thrust
    INVERTED_SHARE: ClassVar[float] = 0.2

    def __post_init__(self) -> None:
        """Check."""
        if not isfinite(self.axis_deg):
            raise SpecError("maneuver.axis_deg must be a finite angle in degrees")
        _check_thrust(self.lateral, "lateral")
        _check_thrust(self.inverted, "inverted")

    def course(self, gate: Gate | None, max_specific_thrust: float) -> Course:
        """The five stages, the gate's fixed at the middle."""
        lateral = self.LATERAL_SHARE * max_specific_thrust if self.lateral is None else self.lateral
        inverted = self.INVERTED_SHARE * max_specific_thrust if self.inverted is None else self.inverted
        diagonal = lateral if self.signed else -inf
        heading = np.deg2rad(self.axis_deg)
        axis = np.array([np.cos(heading), np.sin(heading), 0.0])
        turn = {
            name: thrust_along(so3.rotate(so3.about_axis(axis, np.deg2rad(angle)), UP), axis, least)
            for name, angle, least in (
                ("45°", 45.0, diagonal),
                ("90°", 90.0, lateral),
                ("gate", 180.0, inverted),
                ("270°", 270.0, lateral),
                ("315°", 315.0, diagonal),
            )
        }
        stages = tuple(
            self.passing.stage(gate, conditions) if name == "gate" else Stage(name, conditions)
            for name, conditions in turn.items()
        )
        return Course(stages, ordered=self.ordered)

    def as_in_paper(self) -> Flip:
        """Unsigned, unordered, with ε_l = 18 and ε_z = 25 m/s²."""
        return Flip(self.axis_deg, PAPER_LATERAL, PAPER_INVERTED, False, False, PAPER_PASSING)


@dataclass(frozen=True)
class HalfFlip:
    """Thrust along the tilted gate's upright while passing it, never upside down (paper, Section II-D).

    `lateral` is the least horizontal thrust across the direction of passage [m/s²], the paper's ε_y;
    by default the thrust along the upright is at least a share of what the vehicle can give.
    """

    lateral: float | None = None  # [m/s²]
    passing: Passing = Passing()
    needs_gate: ClassVar[bool] = True

    THRUST_SHARE: ClassVar[float] = 0.2  # of the greatest specific thrust

    def __post_init__(self) -> None:
        """Check."""
        _check_thrust(self.lateral, "lateral")

    def course(self, gate: Gate | None, max_specific_thrust: float) -> Course:
        """One stage, the gate, and upright thrust at all times: (a_z + g) tan α = a_y, α = 90° included."""
        if gate is None:
            raise no_gate()
        conditions = thrust_along(gate.up, gate.normal, self._least(gate, max_specific_thrust))
        upright = Condition(Quantity.SPECIFIC_THRUST, UP, lower=0.0)
        return Course((self.passing.stage(gate, conditions),), (upright,))

    def _least(self, gate: Gate, max_specific_thrust: float) -> float:
        """The least thrust along the gate's upright [m/s²]."""
        if gate.up[2] < -1e-9:
            raise SpecError("gate.tilt_deg must be from -90 to 90 for a half-flip; past that it is a flip")
        if self.lateral is None:
            return self.THRUST_SHARE * max_specific_thrust
        across = float(np.hypot(gate.up[0], gate.up[1]))
        if across < 1e-9:
            raise SpecError(
                "maneuver.lateral asks for thrust sideways, which an upright gate has not; tilt it"
            )
        return self.lateral / across

    def as_in_paper(self) -> HalfFlip:
        """With ε_y = 18 m/s²."""
        return HalfFlip(PAPER_LATERAL, PAPER_PASSING)


@dataclass(frozen=True)
class Line:
    """From start to goal, through the gate at mid-time if there is one, with no attitude asked."""

    passing: Passing = Passing()
    needs_gate: ClassVar[bool] = False

    def course(self, gate: Gate | None, max_specific_thrust: float) -> Course:
        """No stage but the gate."""
        return Course(() if gate is None else (self.passing.stage(gate, ()),))

    def as_in_paper(self) -> Line:
        """With the gate passed as there."""
        return Line(PAPER_PASSING)


@dataclass(frozen=True)
class Staged:
    """Any maneuver, spelled out: its stages as data."""

    stages: tuple[Stage, ...]
    always: tuple[Condition, ...] = ()
    ordered: bool = True
    needs_gate: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Keep tuples."""
        object.__setattr__(self, "stages", tuple(self.stages))
        object.__setattr__(self, "always", tuple(self.always))

    def course(self, gate: Gate | None, max_specific_thrust: float) -> Course:
        """Its stages as they stand; one named 'gate' also passes the centre of the problem's gate."""
        stages = tuple(
            replace(s, conditions=(*at_centre(gate), *s.conditions), gate=gate)
            if gate is not None and s.name == "gate"
            else s
            for s in self.stages
        )
        return Course(stages, self.always, self.ordered)

    def as_in_paper(self) -> Staged:
        """Itself: the paper prints no such maneuver."""
        return self


def thrust_along(direction: Array, axis: Array, at_least: float) -> tuple[Condition, ...]:
    """Specific thrust along `direction` in the plane normal to `axis`: none across, `at_least` along."""
    along = unit(direction, "direction")
    across = Condition(Quantity.SPECIFIC_THRUST, unit(np.cross(axis, direction), "direction"), 0.0, 0.0)
    if at_least == -inf:
        return (across,)
    return (across, Condition(Quantity.SPECIFIC_THRUST, along, lower=at_least))


def at_centre(gate: Gate) -> tuple[Condition, ...]:
    """Meeting the centre of a gate's opening."""
    return tuple(
        Condition(Quantity.POSITION, e, x, x) for e, x in zip(np.eye(3), gate.position.tolist(), strict=True)
    )


def no_gate() -> SpecError:
    """What to say to a maneuver that lacks its gate."""
    return SpecError("the maneuver passes a gate: give the problem a [gate] table")


def _check_thrust(value: float | None, name: str) -> None:
    if value is not None and not 0.0 < value < inf:
        raise SpecError(f"maneuver.{name} must be a positive specific thrust in m/s², got {value}")
