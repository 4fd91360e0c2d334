"""Elements of courses other than figures: a gate, a waypoint, a hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerobat.declaration import NonNegative, Positive, Vector3
from aerobat.problem.condition import THRUST_FRACTION, Quantity, fixed
from aerobat.problem.gate import Gate, passed_gate
from aerobat.problem.maneuvers.maneuver import Maneuver, gate_in_words, maneuver
from aerobat.problem.maneuvers.waypoints import Waypoint
from aerobat.problem.stage import MIN_CROSSING_SPEED, CrossingPoint, Stage, StageSequence, check_margin


@maneuver("gate")
class PassGate(Maneuver):
    """Through a gate, at its centre or anywhere; `upright` with the thrust along its upright."""

    gate: str | None = None  # its name; left out, the only one
    crossing_point: CrossingPoint = "centre"  # of the opening: its centre, or free
    margin: NonNegative = 0.0  # [m] from the edges to the body, where the crossing point is free
    speed: NonNegative = MIN_CROSSING_SPEED  # [m/s] at least, along the direction of passage
    upright: bool = False  # the thrust axis along the gate's upright, within a tenth of its tolerance
    # least specific thrust along it; left out, 20 % of what the vehicle has
    min_thrust: Positive | None = None  # [m/s²]

    def __post_init__(self) -> None:
        """Check."""
        check_margin(self.crossing_point, self.margin)

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage, the gate. Raises SpecError where it names none of several gates."""
        gate = passed_gate(gates, self.gate, self.kind)
        thrust = (self.min_thrust or THRUST_FRACTION * max_specific_thrust) if self.upright else None
        stage = Stage(
            gate.name,
            gate=gate.name,
            min_upright_thrust=thrust,
            min_speed=self.speed,
            crossing_point=self.crossing_point,
            margin=self.margin,
        )
        return StageSequence((stage,))

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the gate that is passed."""
        return f"through {gate_in_words(passed_gate(gates, self.gate, self.kind).name)}"

    @property
    def through_points(self) -> bool:
        """True where no attitude is required."""
        return not self.upright


@maneuver("waypoint")
class PassWaypoint(Waypoint, Maneuver):
    """By one waypoint, with as many components given as one likes."""

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage."""
        return StageSequence((self.stage("waypoint", max_specific_thrust),))

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the waypoint, or its gate."""
        return self.in_passing

    @property
    def through_points(self) -> bool:
        """True: the maneuver is a waypoint."""
        return True


@maneuver("hold")
class Hold(Maneuver):
    """At rest at a place for a time; what comes before it and what comes after are planned by themselves."""

    position: Vector3  # [m] world
    time: Positive  # [s]

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return one stage."""
        still = fixed(Quantity.VELOCITY, np.zeros(3))
        position = fixed(Quantity.POSITION, self.position)
        return StageSequence((Stage(self.kind, (*position, *still), hold=self.time),))

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the duration of the hold in words."""
        return f"hold for {self.time:g} s"
