"""Shares of flights, with what so many flights leave open of them."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from typing import ClassVar

from aerobat.arrays import Mask
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.simulation import Outcome

CONFIDENCE = 0.95  # of the intervals
MAX_DIGITS = 6  # of a percentage, behind the point


@dataclass(frozen=True)
class Share:
    """A number of flights of all, and the interval in which their probability lies at 95 % confidence."""

    count: int
    of: int

    def __post_init__(self) -> None:
        """Check. Raises SpecError for a share of no flights, or of more than there are."""
        if not 0 <= self.count <= self.of > 0:
            raise SpecError(
                f"count must be from 0 to all flights, one or more, got {self.count} of {self.of}"
            )

    @classmethod
    def where(cls, holds: Mask) -> Share:
        """The share of flights of which something holds, (flights,)."""
        return cls(int(holds.sum()), len(holds))

    @property
    def fraction(self) -> float:
        """The part of all flights [-]."""
        return self.count / self.of

    @property
    def interval(self) -> tuple[float, float]:
        """Clopper and Pearson's interval [-], which holds the probability at least as often as it says.

        Its ends are quantiles of beta distributions; `scipy.stats.binomtest` gives the same, and takes a
        second and 45 MB to import.
        """
        from scipy.special import betaincinv

        outside = 0.5 * (1.0 - CONFIDENCE)
        others = self.of - self.count
        low = betaincinv(self.count, others + 1, outside) if self.count else 0.0
        high = betaincinv(self.count + 1, others, 1.0 - outside) if others else 1.0
        return float(low), float(high)

    @property
    def range(self) -> str:
        """The interval in percent, rounded outward, so that its text excludes nothing that it holds."""
        low, high = self.interval
        return f"{percent(low, ROUND_FLOOR)} to {percent(high, ROUND_CEILING)} %"

    def __str__(self) -> str:
        """The share in percent, with its interval."""
        return f"{percent(self.fraction)} % ({self.range})"


def percent(fraction: float, rounding: str = ROUND_HALF_EVEN) -> str:
    """A fraction in percent, with the digits that tell it from none and from all.

    Args:
        fraction: From 0 to 1 [-].
        rounding: One of the modes of `decimal`.
    """
    value = Decimal(100.0 * fraction)
    for digits in range(1, MAX_DIGITS + 1):
        last = Decimal(1).scaleb(-digits)
        if {value.quantize(last, mode) for mode in (ROUND_HALF_EVEN, rounding)}.isdisjoint((0, 100)):
            return f"{value.quantize(last, rounding)}"
    return f"{value:.0f}"


@dataclass(frozen=True)
class Trials:
    """A number of flights under conditions, and how many of them succeed."""

    NEEDED: ClassVar[float] = 0.95  # of all flights

    conditions: Dispersion
    seed: int
    share: Share
    failures: tuple[Outcome, ...] = ()  # of those that do not, where they are known

    @property
    def proven(self) -> bool:
        """True if so many succeed that at least NEEDED of all do, at the share's confidence."""
        return self.share.interval[0] >= self.NEEDED

    @property
    def refuted(self) -> bool:
        """True if so few succeed that less than NEEDED of all do, at the share's confidence."""
        return self.share.interval[1] < self.NEEDED
