"""The minimum time in which a point with bounded thrust and linear drag moves along a line.

The equation ẍ = c − k ẋ with c between two bounds is linear with real eigenvalues. Therefore the optimal
control is bang-bang: full thrust forward up to the largest speed, then full thrust backward. Where the speed
is limited, the motion cruises in between.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import expm1, inf, log1p, sqrt

UNDAMPED = 1e-7  # damping [1/s] below which it is ignored, as it is lost in rounding
HALVINGS = 40  # bisections of the time of acceleration


@dataclass(frozen=True)
class DampedPoint:
    """A point that moves forward on a line."""

    forward: float  # [m/s²] the largest forward acceleration by thrust, positive
    backward: float  # [m/s²] the largest backward acceleration by thrust, positive
    damping: float = 0.0  # [1/s] k, drag over mass
    max_speed: float = inf  # [m/s] forward

    def least_time(self, distance: float, start: float = 0.0, end: float = 0.0) -> float:
        """Return the least time [s] of a motion forward; 0 where no such motion exists.

        Where the change of speed alone needs more than the distance, the time of that change is returned.

        Args:
            distance: The distance to cover [m], not negative.
            start: Velocity at the start [m/s].
            end: Velocity at the end [m/s].
        """
        slowest, terminal = max(start, end), self._terminal_speed
        if min(self.forward, self.backward) <= 0.0 or slowest >= min(self.max_speed, terminal):
            return 0.0
        if self.backward + self.damping * end <= 0.0:  # the point cannot slow down to this end velocity
            return 0.0
        shortest = self._speeding_time(start, slowest)
        covered, time = self._by_way_of(shortest, start, end)
        if covered >= distance:
            return time
        if self.max_speed < terminal:
            covered, time = self._by_way_of(self._speeding_time(start, self.max_speed), start, end)
            if covered <= distance:
                return time + (distance - covered) / self.max_speed
        return self._by_way_of(self._longest_speeding(distance, start, end, shortest), start, end)[1]

    @property
    def _terminal_speed(self) -> float:
        """The speed [m/s] at which drag balances the forward thrust."""
        return inf if self.damping < UNDAMPED else self.forward / self.damping

    def _speeding_time(self, start: float, speed: float) -> float:
        """Return the time [s] of full acceleration to a speed."""
        if self.damping < UNDAMPED:
            return (speed - start) / self.forward
        return -log1p(-self.damping * (speed - start) / (self.forward - self.damping * start)) / self.damping

    def _longest_speeding(self, distance: float, start: float, end: float, shortest: float) -> float:
        """Return the time [s] of acceleration with which the distance is covered, or slightly less."""
        if self.damping < UNDAMPED:
            squared = 2.0 * distance + start**2 / self.forward + end**2 / self.backward
            return self._speeding_time(start, sqrt(squared / (1.0 / self.forward + 1.0 / self.backward)))
        missing = distance - self._by_way_of(shortest, start, end)[0]
        low, step = shortest, sqrt(2.0 * missing / self.forward)
        while self._by_way_of(low + step, start, end)[0] < distance:
            low, step = low + step, 2.0 * step
        for _ in range(HALVINGS):
            step *= 0.5
            if self._by_way_of(low + step, start, end)[0] < distance:
                low += step
        return low

    def _by_way_of(self, speeding: float, start: float, end: float) -> tuple[float, float]:
        """Return the distance [m] and time [s] of accelerating for `speeding` [s], then braking to `end`."""
        if self.damping < UNDAMPED:
            peak = start + self.forward * speeding
            slowing = (peak - end) / self.backward
            return 0.5 * (start + peak) * speeding + 0.5 * (peak + end) * slowing, speeding + slowing
        k, terminal = self.damping, self._terminal_speed
        peak = start - (terminal - start) * expm1(-k * speeding)
        slowing = log1p(k * (peak - end) / (self.backward + k * end)) / k
        up = terminal * speeding - (peak - start) / k
        down = ((peak - end) - self.backward * slowing) / k
        return up + down, speeding + slowing
