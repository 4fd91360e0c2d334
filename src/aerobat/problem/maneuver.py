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
from aerobat.documents import unknown_name
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate, unit
from aerobat.problem.stage import Condition, Quantity, Stage, StageSequence

PAPER_LATERAL = 18.0  # [m/s²] ε_y and ε_x of the authors' reference code
PAPER_INVERTED = 25.0  # [m/s²] ε_z of the authors' reference code
UP = np.array([0.0, 0.0, 1.0])


class Maneuver(Protocol):
    """Anything that says its stages, given gates and the greatest specific thrust [m/s²] to be had."""

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """The maneuver's stages. Raises SpecError for gates that do not suit it."""
        ...

    def as_in_paper(self) -> Maneuver:
        """The same maneuver exactly as the paper prints it, with the reference code's numbers."""
        ...


@dataclass(frozen=True)
class GatePassage:
    """How a gate is passed, beyond meeting its centre.

    A `perpendicular` passage moves along the gate's direction of passage, at `speed` or faster, and not
    across it, so that a vehicle of some size fits through. The gate is met at half the duration when
    `centred`, and otherwise one interval later, at the end of interval N/2, as in the authors' reference
    code; there the velocity is free.
    """

    perpendicular: bool = True
    speed: float = 0.0  # [m/s]
    centred: bool = True

    def __post_init__(self) -> None:
        """Check."""
        if not 0.0 <= self.speed < inf:
            raise SpecError(f"maneuver.passage.speed must be a speed in m/s, zero or more, got {self.speed}")

    def stage(self, gate: Gate, conditions: Sequence[Condition]) -> Stage:
        """The stage of passing `gate` with `conditions` on top."""
        velocity = [Condition(Quantity.VELOCITY, gate.normal, lower=self.speed)]
        velocity += [Condition(Quantity.VELOCITY, across, 0.0, 0.0) for across in (gate.lateral, gate.up)]
        asked = (*at_centre(gate), *(velocity if self.perpendicular else ()), *conditions)
        return Stage(gate.name, asked, at=0.5, interval_offset=0 if self.centred else 1, gate=gate.name)


PAPER_PASSAGE = GatePassage(perpendicular=False, centred=False)


@dataclass(frozen=True)
class Flip:
    """A full turn about a horizontal axis, upside down in the gate (paper, Sections II-A to II-C).

    Five stages: thrust at 45°, 90°, upside down in the gate, at 270° and at 315° of the turn. Each asks
    for thrust along that direction: none across it in the plane of the turn, and at least
    `min_lateral_thrust` (at 45°, 90°, 270°, 315°) or `min_inverted_thrust` (in the gate) along it, in
    m/s²; by default fractions of what the vehicle can give. As the paper prints it (`signed` and `ordered`
    False) the stages at 45° and 315° take either sign and the solver may turn either way. The gate is passed
    as `passage` says.
    """

    axis_deg: float = 0.0  # heading of the axis of the turn, right-handed: 0 turns about +x, 90 about +y
    min_lateral_thrust: float | None = None  # [m/s²]
    min_inverted_thrust: float | None = None  # [m/s²]
    signed: bool = True
    ordered: bool = True
    passage: GatePassage = GatePassage()

    LATERAL_FRACTION: ClassVar[float] = 0.2  # of the greatest specific thrust
    INVERTED_FRACTION: ClassVar[float] = 0.2

    def __post_init__(self) -> None:
        """Check."""
        if not isfinite(self.axis_deg):
            raise SpecError("maneuver.axis_deg must be a finite angle in degrees")
        _check_thrust(self.min_lateral_thrust, "min_lateral_thrust")
        _check_thrust(self.min_inverted_thrust, "min_inverted_thrust")

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """The five stages, the gate's fixed at the middle. Raises SpecError unless there is one gate."""
        gate = only_gate(gates, "flip")
        lateral, inverted = self.min_lateral_thrust, self.min_inverted_thrust
        if lateral is None:
            lateral = self.LATERAL_FRACTION * max_specific_thrust
        if inverted is None:
            inverted = self.INVERTED_FRACTION * max_specific_thrust
        diagonal = lateral if self.signed else -inf
        heading = np.deg2rad(self.axis_deg)
        axis = np.array([np.cos(heading), np.sin(heading), 0.0])
        turn = {
            name: thrust_along(so3.rotate(so3.about_axis(axis, np.deg2rad(angle)), UP), axis, minimum)
            for name, angle, minimum in (
                ("45°", 45.0, diagonal),
                ("90°", 90.0, lateral),
                ("gate", 180.0, inverted),
                ("270°", 270.0, lateral),
                ("315°", 315.0, diagonal),
            )
        }
        stages = tuple(
            self.passage.stage(gate, conditions) if name == "gate" else Stage(name, conditions)
            for name, conditions in turn.items()
        )
        return StageSequence(stages, ordered=self.ordered)

    def as_in_paper(self) -> Flip:
        """Unsigned, unordered, with ε_l = 18 and ε_z = 25 m/s²."""
        return Flip(self.axis_deg, PAPER_LATERAL, PAPER_INVERTED, False, False, PAPER_PASSAGE)


