"""The passage through a gate, as maneuvers require it."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.declaration import NonNegative, declared
from aerobat.errors import SpecError
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

    A `perpendicular` passage moves along the gate's direction of passage at `speed` or faster, without a
    lateral velocity, so that a vehicle with an extent fits through; at rest in the gate it could turn back.
    An `upright` passage has the thrust axis along the gate's upright, within a tenth of its tolerance, if the
    maneuver requires an attitude at all; otherwise only in the plane of the maneuver's turn, as in the paper.
    A `centred` passage is at the fraction `at`; otherwise it is one interval later, at the end of interval
    N/2, with free velocity, as in the authors' reference code. With a free `crossing_point` the opening is
    crossed anywhere, at a distance of the vehicle's body and a `margin` from its edges.
    """

    perpendicular: bool = True  # move along the gate's direction of passage and not across it
    speed: NonNegative = MIN_CROSSING_SPEED  # [m/s] at least, along the direction of passage
    at: CrossingTime = "free"  # when, as a part of the duration
    centred: bool = True  # at `at`; false: one interval later, as in the paper's code
    upright: bool = True  # the thrust axis along the gate's upright, not only in the plane of the turn
    crossing_point: CrossingPoint = "centre"  # of the opening: its centre, or free
    margin: NonNegative = 0.0  # [m] from the edges to the body, where the crossing point is free

    def __post_init__(self) -> None:
        """Check the margin."""
        check_margin(self.crossing_point, self.margin)

    def require_gate(self, gates: Sequence[Gate], maneuver: str) -> None:
        """Raise SpecError where a maneuver of this kind says how a gate is passed, and there is none."""
        if not gates and self not in (GatePassage(), PAPER_PASSAGE):
            raise SpecError(
                f"maneuver.passage needs a gate, and the {maneuver} has none; add one or drop passage"
            )

    def stage(
        self, gate: Gate, conditions: Sequence[Condition] = (), min_thrust: float | None = None
    ) -> Stage:
        """Return the stage of passing `gate`.

        Args:
            gate: the gate to pass.
            conditions: replace the gate's attitude if the passage is not upright.
            min_thrust: least specific thrust [m/s²] along the gate's upright; None: no attitude is required.
        """
        required: list[Condition] = []
        if self.perpendicular:
            required = [Condition(Quantity.VELOCITY, gate.normal, lower=self.speed)]
            required += [Condition(Quantity.VELOCITY, axis, 0.0, 0.0) for axis in (gate.lateral, gate.up)]
        if not self.upright:
            required += conditions
            min_thrust = None
        offset = 0 if self.centred else 1
        # the conditions contain the speed, or leave it free
        return Stage(
            gate.name,
            tuple(required),
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
