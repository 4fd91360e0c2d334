"""A passage through a tilted gate with the thrust along its upright (paper, Section II-D)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from aerobat.declaration import Angle, Positive, validated
from aerobat.errors import SpecError
from aerobat.problem.condition import (
    THRUST_FRACTION,
    Condition,
    Quantity,
    min_attitude_thrust,
    thrust_in_plane,
)
from aerobat.problem.gate import Gate, passed_gate
from aerobat.problem.maneuvers.gate_passage import PAPER_LATERAL, PAPER_PASSAGE, GatePassage
from aerobat.problem.maneuvers.maneuver import Maneuver, maneuver
from aerobat.problem.stage import StageSequence
from aerobat.so3 import UP
from aerobat.states import STANDARD_GRAVITY

HALF_FLIP_FRACTION = 0.85  # fraction of MIN_ATTITUDE_THRUST: half-flips are slower than figures
_UPRIGHT = 1e-9  # [-] horizontal component of a gate's upright, below which the gate is upright


@maneuver("half-flip")
class HalfFlip(Maneuver):
    """Thrust along the tilted gate's upright while passing it, never upside down (paper, Section II-D)."""

    # ε_y, least horizontal thrust across the passage; left out, 19 times the sine of the gate's tilt for
    # vehicles that have 22.5 beside their weight, and along its upright a hover's or 20 % of the most thrust
    min_lateral_thrust: Positive | None = None  # [m/s²]
    passage: GatePassage = GatePassage()  # how the gate is passed
    gate: str | None = None  # name of the gate; left out, the only one

    TITLE: ClassVar[str] = "half-flip"

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage, the gate, and thrust that never points down: (a_z + g) tan α = a_y, α ≤ 90°.

        If `gate` names the gate, as among the elements of a course, only the stage is returned, since other
        elements may point the thrust down. Raises SpecError unless there is one gate, its upright not below
        the horizontal.
        """
        gate = passed_gate(gates, self.gate, self.kind)
        minimum = self._min_thrust(gate, max_specific_thrust)
        in_plane = thrust_in_plane(gate.up, gate.normal, minimum)
        stages = (self.passage.stage(gate, in_plane, minimum),)
        if self.gate is not None:
            return StageSequence(stages)
        never_upside_down = Condition(Quantity.SPECIFIC_THRUST, UP, lower=0.0)
        return StageSequence(stages, (never_upside_down,))

    def as_in_paper(self) -> HalfFlip:
        """Return a half-flip with ε_y = 18 m/s²."""
        return replace(self, min_lateral_thrust=PAPER_LATERAL, passage=PAPER_PASSAGE)

    @validated
    def with_gate_tilt(self, gates: Sequence[Gate], tilt: Angle) -> tuple[Gate, ...]:
        """Return the gates at another tilt [rad]."""
        return tuple(gate.tilted(tilt) for gate in gates)

    @validated
    def with_stage_thrust(self, gates: Sequence[Gate], thrust: Positive) -> HalfFlip:
        """Return a copy with a minimum specific thrust [m/s²] in its gate; unchanged for an upright gate."""
        up = passed_gate(gates, self.gate, self.kind).up
        across = float(np.hypot(up[0], up[1]))
        return self if across < _UPRIGHT else replace(self, min_lateral_thrust=thrust * across)

    def _min_thrust(self, gate: Gate, max_specific_thrust: float) -> float:
        """Return the minimum specific thrust along the gate's upright [m/s²]."""
        if gate.up[2] < -1e-9:
            raise SpecError("gate.tilt_deg must be from -90 to 90 for a half-flip; past that it is a flip")
        across = float(np.hypot(gate.up[0], gate.up[1]))
        if self.min_lateral_thrust is None:
            sideways = HALF_FLIP_FRACTION * min_attitude_thrust(max_specific_thrust)
            hover = min(sideways, STANDARD_GRAVITY)
            return max(THRUST_FRACTION * max_specific_thrust, across * sideways, hover)
        if across < _UPRIGHT:
            raise SpecError(
                "maneuver.min_lateral_thrust asks for thrust sideways, which an upright gate has not; tilt it"
            )
        return self.min_lateral_thrust / across
