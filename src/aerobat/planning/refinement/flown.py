"""A refined path with a defect, refined again: more room in gates, or a reserve that its flight lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from aerobat.certification import Finding
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.optimization.deadline import out_of_time, processor, within_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.gate_clearance import cleared, is_clear, more_direct
from aerobat.planning.refinement.refine import RefinedPath, Refinement

MAX_HALVINGS = 3  # of the bending that room in a gate allows for, where it leads to no path
# [s] of the processor: one of 300 random problems is cleared in 15; three went on for minutes, in vain
CLEARING_TIME = 20.0
RESERVES = (0.02, 0.05, 0.1, 0.2)  # of the rotors' ranges, for paths that leave the controller too little


@dataclass(frozen=True, eq=False)
class FlownPath:
    """A certified path and the refinement that it comes from."""

    refinement: Refinement
    judged: Judged[RefinedPath]

    @classmethod
    def of(cls, refinement: Refinement, judged: Judged[RefinedPath]) -> FlownPath:
        """The path, its stages placed."""
        return cls(refinement, judged.at(judged.solution.source.placed))

    @property
    def frames(self) -> tuple[Finding, ...]:
        """The findings about its body and each gate's frame."""
        return self.judged.frames

    @property
    def is_clear(self) -> bool:
        """True if its body is clear of every gate's frame."""
        return is_clear(self.frames)

    @property
    def duration(self) -> float:
        """Of the path [s]."""
        return self.judged.solution.duration

    @property
    def flight(self) -> OwnFlight:
        """The findings about the path's own flight, the nominal one."""
        source = self.judged.solution.source
        return own_flight(self.refinement.task, source.path.trajectory, source.placed)

    def through_gates(self) -> FlownPath:
        """Return the path, or one with more room in the gates whose frames its body does not clear."""
        with within_time(CLEARING_TIME, processor):
            return cleared(self, FlownPath._more_direct)

    def with_reserves(self) -> FlownPath:
        """Return the path itself, or one with a reserve that leaves the controller what its flight lacked."""
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
        """The path with more room in the gates whose frames are not clear; None where none is found."""
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
        """The path refined once more; None where that leads to none that is certified."""
        path, refinement = self.judged.solution.source.path, replace(self.refinement, grows=False)
        judged = refinement.finished(refinement.path(path))
        if not (judged.feasible or out_of_time()):
            judged = refinement.refined(path, path.trajectory.segments)
        return FlownPath.of(refinement, judged) if judged.feasible else None


def _halfway(before: Sequence[BodyInGate], in_gates: Sequence[BodyInGate]) -> tuple[BodyInGate, ...]:
    """Room halfway between, of gates that had none that of half the bending."""
    bending = {body.stage: body.bending for body in before}
    return tuple(
        replace(body, bending=0.5 * (body.bending + bending.get(body.stage, 0.0))) for body in in_gates
    )
