"""A limit: a quantity along a path, the interval that it must stay in, and the fields that say so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

from aerobat.environment import Environment
from aerobat.errors import Reason, SpecError
from aerobat.flatness.references import force_balance
from aerobat.limits.quantity import PathQuantity
from aerobat.problem import Condition, Limits
from aerobat.problem.condition import ForceBalance
from aerobat.vehicle import Vehicle

HALF = 0.15  # the reserve that keeps half of a small room
SMALLEST_SIZE = 1e-3  # in SI units: a bound next to zero has no size of its own


@dataclass(frozen=True, eq=False)
class Limit:
    """lower ≤ quantity ≤ upper, all along a path; infinite where one side is open.

    Where an optimizer cannot take it as it is, `search` says it once more: limits linear in a path's
    derivatives that together imply it, for programs that know nothing else. It has none by itself where it is
    not linear.
    """

    name: str  # of the quantity in certificates: "command", "velocity x"
    unit: str
    quantity: PathQuantity
    lower: float
    upper: float
    fields: tuple[str, str]  # that the lower and the upper end come from: "max_thrust", "limits.velocity"
    size: float  # of its range, of which reserves and excesses are fractions
    rotor: int | None = None  # whose it is
    rooms: tuple[float, float] = (0.0, 0.0)  # of that size, beside either end, of which `kept` keeps a part
    is_implied: bool = False  # whether others imply it along a whole path: an optimizer may leave it out
    is_proven: bool = True  # whether a certificate states it; else it guards what planners do between
    search: tuple[Limit, ...] = ()

    def __post_init__(self) -> None:
        """Check what a family of one's own may get wrong."""
        if not self.lower <= self.upper:
            ends = f"lower {self.lower:g} and upper {self.upper:g}"
            raise SpecError(f"limit '{self.name}' has {ends}; let them rise, and inf be where a side is open")
        if not 0.0 < self.size < inf:
            raise SpecError(f"limit '{self.name}' has size {self.size:g}; give its range, more than 0")
        if isinstance(self.fields, str) or len(self.fields) != 2:
            raise SpecError(f"limit '{self.name}': fields must be a pair, of the lower and of the upper end")

    @cached_property
    def linear(self) -> tuple[Limit, ...]:
        """The limits that stand for this one in programs that are linear in a path's derivatives."""
        return (self,) if self.quantity.is_of_path else self.search

    @property
    def ends(self) -> tuple[float, float]:
        """The limit's ends less the quantity's constant, as fractions of the limit's size."""
        constant = self.quantity.constant
        return (self.lower - constant) / self.size, (self.upper - constant) / self.size

    def kept(self, reserve: float) -> tuple[float, float]:
        """Return what a reserve for the controller keeps from either end, as fractions of its size."""
        lower, upper = self.rooms
        return kept(reserve, lower), kept(reserve, upper)

    def exceeded(self, excess: float, time: float, fields: Sequence[str] = ()) -> Reason:
        """Return a sentence without its full stop about an excess.

        Args:
            excess: A fraction of its size.
            time: [s].
            fields: Of the end that is exceeded; by default those of both.
        """
        name = quantity_name(self.name, self.rotor)
        sentence = f"the {name} is beyond its limit by {100.0 * excess:.3g} % of its range at {time:.2f} s"
        return Reason(sentence, fields or self.fields)


@dataclass(frozen=True, eq=False)
class Asked:
    """All that asks for limits: a vehicle, an environment, and what a problem asks of the whole path."""

    vehicle: Vehicle | None  # None: no vehicle in particular
    environment: Environment
    limits: Limits
    conditions: tuple[Condition, ...]

    @cached_property
    def balance(self) -> ForceBalance:
        """The balance of thrust, acceleration and drag."""
        return force_balance(self.environment, self.vehicle)


def kept(reserve: float, room: float) -> float:
    """Return what a reserve keeps from an end with some room: itself, but of a small room a part.

    Half of the room is kept by HALF, and never all of it. Both are fractions of a limit's size.
    """
    return min(reserve, room * (reserve / (reserve + HALF))) if reserve > 0.0 else 0.0


def quantity_name(quantity: str, rotor: int | None) -> str:
    """Return a quantity in words, with its rotor if it is one's."""
    return quantity if rotor is None else f"{quantity} of rotor {rotor}"


def size_of(lower: float, upper: float) -> float:
    """Return the size of an interval: its length, or where one side is open what the other end says."""
    if -inf < lower < upper < inf:
        return upper - lower
    largest = max((abs(end) for end in (lower, upper) if abs(end) < inf), default=0.0)
    return largest if largest > SMALLEST_SIZE else 1.0