@dataclass(frozen=True)
class HalfFlip:
    """Thrust along the tilted gate's upright while passing it, never upside down (paper, Section II-D).

    `min_lateral_thrust` is the least horizontal thrust across the direction of passage [m/s²], the paper's
    ε_y; by default the thrust along the upright is at least a share of what the vehicle can give.
    """

    min_lateral_thrust: float | None = None  # [m/s²]
    passage: GatePassage = GatePassage()

    THRUST_FRACTION: ClassVar[float] = 0.2  # of the greatest specific thrust

    def __post_init__(self) -> None:
        """Check."""
        _check_thrust(self.min_lateral_thrust, "min_lateral_thrust")

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """One stage, the gate, and upright thrust at all times: (a_z + g) tan α = a_y, α = 90° included.

        Raises SpecError unless there is one gate, its upright not below the horizontal.
        """
        gate = only_gate(gates, "half-flip")
        conditions = thrust_along(gate.up, gate.normal, self._min_thrust(gate, max_specific_thrust))
        upright = Condition(Quantity.SPECIFIC_THRUST, UP, lower=0.0)
        return StageSequence((self.passage.stage(gate, conditions),), (upright,))

    def _min_thrust(self, gate: Gate, max_specific_thrust: float) -> float:
        """The least thrust along the gate's upright [m/s²]."""
        if gate.up[2] < -1e-9:
            raise SpecError("gate.tilt_deg must be from -90 to 90 for a half-flip; past that it is a flip")
        if self.min_lateral_thrust is None:
            return self.THRUST_FRACTION * max_specific_thrust
        across = float(np.hypot(gate.up[0], gate.up[1]))
        if across < 1e-9:
            raise SpecError(
                "maneuver.min_lateral_thrust asks for thrust sideways, which an upright gate has not; tilt it"
            )
        return self.min_lateral_thrust / across

    def as_in_paper(self) -> HalfFlip:
        """With ε_y = 18 m/s²."""
        return HalfFlip(PAPER_LATERAL, PAPER_PASSAGE)


@dataclass(frozen=True)
class Line:
    """From start to goal with no attitude asked, through gates in their order; a single one at mid-time."""

    passage: GatePassage = GatePassage()

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """No stages but the gates."""
        stages = tuple(self.passage.stage(gate, ()) for gate in gates)
        if len(stages) > 1:  # when each is passed is for the search to choose
            stages = tuple(replace(stage, at=None, interval_offset=0) for stage in stages)
        return StageSequence(stages)

    def as_in_paper(self) -> Line:
        """With the gate passed as there."""
        return Line(PAPER_PASSAGE)


@dataclass(frozen=True)
class CustomManeuver:
    """Any maneuver, spelled out: its stages as data; one that names a gate passes its centre too."""

    sequence: tuple[Stage, ...]
    path_constraints: tuple[Condition, ...] = ()
    ordered: bool = True

    def __post_init__(self) -> None:
        """Keep tuples."""
        object.__setattr__(self, "sequence", tuple(self.sequence))
        object.__setattr__(self, "path_constraints", tuple(self.path_constraints))

    def stages(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Its stages, those that name a gate through its centre. Raises SpecError for unknown gates."""
        stages = tuple(
            s
            if s.gate is None
            else replace(s, conditions=(*at_centre(named_gate(gates, s.gate)), *s.conditions))
            for s in self.sequence
        )
        return StageSequence(stages, self.path_constraints, self.ordered)

    def as_in_paper(self) -> CustomManeuver:
        """Itself: the paper prints no such maneuver."""
        return self


def thrust_along(direction: Array, axis: Array, minimum: float) -> tuple[Condition, ...]:
    """Specific thrust along `direction` in the plane normal to `axis`: none across, a minimum along."""
    along = unit(direction, "direction")
    across = Condition(Quantity.SPECIFIC_THRUST, unit(np.cross(axis, direction), "direction"), 0.0, 0.0)
    if minimum == -inf:
        return (across,)
    return (across, Condition(Quantity.SPECIFIC_THRUST, along, lower=minimum))


def at_centre(gate: Gate) -> tuple[Condition, ...]:
    """Meeting the centre of a gate's opening."""
    return tuple(
        Condition(Quantity.POSITION, e, x, x) for e, x in zip(np.eye(3), gate.position.tolist(), strict=True)
    )


def only_gate(gates: Sequence[Gate], maneuver: str) -> Gate:
    """The one gate of a maneuver that passes one. Raises SpecError when there are none or several."""
    if len(gates) != 1:
        has = "none" if not gates else str(len(gates))
        raise SpecError(
            f"a {maneuver} passes one gate, there is {has}; give one table [[gates]] with a position"
        )
    return gates[0]


def named_gate(gates: Sequence[Gate], name: str) -> Gate:
    """The gate of that name. Raises SpecError when there is none."""
    for gate in gates:
        if gate.name == name:
            return gate
    raise unknown_name("gate", name, [gate.name for gate in gates])


def _check_thrust(value: float | None, name: str) -> None:
    if value is not None and not 0.0 < value < inf:
        raise SpecError(f"maneuver.{name} must be a positive specific thrust in m/s², got {value}")
