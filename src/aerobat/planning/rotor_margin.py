"""The rotors' margin and reserve, read from a certificate; samples, which can refute but not prove."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.certification import Certificate, Finding, Side
from aerobat.certification.certificate import proven_margin
from aerobat.environment import Environment
from aerobat.errors import Reason
from aerobat.flatness import reference
from aerobat.limits.limit import kept
from aerobat.simulation.outcome import digits
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

SAMPLES_PER_DEGREE = 2  # of each segment, per degree of its polynomial: a cubic's extremes stand out


@dataclass(frozen=True)
class RotorMargin:
    """The distance of the rotors from their limits along a trajectory, by flatness.

    `min_thrust` is the least thrust of the rotor that comes closest to its lower limit, `max_thrust` the
    largest of the one that comes closest to its upper limit: with equal rotors, of all of them. Of a rotor
    with lag the thrust that is commanded counts as well, wherever a certificate says so.
    """

    min_thrust: float  # [N]
    min_time: float  # [s]
    min_rotor: int
    max_thrust: float  # [N]
    max_time: float  # [s]
    max_rotor: int
    low_margin: float  # [N] from the lower limit, negative: below it
    high_margin: float  # [N] from the upper limit, negative: above it

    @classmethod
    def of(cls, certificate: Certificate) -> RotorMargin | None:
        """A certificate's findings about rotors, in short; None if no attitude is ever determined."""
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
        """The distance to the nearest limit [N], negative: beyond it by so much."""
        return min(self.low_margin, self.high_margin)

    @property
    def reason(self) -> Reason:
        """The outcome in a few words, with the nearest limit."""
        return Reason(str(self), ("min_thrust" if self.low_margin < self.high_margin else "max_thrust",))

    def __str__(self) -> str:
        """The outcome in a few words."""
        words = f"{digits(self.min_thrust)} to {digits(self.max_thrust)} N, "
        off = f"{digits(abs(self.margin))} N"
        if self.margin >= 0:
            return words + f"within limits by {off}"
        if self.low_margin < self.high_margin:
            return words + f"{off} too little for rotor {self.min_rotor} at {self.min_time:.3f} s"
        return words + f"{off} too much for rotor {self.max_rotor} at {self.max_time:.3f} s"


def sampled_margin(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> RotorMargin:
    """The margin of thrusts at samples only, never smaller than the true one: negative, it needs no proof.

    What rotors with lag are commanded could only make it smaller, and is left to the certificate.
    Costs a seventh of a certificate, and most attempts of a search on durations are far beyond their limits.
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
    """A rotor's thrust or command that is not proven to keep as much from its limit as was asked."""

    finding: Finding
    reserve: float  # of the rotor's range, asked
    kept: float  # of it, proven

    @property
    def size(self) -> float:
        """The reserve that is missing, as a fraction of the rotor's range."""
        return self.reserve - self.kept

    def __str__(self) -> str:
        """One sentence without its full stop."""
        return (
            f"the {self.finding.name} keeps {100.0 * self.kept:.3g} % of its range at "
            f"{self.finding.time:.3f} s, {100.0 * self.reserve:.3g} % are asked in reserve"
        )

    @property
    def reason(self) -> Reason:
        """The sentence with the limit that the reserve is kept from."""
        return Reason(str(self), (self.finding.field, "reserve"))


def reserve_shortfalls(certificate: Certificate, reserve: float) -> list[ReserveShortfall]:
    """Return the findings where rotors are not proven to keep a reserve, the worst first.

    The reserve is a fraction of a rotor's range, at its lower end a part of what a hover takes. The list is
    empty without a reserve: then the rotors' limits are all that counts.
    """
    if reserve <= 0.0:
        return []
    found = [
        ReserveShortfall(finding, kept(reserve, finding.room), proven_margin(finding) / _size(finding))
        for finding in rotor_findings(certificate)
    ]
    return sorted((each for each in found if each.size > 0.0), key=lambda shortfall: shortfall.kept)


def rotor_findings(certificate: Certificate, side: Side | None = None) -> list[Finding]:
    """Findings of a certificate about each rotor's thrust, and its command if it lags, on one side or all."""
    return [f for f in certificate.findings if f.rotor is not None and side in (None, f.side)]


def _size(finding: Finding) -> float:
    assert finding.size is not None, "a finding about a rotor's limit has its size"
    return finding.size
