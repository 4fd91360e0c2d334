"""The result of an inspection: how much of a flight's position error each cause explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import by_value, short
from aerobat.simulation.outcome import length
from aerobat.studies.inspection.alignment import Alignment

NEGLIGIBLE = 0.005  # [m] largest error without a cause: the best flights have errors of millimetres
_SHOWN = 5e-4  # [m] smallest part of an error that is shown
CAUSES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "start": ("the start offset", "hold the vehicle at the plan's start for longer before it begins"),
        "saturation": ("saturation", "plan with a larger `reserve`, or with limits the rotors can keep"),
        "delay": ("delay", "shorten `computation_delay`"),
        "hand-off": (
            "what the observer saw, as at a hand-off of cameras",
            "align the camera systems, see `motion_capture.hand_off`",
        ),
        "gains": (
            "thrust and attitude that fell short of their commands unsaturated",
            "find gains with `aerobat tune`",
        ),
        "vehicle": (
            "a vehicle or air other than planned for",
            "weigh the vehicle and measure its thrusts: `mass`, `max_thrust`, `drag`, wind",
        ),
        "motor order": (
            "an order of the motors other than the vehicle's",
            "set order and direction of the motors in the board's configurator",
        ),
        "rates": (
            "an inner loop that turns at other rates than asked",
            "paste the run's autopilot.txt to the board, which sets the rates of its sticks",
        ),
        "rate gains": (
            "an inner loop with other gains than set",
            "paste the run's autopilot.txt to the board, which sets its gains",
        ),
        "lag": (
            "a lag of the rotors longer than planned for",
            "measure their step response, set `lag`, and plan and configure anew",
        ),
        "thrust": (
            "rotors that give less thrust than they are commanded",
            "charge the battery, check motor and propeller, measure `max_thrust`, and plan with a larger "
            "`reserve`",
        ),
        "balance": (
            "a centre of mass other than planned for, or rotors that pull unevenly",
            "balance the vehicle, or set `centre_of_mass`, and plan and configure anew",
        ),
        "inertia": (
            "an inertia other than planned for",
            "measure it, as with a bifilar pendulum, set `inertia`, and plan and configure anew",
        ),
    }
)
UNOBSERVED = (  # of a log without the observer's state, in place of a delay
    "delay, or an observer whose state the log does not hold,",
    "log that state, which tells them apart; then shorten `computation_delay`, or see `motion_capture`",
)


@dataclass(frozen=True)
class Fault:
    """A fault of a flight controller's inner loop, of rotors or of the body, which a log shows."""

    cause: str  # a key of CAUSES
    evidence: str  # a sentence with its numbers

    def __str__(self) -> str:
        """Return the evidence."""
        return self.evidence


@dataclass(frozen=True)
class ErrorShare:
    """The part of the largest position error that is due to one cause."""

    cause: str  # a key of CAUSES
    error: float  # [m] component along the largest error; negative where the cause reduced it
    begin: float  # [s] first time at which the cause's own error exceeded half of its maximum
    end: float  # [s] last time of that

    def __str__(self) -> str:
        """Return one line with the cause and its part."""
        felt = f"felt from {self.begin:.2f} to {self.end:.2f} s"
        part = f"{CAUSES[self.cause][0]}: {100 * self.error:+.1f} cm"
        return f"{part}, {felt}" if self.is_felt else part

    @property
    def is_felt(self) -> bool:
        """True where the part is large enough to be shown."""
        return abs(self.error) >= _SHOWN


@short
@by_value
class Inspection:
    """The causes of a flight's position error."""

    times: Array  # [s] of the log, (T,)
    error: Array  # [m] position less set-point, world, (T, 3)
    errors: Mapping[str, Array]  # [m] by keys of CAUSES, (T, 3); their sum is `error`
    delay: float  # [s] from commands to rotors, identified from the log
    saturated: float  # [-] fraction of rows with a saturated rotor
    observed: bool  # false where the log lacks the observer's state
    alignment: Alignment
    fault: Fault | None = None  # of the inner loop, of rotors or of the body, whatever its effect

    def __post_init__(self) -> None:
        """Write-protect the arrays."""
        for series in (self.error, *self.errors.values()):
            series.flags.writeable = False

    @property
    def cause(self) -> str | None:
        """The fault that the log shows, whatever its effect; else the largest error's main cause, if any."""
        return self._main_cause if self.fault is None else self.fault.cause

    @property
    def _main_cause(self) -> str | None:
        """The main cause of the largest error; None where the error is negligible."""
        return None if self.largest < NEGLIGIBLE else self.shares[0].cause

    @property
    def largest(self) -> float:
        """The largest position error [m]."""
        return float(np.linalg.norm(self.error[self._worst]))

    @property
    def time(self) -> float:
        """The time of the largest error [s]."""
        return float(self.times[self._worst])

    @property
    def direction(self) -> Array:
        """The direction of the largest error, a unit vector in world axes, (3,); zero without an error."""
        return np.asarray(self.error[self._worst] / max(self.largest, 1e-9))

    @cached_property
    def shares(self) -> tuple[ErrorShare, ...]:
        """The part of the largest error that is due to each cause, the largest first."""
        shares = (self._share(cause, series) for cause, series in self.errors.items())
        return tuple(sorted(shares, key=lambda share: -share.error))

    @cached_property
    def _worst(self) -> int:
        """The row of the largest error."""
        return int(np.argmax(np.linalg.norm(self.error, axis=1)))

    def _share(self, cause: str, series: Array) -> ErrorShare:
        size = np.linalg.norm(series, axis=1)
        large = self.times[size >= 0.5 * size.max()]
        error = float(series[self._worst] @ self.direction)
        return ErrorShare(cause, error, float(large[0]), float(large[-1]))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on the main cause's evidence, on how the log was aligned, and on what it lacks."""
        place, remarks = self.alignment, []
        if self.fault is not None and self.fault.cause == self._main_cause:
            remarks.append(str(self.fault))
        if not place.is_none:
            remarks.append(
                f"the log's clock reads {place.time_shift:.3f} s when the plan begins; its axes are turned "
                f"by {np.rad2deg(place.yaw):.2f}° and moved by {length(place.moved)}"
            )
        if not self.observed:
            remarks.append(
                "the log does not hold what an observer saw: hand-offs and other errors of sensors do not "
                "show"
            )
        return tuple(remarks)

    @property
    def verdict(self) -> str:
        """The main cause and its remedy in a sentence, after a fault that the log shows."""
        if self.fault is None or self.fault.cause == self._main_cause:
            return self._explanation
        return f"{self.fault}; {CAUSES[self.fault.cause][1]}. Of the error: {self._explanation}"

    @property
    def _explanation(self) -> str:
        if self._main_cause is None:
            return f"nothing stands out: the error is {length(self.largest)} at most"
        first = self.shares[0]
        name, remedy = CAUSES[first.cause]
        if first.cause == "delay" and not self.observed:
            name, remedy = UNOBSERVED
        of = f"{length(first.error)} of the largest error, {length(self.largest)} at {self.time:.2f} s"
        return f"{name} explains {of}; {remedy}"

    def __str__(self) -> str:
        """Return the verdict."""
        return self.verdict
