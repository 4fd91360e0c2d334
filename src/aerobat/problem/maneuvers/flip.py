"""A flip through a gate that is passed on the way, say upside down (paper, Sections II-A to II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import ClassVar

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import Positive
from aerobat.errors import SpecError
from aerobat.problem.condition import Condition, thrust_in_plane
from aerobat.problem.gate import Gate, only_gate
from aerobat.problem.maneuvers.gate_passage import (
    PAPER_INVERTED,
    PAPER_LATERAL,
    PAPER_PASSAGE,
    GatePassage,
)
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import Stage, StageSequence
from aerobat.so3 import UP


@maneuver("flip")
class Flip(Maneuver):
    """A full turn about a horizontal axis, through a gate on the way (paper, Sections II-A to II-C).

    Stages of thrust at 45°, 90°, 180°, 270° and 315° of the turn, of which the gate takes the place of the
    one next to it: upside down, tilted by 180°, as in the paper, or at any angle of the turn at which its
    upright lies. Each asks for thrust along its direction: none across it in the plane of the turn, and at
    least `min_lateral_thrust` or, upside down, `min_inverted_thrust` along it, in m/s²; by default fractions
    of what the vehicle can give. As the paper prints it (`signed` and `ordered` False) the stages at 45° and
    315° take either sign and the solver may turn either way. The gate is passed as `passage` says.
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

    ANGLES_DEG: ClassVar[tuple[float, ...]] = (45.0, 90.0, 180.0, 270.0, 315.0)  # of the turn
    APART_DEG: ClassVar[float] = 22.5  # from the gate's: stages that are nearer ask the same
    IN_PLANE_DEG: ClassVar[float] = 0.1  # as exactly as files are written
    LATERAL_FRACTION: ClassVar[float] = 0.2  # of the greatest specific thrust
    INVERTED_FRACTION: ClassVar[float] = 0.2

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the stages of the turn, the gate's among them.

        Raises SpecError unless there is one gate, whose upright the turn comes by.
        """
        gate = only_gate(gates, self.kind)
        at_gate_deg = self._angle_deg(gate)
        angles_deg = [angle for angle in self.ANGLES_DEG if abs(angle - at_gate_deg) >= self.APART_DEG]
        stages = []
        for angle_deg in sorted([*angles_deg, at_gate_deg]):
            minimum = self._min_thrust(angle_deg, max_specific_thrust)
            in_plane = self._in_plane(angle_deg, minimum)
            if angle_deg == at_gate_deg:
                stages.append(self.passage.stage(gate, in_plane, minimum))
            else:
                stages.append(Stage(f"{angle_deg:g}°", in_plane))
        return StageSequence(tuple(stages), ordered=self.ordered)

    def as_in_paper(self) -> Flip:
        """Return it unsigned, unordered, with ε_l = 18 and ε_z = 25 m/s²."""
        return Flip(self.axis_deg, PAPER_LATERAL, PAPER_INVERTED, False, False, PAPER_PASSAGE)

    @property
    def turn_axis(self) -> Array:
        """The horizontal unit vector about which the vehicle turns, right-handed, (3,)."""
        heading = np.deg2rad(self.axis_deg)
        return np.array([np.cos(heading), np.sin(heading), 0.0])

    def _angle_deg(self, gate: Gate) -> float:
        """The angle of the turn [deg] at which the thrust lies along the gate's upright.

        Raises SpecError where the turn does not come by it.
        """
        out_of_plane = float(np.rad2deg(np.arcsin(np.clip(gate.up @ self.turn_axis, -1.0, 1.0))))
        if abs(out_of_plane) > self.IN_PLANE_DEG:
            heading = float(np.rad2deg(np.arctan2(gate.up[1], gate.up[0])))
            raise SpecError(
                f"gate '{gate.name}': its upright lies {abs(out_of_plane):.3g}° outside the plane of a turn "
                f"about maneuver.axis_deg = {self.axis_deg:g}; turn about {_wrapped(heading + 90.0):g} or "
                f"{_wrapped(heading - 90.0):g}, or change the gate's heading_deg or tilt_deg"
            )
        sideways = gate.up @ np.cross(self.turn_axis, UP)
        angle_deg = float(np.rad2deg(np.arctan2(sideways, gate.up[2])))
        angle_deg = round(angle_deg % 360.0, 9)
        tilt_deg = min(angle_deg, 360.0 - angle_deg)
        if tilt_deg < self.APART_DEG:
            raise SpecError(
                f"gate '{gate.name}' is tilted by {tilt_deg:.3g}°, next to upright, which is no part of a "
                f"flip's turn; tilt it by {self.APART_DEG:g}° or more, or take the maneuver line"
            )
        return angle_deg

    def _in_plane(self, angle_deg: float, minimum: float) -> tuple[Condition, ...]:
        """Thrust at an angle of the turn; its sign free where it is `signed` only by the diagonals."""
        diagonal = angle_deg in (self.ANGLES_DEG[0], self.ANGLES_DEG[-1])
        least = -inf if diagonal and not self.signed else minimum
        return thrust_in_plane(self._direction(angle_deg), self.turn_axis, least)

    def _min_thrust(self, angle_deg: float, max_specific_thrust: float) -> float:
        """The least specific thrust [m/s²] at an angle of the turn: upside down, or sideways."""
        if abs(angle_deg - 180.0) < 45.0:
            return self.min_inverted_thrust or self.INVERTED_FRACTION * max_specific_thrust
        return self.min_lateral_thrust or self.LATERAL_FRACTION * max_specific_thrust

    def _direction(self, angle_deg: float) -> Array:
        """The thrust's direction at an angle of the turn, (3,)."""
        return so3.rotate(so3.about_axis(self.turn_axis, np.deg2rad(angle_deg)), UP)


def _wrapped(angle_deg: float) -> float:
    """The angle between -180 and 180."""
    return round((angle_deg + 180.0) % 360.0 - 180.0, 6)
