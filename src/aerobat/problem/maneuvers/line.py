"""A path from start to goal through gates, no attitude asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.gate_passage import PAPER_PASSAGE, GatePassage
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import StageSequence


@maneuver("line")
class Line(Maneuver):
    """From start to goal with no attitude asked, through gates in their order; a single one at mid-time."""

    passage: GatePassage = GatePassage()  # how the gates are passed

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return no stages but the gates."""
        stages = tuple(self.passage.stage(gate, ()) for gate in gates)
        if len(stages) > 1:  # when each is passed is for the search to choose
            stages = tuple(replace(stage, at=None, interval_offset=0) for stage in stages)
        return StageSequence(stages)

    def as_in_paper(self) -> Line:
        """Return it with the gate passed as there."""
        return Line(PAPER_PASSAGE)
