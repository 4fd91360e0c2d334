"""The certificate of a trajectory: proven extrema, and violations that refute it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import degrees, inf
from typing import Literal

from aerobat.declaration import by_value, in_notebooks, validated
from aerobat.errors import Reason
from aerobat.limits.quantity import quantity_name
from aerobat.states import TimeInterval

WHOLE_DIGITS = 6  # digits of a number, up to which it is shown without a power of ten
BINDING = 0.01  # margin, as a fraction of the limit's size, below which a limit is active (binding)


class Verdict(StrEnum):
    """Knowledge about a limit over continuous time."""

    HOLDS = "holds"  # proven, or there is no limit
    VIOLATED = "violated"  # violated at the time given
    # nearer to its limit than the enclosure can resolve, or attitude undetermined on the way
    UNDECIDED = "undecided"


class Side(StrEnum):
    """The side of an extremum: minimum or maximum."""

    MIN = "min"
    MAX = "max"


@dataclass(frozen=True)
class Finding:
    """The minimum or the maximum of one quantity, enclosed between `value` and `bound`.

    A finding with a `gate`, a `waypoint` or an `end` is about that instant only; its `value` and `bound` are
    equal.
    """

    quantity: str  # "thrust" or "command" of a rotor, "collective thrust", "tilt", "velocity x", ...
    unit: str
    side: Side
    value: float  # the value reached at `time`
    bound: float  # proven: the quantity is nowhere beyond it
    time: float  # [s]
    limit: float | None
    verdict: Verdict
    gate: str | None = None  # the gate passed at that time
    waypoint: str | None = None  # the waypoint met at that time
    rotor: int | None = None  # the rotor whose thrust or command this is
    field: str = ""  # the field of the vehicle or problem that sets the limit: "max_thrust", "limits.jerk"
    size: float | None = None  # size of the range between the limits; reserves are fractions of it
    room: float = inf  # room next to the limit, as a fraction of that range; reserves keep a part of it
    end: Literal["start", "goal"] | None = None  # the end of the path at that time
    obstacle: str | None = None  # the obstacle nearest to the body at that time

    @property
    def name(self) -> str:
        """The quantity in words, with its rotor or its obstacle."""
        name = quantity_name(self.quantity, self.rotor)
        return name if self.obstacle is None else f"{name} from '{self.obstacle}'"

    @property
    def place(self) -> str | None:
        """The gate, waypoint or end of this finding, in words; None for findings about the whole path."""
        if self.gate is not None:
            return f"gate '{self.gate}'"
        return self.end if self.waypoint is None else f"'{self.waypoint}'"

    @property
    def reason(self) -> Reason:
        """The finding in one sentence, with the field of its limit, or its place."""
        return Reason(str(self), (self.field or self.place or "",))

    @property
    def margin(self) -> float | None:
        """The proven distance to the limit; negative where the limit is violated."""
        if self.limit is None:
            return None
        extreme = self.value if self.verdict is Verdict.VIOLATED else self.bound
        margin = self.limit - extreme if self.side is Side.MAX else extreme - self.limit
        return max(margin, 0.0) if self.verdict is Verdict.HOLDS else margin

    def __str__(self) -> str:
        """Return the finding as one sentence without its full stop."""
        change = "rises" if self.side is Side.MAX else "falls"
        reached = f"{self.name} {change} to {self.shown(self.value)} at {self.time:.3f} s"
        if self.place is not None:
            reached = f"{self.place} {self.quantity} {self._of_limit} at {self.time:.3f} s"
        margin = self.margin
        if self.limit is None or margin is None:
            return reached
        if self.verdict is Verdict.VIOLATED:
            where = "above" if self.side is Side.MAX else "below"
            return f"{reached}, {self.shown(-margin, 2)} {where} its limit"
        if self.place is not None:
            return reached
        if self.verdict is Verdict.UNDECIDED and margin < 0:
            return f"{reached}, nearer to its limit than can be told"
        return f"{reached}, {self.shown(margin, 2)} within its limit"

    def shown(self, value: float, digits: int = 4) -> str:
        """Return a value of this quantity with its unit, angles in degrees, below a million in full."""
        number = round(degrees(value) if self.unit == "rad" else value, 9) + 0.0  # rounds tiny values to zero
        unit = "°" if self.unit == "rad" else f" {self.unit}"
        whole = len(f"{abs(number):.0f}")
        return f"{number:.{max(digits, whole) if whole <= WHOLE_DIGITS else digits}g}{unit}"

    @property
    def _of_limit(self) -> str:
        """The value beside its limit."""
        if self.limit is None:
            return self.shown(self.value)
        word = "of" if self.side is Side.MAX else "of at least"
        return f"{self.shown(self.value, 2)} {word} {self.shown(self.limit, 2)}"


@dataclass(frozen=True)
class Discontinuity:
    """A jump between two segments that needs infinite forces or moments, or rotors without lag."""

    quantity: str  # "position", "velocity", "thrust direction", "body rate" or "rotor thrusts"
    unit: str
    norm: float  # the largest jump of any rotor where the quantity is "rotor thrusts"
    time: float  # [s]

    def __str__(self) -> str:
        """Return the jump as one sentence without its full stop."""
        means = "force" if self.quantity in ("position", "velocity") else "moment"
        jump = f"{self.norm:.2g} {self.unit}"
        if self.quantity == "rotor thrusts":
            return (
                f"{self.quantity} jump by up to {jump} at {self.time:.3f} s, which rotors with lag cannot "
                "follow; plan with continuous snap (--order 5)"
            )
        return f"{self.quantity} jumps by {jump} at {self.time:.3f} s, which no {means} can do"


@validated
@in_notebooks
@by_value
class Certificate:
    """Findings along a whole trajectory, at every instant.

    A rotor with lag τ has findings about its command f + τ f' in addition to its thrust f.
    """

    findings: tuple[Finding, ...]
    undetermined: tuple[TimeInterval, ...]  # where thrust vanishes, so that the attitude is undetermined
    discontinuities: tuple[Discontinuity, ...]
    # [s] time from which on unequal drag along x and y leaves the attitude undetermined
    too_unequal: float | None = None

    @property
    def certified(self) -> bool:
        """True if all limits are proven to hold, the attitude is determined throughout and nothing jumps."""
        holds = all(finding.verdict is Verdict.HOLDS for finding in self.findings)
        return holds and not self.undetermined and not self.discontinuities

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about the body's clearance from the frame of each gate, in the order of passages."""
        return tuple(f for f in self.findings if f.gate is not None and f.quantity == "clearance")

    @property
    def worst(self) -> Finding | None:
        """The rotor thrust or command with the smallest margin; None if no attitude is determined anywhere.

        Violated findings come first, if there are any.
        """
        rotors = [finding for finding in self.findings if finding.rotor is not None]
        violated = [finding for finding in rotors if finding.verdict is Verdict.VIOLATED]
        return min(violated or rotors, key=proven_margin, default=None)

    @property
    def binding(self) -> Finding | None:
        """The finding whose limit is active (almost reached), about the whole path and not a rotor, or None.

        Of several active limits, the one with the smallest margin as a fraction of its size is returned.
        """
        sized = ((f, f.margin / f.size) for f in self.findings if f.margin is not None and f.size)
        near = [(f, left) for f, left in sized if f.rotor is None and f.place is None and left < BINDING]
        return min(near, key=lambda pair: pair[1], default=(None, 0.0))[0]

    @property
    def margin(self) -> float | None:
        """The smallest proven margin [N] of the rotors' thrusts and commands; negative where violated.

        Only times with a determined attitude count; None if there are none.
        """
        return self.worst.margin if self.worst else None

    @property
    def why(self) -> str:
        """The finding that decides, in one sentence without its full stop."""
        violated = [f for f in self.findings if f.verdict is Verdict.VIOLATED]
        if self.discontinuities:
            return str(self.discontinuities[0])
        if violated:
            return (self.worst if self.worst in violated else violated[0]).reason
        if self.too_unequal is not None:
            return (
                f"cannot decide: at {self.too_unequal:.3f} s thrust is too small beside what unequal "
                "drag along body x and y adds; keep more thrust there, or set drag_body[1] to drag_body[0]"
            )
        if self.undetermined:
            at = f"{self.undetermined[0].start:.3f} s"
            return f"cannot decide: thrust reaches zero at {at}, where no attitude is determined"
        for finding in self.findings:
            if finding.verdict is Verdict.UNDECIDED:
                return Reason(f"cannot decide: {finding}", finding.reason.limits)
        return f"certified: {self.worst}"

    def __str__(self) -> str:
        """The outcome in one sentence."""
        return self.why


def proven_margin(finding: Finding) -> float:
    """Return the margin of a finding, infinite where it has no limit."""
    return inf if finding.margin is None else finding.margin
