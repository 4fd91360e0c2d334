"""Quantities with a minimum that a problem needs: how to read, set and bound each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import ClassVar

import numpy as np

from aerobat.declaration import unknown_name
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.problem import Problem
from aerobat.studies.lens import Scenario, lens


class NeededQuantity:
    """A quantity whose reduction makes a scenario harder."""

    name: ClassVar[str]
    field: ClassVar[str] = ""  # of a scenario, which has the quantity; empty where no single field has it
    unit: ClassVar[str] = ""
    least_size: ClassVar[float] = 0.0  # above the floor; steps and tolerances treat smaller sizes as this
    by_default: ClassVar[bool] = True  # whether it is searched by default

    def own(self, scenario: Scenario) -> float:
        """Return the scenario's value, infinite where it has no bound."""
        return float(lens(self.field, scenario).get(scenario))

    def set(self, whole: Scenario, value: float) -> Scenario:
        """Return the scenario with this value. Raises SpecError where the value contradicts the rest."""
        return lens(self.field, whole).set(whole, value)

    def floor(self, scenario: Scenario) -> float:
        """Return the lowest value worth trying, from which growth and tolerance are measured."""
        return 0.0

    def used(self, plan: Plan) -> float:
        """Return the value that a plan needs; infinite where the plan does not tell."""
        return inf


class ThrustToWeight(NeededQuantity):
    """Full thrust of all rotors over the weight on Earth; rotors keep their relative strengths."""

    name = "thrust-to-weight"
    field = "vehicle.thrust_to_weight"


class Ceiling(NeededQuantity):
    """The height that the path stays below."""

    name = "ceiling"
    field = "limits.upper.z"
    unit = "m"
    least_size = 1.0

    def floor(self, scenario: Scenario) -> float:
        """Return the height of the highest of start, goal and gates."""
        problem = scenario.problem
        points = [problem.start.position, problem.goal.position, *(gate.position for gate in problem.gates)]
        return float(np.max([point[2] for point in points]))

    def used(self, plan: Plan) -> float:
        """Return the height of the plan's highest point."""
        return float(plan.trajectory.component_range(0)[1][2])


class GateSize(NeededQuantity):
    """The openings of all gates, as fractions of their sizes."""

    name = "gate"
    unit = "of its size"
    keeps_width: ClassVar[bool] = False

    def own(self, scenario: Scenario) -> float:
        """Return 1. Raises SpecError where there is no gate."""
        if not scenario.problem.gates:
            raise SpecError(f"'{scenario.problem.name}' has no gate that could be smaller; leave gate out")
        return 1.0

    def set(self, whole: Scenario, value: float) -> Scenario:
        """Return the scenario with openings scaled by this fraction, circles as a whole."""
        across = 1.0 if self.keeps_width else value
        gates = tuple(gate.resized(across, value) for gate in whole.problem.gates)
        return replace(whole, problem=replace(whole.problem, gates=gates))


class GateHeight(GateSize):
    """The heights of all gates' openings, as fractions of their heights: how narrow a slit may be."""

    name = "gate-height"
    unit = "of its height"
    keeps_width = True
    by_default = False


QUANTITIES: dict[str, NeededQuantity] = {
    each.name: each for each in (ThrustToWeight(), Ceiling(), GateSize(), GateHeight())
}


def named_quantities(names: Sequence[str] | None, problem: Problem) -> tuple[NeededQuantity, ...]:
    """Return the quantities of these names, by default all of a problem. Raises SpecError for others."""
    if names is None:
        usual = (each for each in QUANTITIES.values() if each.by_default)
        return tuple(each for each in usual if problem.gates or not isinstance(each, GateSize))
    for i, name in enumerate(names):
        if name not in QUANTITIES:
            raise unknown_name("quantity", name, QUANTITIES)
        if name in names[:i]:
            raise SpecError(f"of: {name} is named twice; name it once")
    if not names:
        raise SpecError("of must name one quantity or more; leave it out for all")
    return tuple(QUANTITIES[name] for name in names)
