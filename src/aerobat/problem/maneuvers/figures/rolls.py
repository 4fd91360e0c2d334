"""Figures of rolls: about the direction of flight, and along a helix."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin
from typing import ClassVar

from aerobat.declaration import Positive, Repeats
from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.figures.figure import Figure
from aerobat.problem.maneuvers.maneuver import maneuver
from aerobat.problem.stage import StageSequence


@maneuver("barrel-roll")
class BarrelRoll(Figure):
    """Full rolls to the right about the direction of flight, never slower along it [DDA, FAI]."""

    count: Repeats = 1  # rolls

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the entry, upright, and the quarters of every roll."""
        place = self.place(gates, max_specific_thrust)
        forward = place.heads((1.0, 0.0, 0.0), self.speed)
        position = () if place.gate else place.near((0.0, 0.0, 0.0), 0.0)
        stages = [place.stage("entry", (0.0, 0.0, 1.0), *position, forward, at_gate=True)]
        for angle_deg in range(90, 360 * self.count + 1, 90):
            up = (0.0, -sin(radians(angle_deg)), cos(radians(angle_deg)))
            stages.append(place.stage(f"{angle_deg}°", up, forward))
        return StageSequence(tuple(stages))


@maneuver("corkscrew")
class Corkscrew(Figure):
    """Turns of a helix about the direction of flight, rolling to the right, the thrust to its axis."""

    radius: Positive = 1.0  # [m] of the helix, whose axis lies so far above the entry
    lead: Positive = 3.0  # [m] along the axis, of one turn
    count: Repeats = 2  # turns

    MARGIN: ClassVar[float] = 0.25  # of the radius, tolerance of positions on the helix

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the entry below the axis, upright, and the quarters of every turn."""
        place = self.place(gates, max_specific_thrust)
        stages = []
        for angle_deg in range(0, 360 * self.count + 1, 90):
            sine, cosine = sin(radians(angle_deg)), cos(radians(angle_deg))
            point = (self.lead * angle_deg / 360.0, self.radius * sine, self.radius * (1.0 - cosine))
            position = () if angle_deg == 0 and place.gate else place.near(point, self.MARGIN * self.radius)
            forward = place.heads((1.0, 0.0, 0.0), 0.0 if angle_deg else self.speed)
            name = f"{angle_deg}°" if angle_deg else "entry"
            stages.append(place.stage(name, (0.0, -sine, cosine), *position, forward, at_gate=angle_deg == 0))
        return StageSequence(tuple(stages))
