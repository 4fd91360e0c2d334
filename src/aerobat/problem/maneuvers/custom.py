"""Any maneuver, given explicitly as a list of stages."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from aerobat.problem.condition import Condition
from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import Stage, StageSequence


@maneuver("stages")
class CustomManeuver(Maneuver):
    """Any maneuver, spelled out: its stages as data; one that names a gate passes its centre too."""

    stages: Annotated[tuple[Stage, ...], Field(min_length=1)]  # in order
    path_constraints: tuple[Condition, ...] = ()  # what holds throughout
    ordered: bool = True  # the stages follow one another; false: in any order

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return its stages."""
        return StageSequence(self.stages, self.path_constraints, self.ordered)
