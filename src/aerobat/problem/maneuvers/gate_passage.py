"""The passage through a gate, as maneuvers ask for it."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.declaration import NonNegative, declared
from aerobat.problem.gate import Gate, at_centre
from aerobat.problem.stage import Condition, Quantity, Stage


@declared
class GatePassage:
    """The manner in which a gate is passed, beyond meeting its centre.

    A `perpendicular` passage moves along the gate's direction of passage, at `speed` or faster, and not
    across it, so that a vehicle of some size fits through. The gate is met at half the duration when
    `centred`, and otherwise one interval later, at the end of interval N/2, as in the authors' reference
    code; there the velocity is free.
    """

    perpendicular: bool = True  # move along the gate's direction of passage and not across it
    speed: NonNegative = 0.0  # [m/s] at least, along the direction of passage
    centred: bool = True  # at half the duration; false: one interval later, as in the paper's code

    def stage(self, gate: Gate, conditions: Sequence[Condition]) -> Stage:
        """The stage of passing `gate` with `conditions` on top."""
        velocity: list[Condition] = []
        if self.perpendicular:
            velocity = [Condition(Quantity.VELOCITY, gate.normal, lower=self.speed)]
            velocity += [Condition(Quantity.VELOCITY, across, 0.0, 0.0) for across in (gate.lateral, gate.up)]
        asked = (*at_centre(gate), *velocity, *conditions)
        return Stage(gate.name, asked, at=0.5, interval_offset=0 if self.centred else 1, gate=gate.name)


PAPER_PASSAGE = GatePassage(perpendicular=False, centred=False)
PAPER_LATERAL = 18.0  # [m/s²] ε_y and ε_x of the authors' reference code
PAPER_INVERTED = 25.0  # [m/s²] ε_z of the authors' reference code
