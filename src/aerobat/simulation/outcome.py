"""Outcomes of flights, which can be counted, each with a sentence for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import NamedTuple

DIVERGENCE_RADIUS = 5.0  # [m] of position error: no controller is expected back from there
TOUCHDOWN = 1e-3  # [m] depth below the ground that counts as no hit: paths that land end on the ground
# The simulated ground does not support a vehicle that takes off or lands a few centimetres off its path.
# A slow vehicle that sinks by no more than the tolerance of places counts as standing on the ground.
LANDING_SPEED = 2.0  # [m/s] the speed of a fall from 20 cm, which a landing gear survives
LANDING_DEPTH = 0.1  # [m] the tolerance of places
ZERO_LENGTH = 1e-6  # [m] smaller lengths are rounding
FEW_DECIMALS = 0.095  # smaller values would show less than two digits in two decimals


class Contact(IntEnum):
    """The object that a vehicle touches; of several, the highest code: obstacle, then gate, then ground."""

    NOTHING = 0
    GROUND = 1
    GATE = 2
    OBSTACLE = 3


def length(metres: float) -> str:
    """Return a length with the unit that suits it."""
    return f"{digits(metres)} m" if metres >= 1.0 else f"{digits(100.0 * metres, ZERO_LENGTH * 100.0)} cm"


def digits(value: float, nothing: float = 0.0) -> str:
    """Return a number with two decimals, or with two digits where two decimals would show too few.

    Args:
        value: In the unit that is shown.
        nothing: Values up to this are rounding and shown as 0.00.
    """
    return f"{value:.2g}" if nothing < abs(value) < FEW_DECIMALS else f"{value:.2f}"


def counted(outcomes: Iterable[Outcome]) -> str:
    """Return counts of the outcomes of flights as text, the most frequent first."""
    counts = Counter(outcome.words for outcome in outcomes)
    return ", ".join(f"{count} {name}" for name, count in counts.most_common())


class Outcome(Enum):
    """The outcome of a flight; the value is a sentence template for its numbers.

    A gate is missed in five ways: beside its opening, backwards, short of its plane, stopped in it, or passed
    too early, so that the vehicle is beyond the plane throughout the time window.
    """

    COMPLETE = "flown to the end, {error} off its path at most"
    THROUGH_GATES = "through {gate} at {speed:.1f} m/s, {miss} off its centre, {error} off its path at most"
    MISSED_GATE = "missed {gate}, {miss:.2f} m off its centre at {time:.2f} s"
    BACKWARDS = "missed {gate}, crossed its plane backwards at {time:.2f} s"
    SHORT_OF_GATE = "missed {gate}, {short:.2f} m short of its plane about {time:.2f} s"
    STOPPED_IN_GATE = "stopped in {gate}, {beyond_cm:.1f} cm beyond its plane about {time:.2f} s"
    EARLY = (
        "missed {gate}, {early:.2f} m or more beyond its plane about {time:.2f} s, when it was to be crossed"
    )
    HIT_FRAME = "hit the frame of {gate}, {excess_cm:.1f} cm into its {edge} edge at {time:.2f} s"
    WRONG_ATTITUDE = (
        "passed {gate} {angle:.1f}° off the attitude asked at {time:.2f} s, {tolerance:.3g}° allowed"
    )
    TOUCHED_GATE = "touched the frame of a gate at {time:.2f} s, as its plant felt"
    TOUCHED_GROUND = "touched the ground at {time:.2f} s, as its plant felt"
    MISSED_ATTITUDE = (
        "stayed {angle:.1f}° off the attitude of {stage} about {time:.2f} s, {tolerance:.3g}° allowed"
    )
    OFF_PATH = "left its path by more than {allowed} at {time:.2f} s, by {error} at most"
    MISSED_WAYPOINT = "missed {waypoint}, {miss:.3f} m from it at {time:.2f} s, {radius:g} m allowed"
    HIT_OBSTACLE = "hit '{obstacle}' at {time:.2f} s"
    HIT_GROUND = "hit the ground at {time:.2f} s"
    DIVERGED = "diverged at {time:.2f} s: position error above {radius:g} m"
    STATE_NOT_FINITE = "diverged at {time:.2f} s: its state is no longer a number"

    @property
    def is_success(self) -> bool:
        """True where nothing went wrong."""
        return self in (Outcome.COMPLETE, Outcome.THROUGH_GATES)

    @property
    def words(self) -> str:
        """The outcome in two or three words."""
        return self.name.lower().replace("_", " ")

    def sentence(self, **numbers: object) -> str:
        """Return the sentence with its numbers."""
        return self.value.format(**{"radius": DIVERGENCE_RADIUS, **numbers})


class FlightFailure(NamedTuple):
    """A failure of one flight, and its time."""

    time: float  # [s]
    outcome: Outcome
    numbers: Mapping[str, object] = MappingProxyType({})  # of its sentence

    def sentence(self, **others: object) -> str:
        """Return the outcome's sentence with its numbers."""
        return self.outcome.sentence(**{"time": self.time, **self.numbers, **others})
