"""The report of a live flight, from its telemetry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees

import numpy as np

from aerobat import so3
from aerobat.links.goals import Observed
from aerobat.links.stream import SetpointStream
from aerobat.planning import Plan, planned_passages
from aerobat.simulation.autopilot.loop import COMMAND_HOLD_TIME
from aerobat.simulation.outcome import length
from aerobat.simulation.passages import NearestObstacle, Passage, log_rows, nearest_in_log, passages_in_log


@dataclass(frozen=True)
class LinkReport:
    """A flight over a live link: its errors and gate passages, or why it was aborted."""

    aborted: str  # the reason; empty where the plan was flown to its end
    ended: str  # the last stage reached
    delay_s: float  # one-way delay of a message
    max_lateness_s: float  # of set-points, while the plan was flown
    observations: int  # while the plan was flown; with fewer than two, the following fields are unknown
    max_position_error_m: float | None = None
    max_attitude_error_deg: float | None = None
    longest_silence_s: float | None = None  # between two observations
    passages: tuple[Passage, ...] = ()
    nearest: NearestObstacle | None = None  # None where there are no obstacles

    @property
    def failures(self) -> tuple[str, ...]:
        """All failures, in words."""
        judged = (*((self.nearest,) if self.nearest else ()), *self.passages)
        missed = [each.failure.sentence() for each in judged if each.failure is not None]
        return (*((f"aborted: {self.aborted}",) if self.aborted else ()), *missed)

    @property
    def is_success(self) -> bool:
        """True where the plan was flown to its end, through its gates, and the vehicle has landed."""
        return not self.failures and self.ended == "landed"

    @property
    def is_late(self) -> bool:
        """True where a set-point came later than the time for which a vehicle keeps the previous one."""
        return self.max_lateness_s > COMMAND_HOLD_TIME

    def __str__(self) -> str:
        """Return one sentence."""
        late = f"; set-points were up to {1e3 * self.max_lateness_s:.0f} ms late" if self.is_late else ""
        if self.failures:
            return f"{'; '.join(self.failures)}{late}; {self.ended}"
        error = length(self.max_position_error_m or 0.0)
        through = ", ".join(f"gate '{p.gate}' {length(p.miss)} off its centre" for p in self.passages)
        return (
            f"flown within {error} of the plan{', through ' + through if through else ''}{late}; {self.ended}"
        )


def link_report(
    plan: Plan,
    stream: SetpointStream,
    log: Sequence[Observed],
    *,
    aborted: str,
    ended: str,
    delay: float,
    late: float,
) -> LinkReport:
    """Judge a flight.

    Args:
        plan: the plan that was flown.
        stream: its set-points.
        log: states observed during the plan, with times since its start [s].
        aborted: the reason of an abort, empty where there was none.
        ended: the last stage reached.
        delay: one-way delay of a message [s].
        late: largest delay of a set-point beyond its time [s].
    """
    inside = [observed for observed in log if 0.0 <= observed.time <= stream.duration]
    report = LinkReport(aborted, ended, delay, late, len(inside))
    if len(inside) < 2:
        return report
    times = np.array([observed.time for observed in inside])
    position, velocity, q = (
        np.array([getattr(observed.body, name) for observed in inside])
        for name in ("position", "velocity", "q_world_body")
    )
    points = [stream.at(t) for t in times]
    off = np.linalg.norm(position - [point.position for point in points], axis=-1)
    turned = so3.angle_between(q, np.array([point.q_world_body for point in points]))
    place = position - stream.offset
    rows = log_rows(times, place, velocity, q)
    body = None if plan.vehicle is None else plan.vehicle.bounding_ellipsoid
    stop = np.array([times[-1] if aborted else np.nan])
    flown = passages_in_log(rows, planned_passages(plan.stages, plan.problem), body, stop)
    return replace(
        report,
        max_position_error_m=float(off.max()),
        max_attitude_error_deg=degrees(float(turned.max())),
        longest_silence_s=float(np.diff(times).max()),
        passages=tuple(passage.of_flight(0) for passage in flown),
        nearest=nearest_in_log(plan.problem.surroundings.pieces, times, place, q, body),
    )
