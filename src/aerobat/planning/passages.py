"""Passages through gates that a plan intends: its placed stages, with what the problem's stages ask."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.certification import PlannedPassage
from aerobat.planning.result import PlacedStage
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage


def planned_passages(stages: Sequence[PlacedStage], problem: Problem) -> tuple[PlannedPassage, ...]:
    """The gates that are passed at placed stages, as the problem's own stages ask, in their order."""
    asked = list(problem.stages(1.0).stages)  # the attitudes are the same, whatever thrust there is
    found = []
    for place in stages:
        if place.gate is not None:
            stage = next((stage for stage in asked if stage.gate == place.gate), Stage(place.name))
            asked = [other for other in asked if other is not stage]
            found.append(PlannedPassage.of(stage, problem.gate(place.gate), place.time))
    return tuple(found)
