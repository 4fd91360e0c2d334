"""Shares of flights, with confidence intervals of their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal
from typing import ClassVar

from aerobat.arrays import Mask
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.simulation import Outcome

CONFIDENCE = 0.95  # of the intervals
MAX_DIGITS = 6  # largest number of decimals of a percentage


@dataclass(frozen=True)
class Share:
    """A number of flights out of all, and the 95 % confidence interval of their probability."""

    count: int
    of: int

    def __post_init__(self) -> None:
        """Check the counts. Raises SpecError for a share of no flights, or of more than there are."""
        if not 0 <= self.count <= self.of > 0:
            raise SpecError(
                f"count must be from 0 to all flights, one or more, got {self.count} of {self.of}"
            )

    @classmethod
    def where(cls, holds: Mask) -> Share:
        """Return the share of flights for which a condition holds, (flights,)."""
        return cls(int(holds.sum()), len(holds))

    @property
    def fraction(self) -> float:
        """The fraction of all flights [-]."""
        return self.count / self.of

    @property
    def interval(self) -> tuple[float, float]:
        """The Clopper–Pearson interval [-], which covers the probability with at least the stated confidence.

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
        """The interval in percent as text, rounded outward, so that the text includes the whole interval."""
        low, high = self.interval
        return f"{percent(low, ROUND_FLOOR)} to {percent(high, ROUND_CEILING)} %"

    def __str__(self) -> str:
        """Return the share in percent, with its interval."""
        return f"{percent(self.fraction)} % ({self.range})"


def percent(fraction: float, rounding: str = ROUND_HALF_EVEN) -> str:
    """Return a fraction in percent, with enough digits to differ from 0 and from 100 %.

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
    """The share of successes of flights under conditions."""

    NEEDED: ClassVar[float] = 0.95  # required fraction of all flights

    conditions: Dispersion
    seed: int
    share: Share
    failures: tuple[Outcome, ...] = ()  # outcomes of failed flights, where they are known

    @property
    def proven(self) -> bool:
        """True if the share proves, at its confidence, that at least NEEDED of all flights succeed."""
        return self.share.interval[0] >= self.NEEDED

    @property
    def refuted(self) -> bool:
        """True if the share proves, at its confidence, that less than NEEDED of all flights succeed."""
        return self.share.interval[1] < self.NEEDED
