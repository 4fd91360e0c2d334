"""plan(): a problem in, a plan out, whichever the planner."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from aerobat.planning.miqp import Miqp
from aerobat.planning.proof import with_certificate
from aerobat.planning.result import Attempt, Plan
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle


class Planner(Protocol):
    """Whatever turns a problem into a plan."""

    def plan(
        self,
        problem: Problem,
        vehicle: Vehicle | None = None,
        progress: Callable[[Attempt], None] | None = None,
    ) -> Plan:
        """The plan, or Infeasible."""
        ...


def plan(
    problem: Problem,
    planner: Planner | None = None,
    vehicle: Vehicle | None = None,
    progress: Callable[[Attempt], None] | None = None,
) -> Plan:
    """Plan a problem, by default with `Miqp()`; with a vehicle, a plan for its rotors and its certificate.

    `progress` is called with every attempt as it ends. Raises Infeasible, whose message names the bound
    that binds and whose `attempts` hold the evidence, and SpecError for input that makes no sense.
    """
    if vehicle is not None:
        vehicle.require_hover(problem.environment.gravity)
    found = (planner or Miqp()).plan(problem, vehicle, progress)
    return found if vehicle is None or found.certificate is not None else with_certificate(found, vehicle)
