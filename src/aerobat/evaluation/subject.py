"""The subject of a figure, a video or a replay: a plan, or flights with the plan that they follow."""

from __future__ import annotations

from dataclasses import dataclass

from aerobat.environment import Environment
from aerobat.environment.obstacles import ConvexPiece
from aerobat.errors import SpecError
from aerobat.flatness import vehicle_of
from aerobat.planning import PlacedStage, Plan
from aerobat.problem import Gate
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle, as_vehicle


@dataclass(frozen=True, eq=False)
class Subject:
    """A plan that is not flown, or a flight or a batch, with its plan where that is known."""

    shown: Plan | Flight
    plan: Plan | None
    vehicle: Vehicle

    @property
    def name(self) -> str:
        """The name of the problem, or "flight" where the plan is not known."""
        return "flight" if self.plan is None else self.plan.problem.name

    @property
    def gates(self) -> tuple[Gate, ...]:
        """The gates of the plan's problem."""
        return () if self.plan is None else self.plan.problem.gates

    @property
    def stages(self) -> tuple[PlacedStage, ...]:
        """The stages of the plan."""
        return () if self.plan is None else self.plan.stages

    @property
    def environment(self) -> Environment:
        """The environment of the flight; of a plan that is not flown that of its problem."""
        shown = self.shown
        return shown.problem.environment if isinstance(shown, Plan) else shown.environment

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The parts of obstacles, of the walls of a plan's gates too."""
        surroundings = self.environment if self.plan is None else self.plan.problem.surroundings
        return surroundings.pieces.pieces


def subject_of(shown: Plan | Flight, plan: Plan | None, vehicle: Vehicle | str | None) -> Subject:
    """Return the subject of a plan, or of flights.

    Raise SpecError for a batch without flights, and where the vehicle is not known.

    Args:
        shown: What is shown.
        plan: What was flown.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
    """
    if isinstance(shown, Plan):
        return Subject(shown, shown, vehicle_of(shown, vehicle))
    if not shown.vehicles:
        raise SpecError(
            "the batch holds no flights, so that there is nothing to show; fly one vehicle or more"
        )
    return Subject(shown, plan, as_vehicle(vehicle or (plan and plan.vehicle) or shown.vehicles[0]))
