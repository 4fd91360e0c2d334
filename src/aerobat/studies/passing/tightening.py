"""Requirements beyond the first plan's, by which more flights succeed: body rates, reserve, thrust in gates.

Rotors with an unknown lag are late by an angle proportional to the body rate. Paths with much lower body
rates often take hardly longer. A push that no model contains, such as unknown drag, tilts the vehicle by the
ratio of push to thrust, so that more thrust in a gate keeps the attitude there. A larger reserve of every
rotor leaves more to the controller.
"""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.problem import Problem


@dataclass(frozen=True)
class Tightening:
    """Requirements on a further plan."""

    rate: float = 1.0  # limit of the body rate, as a fraction of the first plan's largest; 1 adds none
    reserve: float = 0.0  # beyond the first plan's
    thrust: bool = False  # whether more thrust is required in stages

    def then(self, step: Tightening) -> Tightening:
        """Return both requirements: the lower body rate, the sum of reserves, and thrust if either has it."""
        reserve = round(self.reserve + step.reserve, 9)
        return Tightening(min(self.rate, step.rate), reserve, self.thrust or step.thrust)

    def contains(self, other: Tightening) -> bool:
        """Return True where all requirements of the other are required here too."""
        return self.rate <= other.rate and self.reserve >= other.reserve and self.thrust >= other.thrust

    def described(self, reserve: float) -> str:
        """Return the differences from the first plan in words, whose reserve is given."""
        stronger = ", with more thrust in gates" if self.thrust else ""
        slower = "" if self.rate == 1.0 else f", turning at most {100 * self.rate:g} % as fast"
        kept = f", with a reserve of {reserve + self.reserve:g}" if self.reserve else ""
        return stronger + slower + kept


# Steps in the order of trial. Lower body rates cost flips through gates hardly any time, and more thrust
# keeps their attitude; of figures without gates more reserve costs the least time (benchmarks/steadying.py).
AT_GATES: tuple[Tightening, ...] = (
    Tightening(),
    *(Tightening(rate) for rate in (0.5, 0.65, 0.8)),
    *(Tightening(rate, thrust=True) for rate in (0.65, 0.5)),
)
MORE_RESERVE: tuple[Tightening, ...] = (Tightening(reserve=0.05), Tightening(reserve=0.1))
SLOWER: tuple[Tightening, ...] = (Tightening(0.8), Tightening(0.8, 0.1))  # where more reserve alone ends
GROWTHS = 6  # rounds of more reserve: with 0.05 each beyond the default, a tenth of the range is left to fly


def rounds(problem: Problem, may_grow: bool) -> list[tuple[Tightening, ...]]:
    """Return the rounds of steps that suit a problem; those of larger reserves only where these may be tried.

    Without gates only larger reserves are tried, if they may be.
    """
    growing = [*[MORE_RESERVE] * GROWTHS, SLOWER] if may_grow else []
    return [AT_GATES, *growing] if problem.gates or not growing else growing
