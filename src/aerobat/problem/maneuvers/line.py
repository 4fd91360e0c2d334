"""A path from start to goal through gates, without attitudes."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.gate_passage import PAPER_PASSAGE, GatePassage
from aerobat.problem.maneuvers.maneuver import Maneuver, gate_in_words, maneuver
from aerobat.problem.stage import StageSequence


@maneuver("line")
class Line(Maneuver):
    """From start to goal with no attitude asked, through gates in their order."""

    passage: GatePassage = GatePassage()  # how the gates are passed

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage for each gate, and no others. Raises SpecError for a passage without a gate."""
        self.passage.require_gate(gates, self.kind)
        return StageSequence(tuple(self.passage.stage(gate) for gate in gates))

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the gates on the way."""
        return ", ".join(f"through {gate_in_words(gate.name)}" for gate in gates) or "along a line"

    def as_in_paper(self) -> Line:
        """Return a line whose gates are passed as in the paper."""
        return Line(PAPER_PASSAGE)
