"""A limit: a quantity along a path, its lower and upper bound, and the fields that set them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf

from aerobat.environment import Environment
from aerobat.errors import Reason, SpecError
from aerobat.flatness.inverse_dynamics import force_balance
from aerobat.limits.quantity import PathQuantity, quantity_name
from aerobat.problem import Condition, Limits
from aerobat.problem.condition import ForceBalance
from aerobat.vehicle import Vehicle

HALVING_RESERVE = 0.15  # reserve for which `effective_reserve` keeps half of a small room
MIN_SIZE = 1e-3  # in SI units: a smaller bound gets size 1


@dataclass(frozen=True, eq=False)
class Limit:
    """The condition lower ≤ quantity ≤ upper along a whole path; infinite where one side is open.

    `search` holds limits that are linear in the path's derivatives and together imply this one, for programs
    that accept only linear limits. It is empty by default, also where the quantity is not linear.
    """

    name: str  # name of the quantity in certificates: "command", "velocity x"
    unit: str
    quantity: PathQuantity
    lower: float
    upper: float
    fields: tuple[str, str]  # that set the lower and the upper bound: "max_thrust", "limits.velocity"
    size: float  # size of its range; reserves and violations are fractions of it
    rotor: int | None = None  # index of the rotor that the limit is about
    # room next to either end, as a fraction of the size; a small room reduces the reserve
    rooms: tuple[float, float] = (0.0, 0.0)
    # whether other limits imply it along a whole path, so that an optimizer may omit it
    is_implied: bool = False
    is_proven: bool = True  # whether a certificate states it; else it only guides planners
    search: tuple[Limit, ...] = ()

    def __post_init__(self) -> None:
        """Check the values that a user's family may get wrong."""
        if not self.lower <= self.upper:
            ends = f"lower {self.lower:g} and upper {self.upper:g}"
            raise SpecError(f"limit '{self.name}' has {ends}; let them rise, and inf be where a side is open")
        if not 0.0 < self.size < inf:
            raise SpecError(f"limit '{self.name}' has size {self.size:g}; give its range, more than 0")
        if isinstance(self.fields, str) or len(self.fields) != 2:
            raise SpecError(f"limit '{self.name}': fields must be a pair, of the lower and of the upper end")

    @cached_property
    def linear(self) -> tuple[Limit, ...]:
        """The limits that replace this one in programs that are linear in a path's derivatives."""
        return (self,) if self.quantity.is_of_path else self.search

    @property
    def ends(self) -> tuple[float, float]:
        """The bounds minus the quantity's constant, as fractions of the limit's size."""
        constant = self.quantity.constant
        return (self.lower - constant) / self.size, (self.upper - constant) / self.size

    def reserves(self, reserve: float) -> tuple[float, float]:
        """Return the reserve kept for the controller at either end, as fractions of the limit's size."""
        lower, upper = self.rooms
        return effective_reserve(reserve, lower), effective_reserve(reserve, upper)

    def exceeded(self, excess: float, time: float, fields: Sequence[str] = ()) -> Reason:
        """Return a sentence without its full stop about a violation.

        Args:
            excess: The violation, as a fraction of the limit's size.
            time: The time of the violation [s].
            fields: Fields of the violated end; by default those of both ends.
        """
        name = quantity_name(self.name, self.rotor)
        sentence = f"the {name} is beyond its limit by {100.0 * excess:.3g} % of its range at {time:.2f} s"
        return Reason(sentence, fields or self.fields)


@dataclass(frozen=True, eq=False)
class Asked:
    """All sources of limits: a vehicle, an environment, and a problem's bounds for the whole path."""

    vehicle: Vehicle | None  # None: for any vehicle
    environment: Environment
    limits: Limits
    conditions: tuple[Condition, ...]

    @cached_property
    def balance(self) -> ForceBalance:
        """The balance of thrust, acceleration and drag."""
        return force_balance(self.environment, self.vehicle)


def effective_reserve(reserve: float, room: float) -> float:
    """Return the reserve that is kept at an end with some room: the reserve, or a part of a small room.

    A reserve of HALVING_RESERVE keeps half of the room, and no reserve keeps all of it. Both are fractions of
    a limit's size.
    """
    return min(reserve, room * (reserve / (reserve + HALVING_RESERVE))) if reserve > 0.0 else 0.0


def size_of(lower: float, upper: float) -> float:
    """Return the size of an interval: its length, or the magnitude of its end where one side is open."""
    if -inf < lower < upper < inf:
        return upper - lower
    largest = max((abs(end) for end in (lower, upper) if abs(end) < inf), default=0.0)
    return largest if largest > MIN_SIZE else 1.0
