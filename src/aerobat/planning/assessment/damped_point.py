"""The least time in which a point moves along a line, its thrust bounded and its velocity damped.

ẍ = c − k ẋ with c between two bounds is linear with real eigenvalues, so that the fastest motion thrusts
forward all the way up to its largest speed and backward from there, with a cruise between where the speed is
limited.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, log1p, sqrt

UNDAMPED = 1e-7  # [1/s] a smaller damping is lost in rounding
HALVINGS = 45  # of the largest speed's interval


@dataclass(frozen=True)
class DampedPoint:
    """A point on a line."""

    forward: float  # [m/s²] the largest thrust per mass, positive
    backward: float  # [m/s²] the same against the direction, positive
    damping: float = 0.0  # [1/s] k
    max_speed: float = inf  # [m/s] forward

    def least_time(self, distance: float, start: float = 0.0, end: float = 0.0) -> float:
        """The least time [s] that a motion forward takes; 0 where it could not be made at all.

        Where one speed cannot become the other within the distance without turning back, the time of that
        change alone.

        Args:
            distance: How far [m], not negative.
            start: Velocity at the start [m/s].
            end: Velocity at the end [m/s].
        """
        slowest = max(start, end)
        fastest = self._fastest()
        if min(self.forward, self.backward) <= 0.0 or not slowest < fastest:
            return 0.0
        covered, time = self._by_way_of(slowest, start, end)
        if covered >= distance:
            return time
        if fastest < inf and self.max_speed <= fastest:
            covered, time = self._by_way_of(self.max_speed, start, end)
            if covered <= distance:
                return time + (distance - covered) / self.max_speed
        return self._by_way_of(self._peak(distance, start, end, slowest), start, end)[1]

    def _fastest(self) -> float:
        """The speed [m/s] that is never exceeded."""
        return min(self.max_speed, inf if self.damping < UNDAMPED else self.forward / self.damping)

    def _peak(self, distance: float, start: float, end: float, slowest: float) -> float:
        """A largest speed [m/s] with which so much or a little less is covered."""
        undamped = sqrt(
            (2.0 * distance + start**2 / self.forward + end**2 / self.backward)
            / (1.0 / self.forward + 1.0 / self.backward)
        )
        if self.damping < UNDAMPED:
            return undamped
        low, high = slowest, self._fastest()
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            if self._by_way_of(middle, start, end)[0] < distance:
                low = middle
            else:
                high = middle
        return low

    def _by_way_of(self, peak: float, start: float, end: float) -> tuple[float, float]:
        """The distance [m] and the time [s] of speeding up to a speed and slowing down from it."""
        covered = time = 0.0
        for thrust, initial, final in ((self.forward, start, peak), (-self.backward, peak, end)):
            change = final - initial
            if self.damping < UNDAMPED:
                part = change / thrust
                covered += 0.5 * (initial + final) * part
            else:
                part = -log1p(-self.damping * change / (thrust - self.damping * initial)) / self.damping
                covered += (thrust * part - change) / self.damping
            time += part
        return covered, time
