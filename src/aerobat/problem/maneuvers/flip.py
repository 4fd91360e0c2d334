"""A flip through a gate that is passed upside down (paper, Sections II-A to II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import ClassVar

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import Positive
from aerobat.problem.gate import Gate, only_gate
from aerobat.problem.maneuvers.gate_passage import (
    PAPER_INVERTED,
    PAPER_LATERAL,
    PAPER_PASSAGE,
    GatePassage,
)
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import Stage, StageSequence, thrust_along
from aerobat.so3 import UP


@maneuver("flip")
class Flip(Maneuver):
    """A full turn about a horizontal axis, upside down in the gate (paper, Sections II-A to II-C).

    Five stages: thrust at 45°, 90°, upside down in the gate, at 270° and at 315° of the turn. Each asks
    for thrust along that direction: none across it in the plane of the turn, and at least
    `min_lateral_thrust` (at 45°, 90°, 270°, 315°) or `min_inverted_thrust` (in the gate) along it, in
    m/s²; by default fractions of what the vehicle can give. As the paper prints it (`signed` and `ordered`
    False) the stages at 45° and 315° take either sign and the solver may turn either way. The gate is passed
    as `passage` says.
    """

    # heading of the axis of the turn, right-handed: 0 turns about +x, 90 about +y, -90 nose up
    axis_deg: float = 0.0  # [deg]
    # least specific thrust sideways; left out, 20 % of what the vehicle has
    min_lateral_thrust: Positive | None = None  # [m/s²]
    # least specific thrust upside down; left out, 20 % of what the vehicle has
    min_inverted_thrust: Positive | None = None  # [m/s²]
    signed: bool = True  # the thrust at 45° and 315° points upward; false: either way, as in the paper
    ordered: bool = True  # the stages follow one another; false: in any order, as in the paper
    passage: GatePassage = GatePassage()  # how the gate is passed

    LATERAL_FRACTION: ClassVar[float] = 0.2  # of the greatest specific thrust
    INVERTED_FRACTION: ClassVar[float] = 0.2

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the five stages, the gate's fixed at the middle.

        Raises SpecError unless there is one gate.
        """
        gate = only_gate(gates, self.kind)
        lateral = self.min_lateral_thrust or self.LATERAL_FRACTION * max_specific_thrust
        inverted = self.min_inverted_thrust or self.INVERTED_FRACTION * max_specific_thrust
        diagonal = lateral if self.signed else -inf
        turn = {
            name: thrust_along(self._direction(angle_deg), self.turn_axis, minimum)
            for name, angle_deg, minimum in (
                ("45°", 45.0, diagonal),
                ("90°", 90.0, lateral),
                ("gate", 180.0, inverted),
                ("270°", 270.0, lateral),
                ("315°", 315.0, diagonal),
            )
        }
        stages = tuple(
            self.passage.stage(gate, conditions) if name == "gate" else Stage(name, conditions)
            for name, conditions in turn.items()
        )
        return StageSequence(stages, ordered=self.ordered)

    def as_in_paper(self) -> Flip:
        """Return it unsigned, unordered, with ε_l = 18 and ε_z = 25 m/s²."""
        return Flip(self.axis_deg, PAPER_LATERAL, PAPER_INVERTED, False, False, PAPER_PASSAGE)

    @property
    def turn_axis(self) -> Array:
        """The horizontal unit vector about which the vehicle turns, right-handed, (3,)."""
        heading = np.deg2rad(self.axis_deg)
        return np.array([np.cos(heading), np.sin(heading), 0.0])

    def _direction(self, angle_deg: float) -> Array:
        """The thrust's direction at an angle of the turn, (3,)."""
        return so3.rotate(so3.about_axis(self.turn_axis, np.deg2rad(angle_deg)), UP)
