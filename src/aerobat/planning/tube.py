"""The tube of a plan that was tightened: how far its flights stray, how many pass, and what that costs."""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.errors import SpecError
from aerobat.simulation.outcome import length


@dataclass(frozen=True, kw_only=True)
class Tube:
    """The spread of a plan's flights along time, and the proof that they pass.

    At each of `times` a fraction `level` of the sampled flights keeps within the errors, and to the margin or
    more: the least part of a rotor's range between its command and either limit, negative where clipped
    thrust would be needed beyond it.
    """

    conditions: str  # their name
    seed: int
    level: float  # [-] of the quantiles
    times: tuple[float, ...]  # [s], (T,)
    position_error: tuple[float, ...]  # [m], (T,)
    attitude_error: tuple[float, ...]  # [rad], (T,)
    rotor_margin: tuple[float, ...]  # [-] of a rotor's range, (T,)
    reserve: float  # [-] of every limit's range, that the plan keeps
    plain_duration: float  # [s] of the plan without tightening
    probability: float  # [-] with which a flight was asked to pass
    passed: int  # of `flights`
    flights: int  # fresh ones: none of them told how to tighten
    lower_bound: float  # [-] of the probability of passing, at 95 % confidence

    def __post_init__(self) -> None:
        """Check that there is one of each for every time."""
        series = self.position_error, self.attitude_error, self.rotor_margin
        if not self.times or any(len(values) != len(self.times) for values in series):
            raise SpecError(
                "a tube needs an error in position and attitude and a margin for each of its times"
            )

    @property
    def max_position_error(self) -> float:
        """The tube's widest [m]."""
        return max(self.position_error)

    @property
    def max_attitude_error(self) -> float:
        """The tube's widest [rad]."""
        return max(self.attitude_error)

    @property
    def min_rotor_margin(self) -> float:
        """The least margin that the tube leaves, as a fraction of a rotor's range [-]."""
        return min(self.rotor_margin)

    def price(self, duration: float) -> float:
        """By how much longer a plan of that duration [s] is than the plain one [s]."""
        return duration - self.plain_duration

    def __str__(self) -> str:
        """The proof in a sentence without its full stop."""
        return (
            f"{self.passed} of {self.flights} fresh flights under {self.conditions} pass, with a probability "
            f"of {100 * self.lower_bound:.2f} % at least; {100 * self.level:g} % keep within "
            f"{length(self.max_position_error)}"
        )
