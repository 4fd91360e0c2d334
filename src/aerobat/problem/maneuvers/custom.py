"""Any maneuver, spelled out as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from aerobat.problem.gate import Gate, at_centre, named_gate
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import Condition, Stage, StageSequence


@maneuver("stages")
class CustomManeuver(Maneuver):
    """Any maneuver, spelled out: its stages as data; one that names a gate passes its centre too."""

    stages: Annotated[tuple[Stage, ...], Field(min_length=1)]  # in order
    path_constraints: tuple[Condition, ...] = ()  # what holds at every interval's end
    ordered: bool = True  # the stages follow one another; false: in any order

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return its stages, those that name a gate through its centre.

        Raises SpecError for unknown gates.
        """
        stages = tuple(
            s
            if s.gate is None
            else replace(s, conditions=(*at_centre(named_gate(gates, s.gate)), *s.conditions))
            for s in self.stages
        )
        return StageSequence(stages, self.path_constraints, self.ordered)
