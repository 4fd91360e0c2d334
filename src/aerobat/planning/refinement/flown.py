"""Repair of refined paths: refine again with more room in gates, or with more reserve for the controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from aerobat.certification import Finding
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.optimization.deadline import out_of_time, within_time, work
from aerobat.planning.certified_solve import Judged
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.gate_clearance import cleared, is_clear, more_direct
from aerobat.planning.refinement.refine import RefinedPath, Refinement

MAX_HALVINGS = 3  # attempts with the added room in gates, which is halved where an attempt finds no path
# Work limit [s] of clearing frames: longer attempts mostly fail; gates are passed faster then
CLEARING_WORK = 8.0
RESERVES = (0.02, 0.05, 0.1, 0.2)  # reserves tried in turn, as fractions of the rotors' thrust ranges


@dataclass(frozen=True, eq=False)
class FlownPath:
    """A certified path and the refinement that it comes from."""

    refinement: Refinement
    judged: Judged[RefinedPath]

    @classmethod
    def of(cls, refinement: Refinement, judged: Judged[RefinedPath]) -> FlownPath:
        """Return the path with its stages placed."""
        return cls(refinement, judged.at(judged.solution.source.placed))

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about the body's clearance from each gate's frame."""
        return self.judged.frames

    @property
    def is_clear(self) -> bool:
        """True if the body is proven clear of every gate's frame."""
        return is_clear(self.frames)

    @property
    def duration(self) -> float:
        """The duration of the path [s]."""
        return self.judged.solution.duration

    @property
    def flight(self) -> OwnFlight:
        """The findings of the nominal simulated flight of the path."""
        source = self.judged.solution.source
        return own_flight(self.refinement.task, source.path.trajectory, source.placed)

    def through_gates(self) -> FlownPath:
        """Return the path, or one with more room in the gates whose frames the body does not clear."""
        with within_time(CLEARING_WORK, work):
            return cleared(self, FlownPath._more_direct)

    def with_reserves(self) -> FlownPath:
        """Return the path, or the best of paths with larger reserves where its flight needs more reserve."""
        flight, found = self.flight, self
        best = flight, found
        for reserve in RESERVES:
            if not flight.wants_reserve or out_of_time():
                break
            task = replace(self.refinement.task, reserve=max(reserve, self.refinement.task.reserve))
            again = replace(found, refinement=replace(found.refinement, task=task))._refined()
            if again is not None:
                flight, found = again.flight, again
                best = min(best, (flight, found), key=lambda pair: pair[0].rank)
        return best[1]

    def _more_direct(self) -> FlownPath | None:
        """Return a path with more room in the gates whose frames are not clear, or None."""
        refinement, stages = self.refinement, self.judged.solution.source.path.stages
        before = refinement.rooms(stages)
        in_gates = more_direct(before, stages, refinement.task, self.frames)
        for _ in range(MAX_HALVINGS if in_gates != before else 0):
            again = replace(self, refinement=replace(refinement, in_gates=in_gates))._refined()
            if again is not None or out_of_time():
                return again
            in_gates = _halfway(before, in_gates)
        return None

    def _refined(self) -> FlownPath | None:
        """Return the path refined once more with this refinement, or None where no path is certified."""
        path, refinement = self.judged.solution.source.path, replace(self.refinement, adds_segments=False)
        judged = refinement.finished(refinement.path(path))
        if not (judged.feasible or out_of_time()):
            judged = refinement.refined(path, path.trajectory.segments)
        return FlownPath.of(refinement, judged) if judged.feasible else None


def _halfway(before: Sequence[BodyInGate], in_gates: Sequence[BodyInGate]) -> tuple[BodyInGate, ...]:
    """Return the gates with the mean of both rooms; in a gate unknown before, no acceleration had room."""
    known = {body.stage: body for body in before}
    return tuple(
        body.halfway_from(known.get(body.stage, replace(body, lateral_acceleration=0.0))) for body in in_gates
    )
