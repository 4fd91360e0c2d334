"""A flip through a gate that is passed during the turn, e.g. upside down (paper, Sections II-A to II-C)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from math import inf
from typing import Any, ClassVar

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import PartialVector, Positive, Repeats, validated
from aerobat.errors import SpecError
from aerobat.problem.condition import (
    THRUST_FRACTION,
    Condition,
    Quantity,
    fixed,
    free,
    leaning_at_most,
    thrust_in_plane,
)
from aerobat.problem.gate import Gate, passed_gate
from aerobat.problem.maneuvers.gate_passage import (
    PAPER_INVERTED,
    PAPER_LATERAL,
    PAPER_PASSAGE,
    GatePassage,
)
from aerobat.problem.maneuvers.maneuver import Maneuver, gate_in_words, maneuver
from aerobat.problem.stage import Stage, StageSequence
from aerobat.so3 import UP


@maneuver("flip")
class Flip(Maneuver):
    """A full turn about a horizontal axis, through a gate on the way (paper, Sections II-A to II-C).

    The stages are at 45°, 90°, 180°, 270° and 315° of the turn. A gate replaces the stage nearest to it:
    upside down, tilted by 180°, as in the paper, or at any angle of the turn at which its upright lies. Each
    stage requires thrust along its direction: zero across it in the plane of the turn, and at least
    `min_lateral_thrust` or, upside down, `min_inverted_thrust` along it [m/s²]; the defaults are fractions of
    the vehicle's maximum. Upside down the thrust tilts out of that plane by 30° at most: otherwise quick
    flips would tilt farther and never turn over. In the paper's form (`signed` and `ordered` False) this tilt
    is free, the stages at 45° and 315° take either sign, and the solver may turn either way. `passage` says
    how the gate is passed.
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
    gate: str | None = None  # name of the gate; left out, the only one, or none
    position: PartialVector = field(default_factory=free)  # [m] world, upside down, where there is no gate
    count: Repeats = 1  # full turns
    mirrored: bool = False  # turns the other way

    ANGLES_DEG: ClassVar[tuple[float, ...]] = (45.0, 90.0, 180.0, 270.0, 315.0)  # [deg] of the turn
    APART_DEG: ClassVar[float] = 22.5  # [deg] from the gate's: closer stages are redundant
    INVERTED_WITHIN_DEG: ClassVar[float] = 30.0  # [deg] thrust out of plane, upside down
    IN_PLANE_DEG: ClassVar[float] = 0.1  # [deg] of a gate's upright: the rounding of files
    SIDES: ClassVar[Mapping[int, str]] = {0: "forward", 1: "left", 2: "back", 3: "right"}

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the stages of the turn, including the gate's.

        Raises SpecError where there are several gates and `gate` names none, where `passage` is given and
        there is no gate, or where the gate's upright is not in the plane of the turn.
        """
        gate = passed_gate(gates, self.gate, self.kind) if gates or self.gate is not None else None
        self.passage.require_gate(gates, self.kind)
        at_gate_deg = inf if gate is None else self._angle_deg(gate)
        turns = [360.0 * k + angle for k in range(self.count) for angle in self.ANGLES_DEG]
        turns += [360.0 * k for k in range(1, self.count)]
        angles_deg = [angle for angle in turns if abs(angle - at_gate_deg) >= self.APART_DEG]
        stages = [self._stage(angle, gate is None, max_specific_thrust) for angle in sorted(angles_deg)]
        if gate is not None:
            minimum = self._min_thrust(at_gate_deg, max_specific_thrust)
            passing = self.passage.stage(gate, self._in_plane(at_gate_deg, minimum), minimum)
            stages.insert(sum(angle < at_gate_deg for angle in angles_deg), passing)
        return StageSequence(tuple(stages), ordered=self.ordered)

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the flip with its count and side, as seen along the gate's passage, or along +x."""
        gate = passed_gate(gates, self.gate, self.kind) if self.gate or len(gates) == 1 else None
        forward = np.array([1.0, 0.0, 0.0]) if gate is None else gate.normal
        swing = np.cross(self.turn_axis, UP)
        angle_deg = np.rad2deg(np.arctan2(np.cross(forward, swing)[2], forward @ swing))
        side = self.SIDES.get(round(float(angle_deg) / 90.0) % 4, "")
        within = "" if gate is None else f" in {gate_in_words(gate.name)}"
        return f"{_times(self.count)}flip {side}{within}"

    def as_in_paper(self) -> Flip:
        """Return a flip that is unsigned and unordered, with ε_l = 18 and ε_z = 25 m/s²."""
        return replace(
            self,
            min_lateral_thrust=PAPER_LATERAL,
            min_inverted_thrust=PAPER_INVERTED,
            signed=False,
            ordered=False,
            passage=PAPER_PASSAGE,
        )

    @validated
    def with_stage_thrust(self, gates: Sequence[Gate], thrust: Positive) -> Flip:
        """Return a copy with a minimum specific thrust [m/s²] in its gate; unchanged without a gate."""
        if not gates and self.gate is None:
            return self
        angle_deg = self._angle_deg(passed_gate(gates, self.gate, self.kind))
        name = "min_inverted_thrust" if _is_inverted(angle_deg) else "min_lateral_thrust"
        changes: dict[str, Any] = {name: thrust}
        return replace(self, **changes)

    @property
    def turn_axis(self) -> Array:
        """The horizontal unit vector about which the vehicle turns, right-handed, (3,)."""
        heading = np.deg2rad(self.axis_deg + 180.0 * self.mirrored)
        return np.array([np.cos(heading), np.sin(heading), 0.0])

    def _angle_deg(self, gate: Gate) -> float:
        """Return the angle of the turn [deg] at which the thrust is along the gate's upright.

        Raises SpecError where the gate's upright is not in the plane of the turn, or nearly upright.
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

    def _stage(self, angle_deg: float, is_free: bool, max_specific_thrust: float) -> Stage:
        """Return the stage at an angle of the turns; without a gate, the one upside down has the position."""
        thrust = self._in_plane(angle_deg, self._min_thrust(angle_deg, max_specific_thrust))
        if self.signed and _is_inverted(angle_deg):
            thrust += leaning_at_most(-UP, self.turn_axis, np.deg2rad(self.INVERTED_WITHIN_DEG))
        position = fixed(Quantity.POSITION, self.position) if is_free and angle_deg == 180.0 else ()
        return Stage(f"{angle_deg:g}°", (*position, *thrust))

    def _in_plane(self, angle_deg: float, minimum: float) -> tuple[Condition, ...]:
        """Return thrust conditions at an angle of the turn; unless `signed`, of free sign on diagonals."""
        diagonal = angle_deg % 360.0 in (self.ANGLES_DEG[0], self.ANGLES_DEG[-1])
        least = -inf if diagonal and not self.signed else minimum
        direction = so3.rotate(so3.about_axis(self.turn_axis, np.deg2rad(angle_deg)), UP)
        return thrust_in_plane(direction, self.turn_axis, least)

    def _min_thrust(self, angle_deg: float, max_specific_thrust: float) -> float:
        """Return the minimum specific thrust [m/s²] at an angle of the turn: upside down, or sideways."""
        thrust = self.min_inverted_thrust if _is_inverted(angle_deg) else self.min_lateral_thrust
        return thrust or THRUST_FRACTION * max_specific_thrust


def _is_inverted(angle_deg: float) -> bool:
    """Return True at an angle of the turns that is upside down rather than sideways."""
    return abs(angle_deg % 360.0 - 180.0) < 45.0


def _wrapped(angle_deg: float) -> float:
    """Return the angle between -180 and 180."""
    return round((angle_deg + 180.0) % 360.0 - 180.0, 6)


def _times(count: int) -> str:
    """Return the number of turns as words before their noun."""
    return {1: "", 2: "double ", 3: "triple "}.get(count, f"{count} turns of a ")
