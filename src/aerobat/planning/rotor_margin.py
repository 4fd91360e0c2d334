"""The rotors' margin and reserve, from a certificate, or from samples, which can refute but not prove."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.certification.certificate import Certificate, Finding, Side, proven_margin
from aerobat.environment import Environment
from aerobat.errors import Reason
from aerobat.flatness import reference
from aerobat.limits.limit import effective_reserve
from aerobat.simulation.outcome import digits
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

SAMPLES_PER_DEGREE = 2  # samples of a segment per degree of its polynomial, enough to show a cubic's extrema


@dataclass(frozen=True)
class RotorMargin:
    """The distance of the rotors from their limits along a trajectory, by flatness.

    `min_thrust` is the least thrust of the rotor that comes closest to its lower limit. `max_thrust` is the
    largest thrust of the rotor that comes closest to its upper limit. With equal rotors they are the extrema
    of all rotors. From a certificate, the commands of rotors with lag count as well.
    """

    min_thrust: float  # [N]
    min_time: float  # [s] of the least thrust
    min_rotor: int
    max_thrust: float  # [N]
    max_time: float  # [s] of the largest thrust
    max_rotor: int
    low_margin: float  # [N] from the lower limit, negative: below it
    high_margin: float  # [N] from the upper limit, negative: above it

    @classmethod
    def of(cls, certificate: Certificate) -> RotorMargin | None:
        """Return the margin that a certificate proves; None if no attitude is ever determined."""
        if certificate.worst is None:
            return None
        sides = (rotor_findings(certificate, side) for side in (Side.MIN, Side.MAX))
        low, high = (min(found, key=proven_margin) for found in sides)
        assert low.rotor is not None
        assert high.rotor is not None
        return cls(
            min_thrust=low.value,
            min_time=low.time,
            min_rotor=low.rotor,
            max_thrust=high.value,
            max_time=high.time,
            max_rotor=high.rotor,
            low_margin=proven_margin(low),
            high_margin=proven_margin(high),
        )

    @property
    def margin(self) -> float:
        """The distance to the nearest limit [N]; negative beyond the limit."""
        return min(self.low_margin, self.high_margin)

    @property
    def reason(self) -> Reason:
        """The margin in words, with the field of the nearest limit."""
        return Reason(str(self), ("min_thrust" if self.low_margin < self.high_margin else "max_thrust",))

    def __str__(self) -> str:
        """The margin in words."""
        words = f"{digits(self.min_thrust)} to {digits(self.max_thrust)} N, "
        off = f"{digits(abs(self.margin))} N"
        if self.margin >= 0:
            return words + f"within limits by {off}"
        if self.low_margin < self.high_margin:
            return words + f"{off} too little for rotor {self.min_rotor} at {self.min_time:.3f} s"
        return words + f"{off} too much for rotor {self.max_rotor} at {self.max_time:.3f} s"


def sampled_margin(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> RotorMargin:
    """Return the margin of thrusts at samples, an upper bound of the true margin.

    A negative margin at samples refutes a path without a certificate, in a seventh of the time. Most attempts
    of a search on durations are refuted like that. The commands of rotors with lag are not sampled; they
    could only reduce the margin.
    """
    s = np.linspace(0.0, 1.0, SAMPLES_PER_DEGREE * max(trajectory.degree, 1), endpoint=False)
    times = (trajectory.knots[:-1, None] + s * trajectory.durations[:, None]).ravel()
    thrusts = reference(trajectory, vehicle, times, environment=environment).rotor_thrusts
    low, high = thrusts - vehicle.min_thrusts, vehicle.max_thrusts - thrusts
    at_low, at_high = (np.unravel_index(gap.argmin(), gap.shape) for gap in (low, high))
    return RotorMargin(
        min_thrust=float(thrusts[at_low]),
        min_time=float(times[at_low[0]]),
        min_rotor=int(at_low[1]),
        max_thrust=float(thrusts[at_high]),
        max_time=float(times[at_high[0]]),
        max_rotor=int(at_high[1]),
        low_margin=float(low[at_low]),
        high_margin=float(high[at_high]),
    )


@dataclass(frozen=True)
class ReserveShortfall:
    """A rotor's thrust or command that is not proven to keep the required reserve from its limit."""

    finding: Finding
    reserve: float  # required fraction of the rotor's range
    kept: float  # proven fraction of the rotor's range

    @property
    def size(self) -> float:
        """The reserve that is missing, as a fraction of the rotor's range."""
        return self.reserve - self.kept

    def __str__(self) -> str:
        """The shortfall in one sentence without its full stop."""
        return (
            f"the {self.finding.name} keeps {100.0 * self.kept:.3g} % of its range at "
            f"{self.finding.time:.3f} s, {100.0 * self.reserve:.3g} % are asked in reserve"
        )

    @property
    def reason(self) -> Reason:
        """The sentence, with the field of the limit."""
        return Reason(str(self), (self.finding.field, "reserve"))


def reserve_shortfalls(certificate: Certificate, reserve: float) -> list[ReserveShortfall]:
    """Return the findings where rotors are not proven to keep a reserve, those that keep least first.

    The reserve is a fraction of a rotor's range. At the lower end it is reduced to a part of the distance
    from the limit to hover thrust, where that is small. The list is empty for zero reserve.
    """
    if reserve <= 0.0:
        return []
    found = [
        ReserveShortfall(
            finding, effective_reserve(reserve, finding.room), proven_margin(finding) / _size(finding)
        )
        for finding in rotor_findings(certificate)
    ]
    return sorted((each for each in found if each.size > 0.0), key=lambda shortfall: shortfall.kept)


def rotor_findings(certificate: Certificate, side: Side | None = None) -> list[Finding]:
    """Return the findings about rotors' thrusts and the commands of rotors with lag, of one side or both."""
    return [f for f in certificate.findings if f.rotor is not None and side in (None, f.side)]


def _size(finding: Finding) -> float:
    assert finding.size is not None, "a finding about a rotor's limit has its size"
    return finding.size
