"""A certified path whose own flight has a defect, mended: more direct through gates, or with a reserve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from aerobat.limits.body_in_gate import BodyInGate
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.gate_clearance import cleared, more_direct
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.miqp.refinement import PathProgram, descent, finished

MAX_HALVINGS = 3  # of the bending that room in a gate allows for, where it leads to no path
RESERVES = (0.02, 0.05, 0.1, 0.2)  # of the rotors' ranges, for paths that leave the controller too little


@dataclass(frozen=True, eq=False)
class _Mended:
    """A certified path."""

    attempts: Attempts
    judged: Judged[Placement]
    program: PathProgram

    @property
    def flight(self) -> OwnFlight:
        """Its own."""
        trajectory, vehicle = self.judged.solution.trajectory, self.attempts.vehicle
        assert vehicle is not None
        assert trajectory is not None
        placed = self.attempts.placed(self.judged)
        return own_flight(trajectory, vehicle, self.attempts.formulation.problem, placed)

    def more_direct(self, flight: OwnFlight) -> _Mended | None:
        """The path with more room in the gates that a flight did not pass; None where none is found."""
        formulation, before = self.attempts.formulation, self.program.in_gates
        stages, problem = formulation.sequence.stages, formulation.problem
        in_gates = more_direct(before, stages, problem, self.program.vehicle, flight)
        for _ in range(MAX_HALVINGS if in_gates != before else 0):
            again = replace(self, program=replace(self.program, in_gates=in_gates))._refined()
            if again is not None or out_of_time():
                return again
            in_gates = _halfway(before, in_gates)
        return None

    def with_reserve(self, reserve: float) -> _Mended | None:
        """The path with a reserve kept for the controller; None where none is found."""
        kept = max(reserve, self.program.reserve)
        return replace(self, program=replace(self.program, reserve=kept))._refined()

    def _refined(self) -> _Mended | None:
        """The path refined to its program; None where that leads to none that is certified."""
        source = self.judged.solution.source
        assert source.path is not None
        found = descent(self.program, source.path.x).path
        if found is None:
            return None
        judged = self.attempts.refined(source, partial(finished, found))
        return replace(self, judged=judged) if judged.feasible else None


def _halfway(before: Sequence[BodyInGate], in_gates: Sequence[BodyInGate]) -> tuple[BodyInGate, ...]:
    """Room halfway between, of gates that had none that of half the bending."""
    bending = {body.stage: body.bending for body in before}
    return tuple(
        replace(body, bending=0.5 * (body.bending + bending.get(body.stage, 0.0))) for body in in_gates
    )


def flyable(attempts: Attempts, judged: Judged[Placement]) -> Judged[Placement]:
    """The same, or where its own flight has a defect a slower one without, if there is.

    A path that lingers in its gate, or turns back there, is made more direct there, any other gets a reserve
    for the controller.
    """
    path = judged.solution.source.path
    if path is None:
        return judged
    mended = _Mended(attempts, judged, path.program)
    best = flight, mended = cleared(mended, lambda found: found.flight, _Mended.more_direct)
    for reserve in RESERVES:
        if not flight.wants_reserve or out_of_time():
            break
        again = mended.with_reserve(reserve)
        if again is not None:
            flight, mended = again.flight, again
            best = min(best, (flight, mended), key=lambda pair: pair[0].rank)
    return best[1].judged
