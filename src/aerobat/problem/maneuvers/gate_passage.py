"""The passage through a gate, as maneuvers ask for it."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.declaration import NonNegative, declared
from aerobat.problem.condition import Condition, Quantity
from aerobat.problem.gate import Gate
from aerobat.problem.stage import (
    MIN_CROSSING_SPEED,
    CrossingPoint,
    CrossingTime,
    Stage,
    check_margin,
)


@declared
class GatePassage:
    """The manner in which a gate is passed, beyond meeting its opening.

    A `perpendicular` passage moves along the gate's direction of passage, at `speed` or faster, and not
    across it, so that a vehicle of some size fits through; one that stood still there could turn back. It is
    `upright` with the thrust axis along the gate's upright, within half its tolerance, where the maneuver
    asks for an attitude at all; otherwise only in the plane of the maneuver's turn, as in the paper.
    `centred` means that the gate is met by the fraction `at`, and otherwise one interval later, at the end of
    interval N/2, as in the authors' reference code; there the velocity is free. With a free `crossing_point`
    the opening is met anywhere, the vehicle's body and a `margin` away from its edges.
    """

    perpendicular: bool = True  # move along the gate's direction of passage and not across it
    speed: NonNegative = MIN_CROSSING_SPEED  # [m/s] at least, along the direction of passage
    at: CrossingTime = "free"  # when, as a part of the duration
    centred: bool = True  # at `at`; false: one interval later, as in the paper's code
    upright: bool = True  # the thrust axis along the gate's upright, not only in the plane of the turn
    crossing_point: CrossingPoint = "centre"  # of the opening: its centre, or free
    margin: NonNegative = 0.0  # [m] from the edges to the body, where the crossing point is free

    def __post_init__(self) -> None:
        """Check."""
        check_margin(self.crossing_point, self.margin)

    def stage(
        self, gate: Gate, conditions: Sequence[Condition] = (), min_thrust: float | None = None
    ) -> Stage:
        """The stage of passing `gate`.

        Args:
            gate: the gate that is met.
            conditions: what holds there in place of the gate's attitude, where the passage is not upright.
            min_thrust: least specific thrust [m/s²] along the gate's upright; None: no attitude is asked.
        """
        asked: list[Condition] = []
        if self.perpendicular:
            asked = [Condition(Quantity.VELOCITY, gate.normal, lower=self.speed)]
            asked += [Condition(Quantity.VELOCITY, axis, 0.0, 0.0) for axis in (gate.lateral, gate.up)]
        if not self.upright:
            asked += conditions
            min_thrust = None
        offset = 0 if self.centred else 1
        # how fast is among the conditions, or left free
        return Stage(
            gate.name,
            tuple(asked),
            self.at,
            offset,
            gate.name,
            min_thrust,
            min_speed=0.0,
            crossing_point=self.crossing_point,
            margin=self.margin,
        )


PAPER_PASSAGE = GatePassage(perpendicular=False, at=0.5, centred=False, upright=False)
PAPER_LATERAL = 18.0  # [m/s²] ε_y and ε_x of the authors' reference code
PAPER_INVERTED = 25.0  # [m/s²] ε_z of the authors' reference code
