"""Passes in an unusual attitude: on knife edge, and upside down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from aerobat.declaration import declared
from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.figures.figure import Figure
from aerobat.problem.maneuvers.maneuver import maneuver
from aerobat.problem.stage import StageSequence


@declared
class AttitudePass(Figure):
    """A place passed at speed with the thrust along a direction."""

    UP: ClassVar[tuple[float, float, float]]
    NAME: ClassVar[str]

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage."""
        place = self.place(gates, max_specific_thrust)
        position = () if place.gate else place.near((0.0, 0.0, 0.0), 0.0)
        forward = place.heads((1.0, 0.0, 0.0), self.speed)
        return StageSequence((place.stage(self.NAME, self.UP, *position, forward, at_gate=True),))


@maneuver("knife-edge-pass")
class KnifeEdgePass(AttitudePass):
    """Past a place rolled to the right by 90°, the thrust horizontal across the flight [FPV]."""

    UP = (0.0, -1.0, 0.0)
    NAME = "knife edge"


@maneuver("inverted-pass")
class InvertedPass(AttitudePass):
    """Past a place upside down, the thrust straight down [FPV]."""

    UP = (0.0, 0.0, -1.0)
    NAME = "inverted"
