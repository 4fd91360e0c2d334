"""The tube of a tightened plan: the spread of its flights, how many of them pass, and the added duration."""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.errors import SpecError
from aerobat.simulation.outcome import length


@dataclass(frozen=True, kw_only=True)
class Tube:
    """The spread of a plan's flights along time, and the proof that they pass.

    The errors and the margin are quantiles. At each of `times` a fraction `level` of the sampled flights has
    errors no larger, and a margin no smaller. The margin is the least distance of a rotor's command from
    either limit, as a fraction of the rotor's range. It is negative where a command is saturated.
    """

    conditions: str  # name of the flights' conditions
    seed: int
    level: float  # [-] of the quantiles
    times: tuple[float, ...]  # [s], (T,)
    position_error: tuple[float, ...]  # [m], (T,)
    attitude_error: tuple[float, ...]  # [rad], (T,)
    rotor_margin: tuple[float, ...]  # [-] of a rotor's range, (T,)
    reserve: float  # [-] fraction of every limit's range that the plan keeps
    plain_duration: float  # [s] of the plan without tightening
    probability: float  # [-] required probability that a flight passes
    passed: int  # number of `flights` that passed
    flights: int  # number of test flights, none of which was used for the tightening
    lower_bound: float  # [-] of the probability of passing, at 95 % confidence

    def __post_init__(self) -> None:
        """Check that all series have one value for each time."""
        series = self.position_error, self.attitude_error, self.rotor_margin
        if not self.times or any(len(values) != len(self.times) for values in series):
            raise SpecError(
                "a tube needs an error in position and attitude and a margin for each of its times"
            )

    @property
    def max_position_error(self) -> float:
        """The largest position error of the tube [m]."""
        return max(self.position_error)

    @property
    def max_attitude_error(self) -> float:
        """The largest attitude error of the tube [rad]."""
        return max(self.attitude_error)

    @property
    def min_rotor_margin(self) -> float:
        """The least rotor margin of the tube, as a fraction of a rotor's range [-]."""
        return min(self.rotor_margin)

    def price(self, duration: float) -> float:
        """Return how much longer a plan of a duration [s] is than the plan without tightening [s]."""
        return duration - self.plain_duration

    def __str__(self) -> str:
        """The result in a sentence without its full stop."""
        return (
            f"{self.passed} of {self.flights} fresh flights under {self.conditions} pass, with a probability "
            f"of {100 * self.lower_bound:.2f} % at least; {100 * self.level:g} % keep within "
            f"{length(self.max_position_error)}"
        )
