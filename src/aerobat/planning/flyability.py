"""A plan's own flights: the closed loop of its vehicle, simulated before the plan is returned.

A certificate proves that the rotors can follow a path. Whether the closed loop of controller and rotors
follows it, lag included, only a simulated flight shows. The nominal flight has the plan's vehicle and
environment, the default controller and no disturbances. It is judged at gates, frames included, and at
obstacles in the same way as scores judge flights.

In the disturbed flight all rotors give less thrust than commanded, by a fraction δ that uses up the margin
that the certificate proves. Losing the fraction δ of every rotor's thrust is equivalent to dividing mass,
inertia and drag by 1 − δ. So a vehicle with such values is simulated, while the controller keeps the nominal
one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import isinf, isnan, radians

from aerobat.certification.certificate import Certificate, Verdict
from aerobat.environment import Environment
from aerobat.flatness import has_unequal_drag
from aerobat.planning.passages import PlacedStage, planned_passages
from aerobat.planning.task import Task
from aerobat.simulation.config import FlightConfig
from aerobat.simulation.flight import Flight
from aerobat.simulation.fly import fly
from aerobat.simulation.outcome import DIVERGENCE_RADIUS, Outcome, length
from aerobat.simulation.passages.log import log_rows, passages_in_log
from aerobat.simulation.passages.obstacles import NearestObstacle, nearest_in_log
from aerobat.simulation.passages.passage import Passage
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

FLYABLE_ERROR = 0.05  # largest tracking error of a plan's own flight [m]: the usual clearance from a frame


@dataclass(frozen=True)
class FlownPassage:
    """A gate in a plan's own flight."""

    gate: str
    attitude_error: float | None  # [rad] of the thrust axis, from the required one; None: not crossed
    attitude_tolerance: float | None  # [rad] largest error allowed; None where no attitude is asked
    failure: str = ""  # the failure in words; empty where the gate was passed as asked
    clearance: float | None = None  # [m] least distance between body and frame; None: not crossed

    @property
    def is_missed(self) -> bool:
        """True if the gate is not crossed, not crossed completely, or its frame is touched."""
        return bool(self.failure) and (self.clearance is None or self.clearance < 0.0)


@dataclass(frozen=True, kw_only=True)
class OwnFlight:
    """A plan's nominal flight: the simulated closed loop without disturbances."""

    error: float  # [m] largest tracking error of position, 5 m or more where the flight diverges
    passages: tuple[FlownPassage, ...] = ()  # the planned passages, in order
    nearest: NearestObstacle | None = None  # None where there are no obstacles

    @property
    def flies(self) -> bool:
        """True if the flight tracks within FLYABLE_ERROR, passes gates as asked and hits nothing."""
        return not self.defects

    @property
    def misses_gate(self) -> bool:
        """True if the flight misses a gate: not crossed completely, or with its frame touched."""
        return any(passage.is_missed for passage in self.passages)

    @property
    def wants_reserve(self) -> bool:
        """True if there is a defect other than missed gates, which a larger reserve may repair."""
        return len(self.defects) > sum(passage.is_missed for passage in self.passages)

    @property
    def rank(self) -> tuple[int, float]:
        """The sort key of flights, smallest is best: the number of defects, then the tracking error [m]."""
        return len(self.defects), self.error

    @property
    def defects(self) -> tuple[str, ...]:
        """All defects of the flight, in words."""
        failed = tuple(passage.failure for passage in self.passages if passage.failure)
        if self.nearest is not None and self.nearest.failure is not None:
            failed = (*failed, self.nearest.failure.sentence())
        if self.error <= FLYABLE_ERROR:
            return failed
        allowed = f"{100 * FLYABLE_ERROR:g} cm at most allowed"
        return (f"leaves the path by {length(self.error)}, {allowed}", *failed)


@dataclass(frozen=True, kw_only=True)
class Flyability(OwnFlight):
    """A plan's own flights: the nominal one, and one with the reserve used up.

    The disturbance is the margin of thrust that the certificate proves at every instant. In the disturbed
    flight all rotors lose the corresponding fraction of their thrust, which their margins cover.
    """

    disturbance: float  # [N] proven margin of every rotor's thrust; 0 where there is none
    disturbed_fraction: float  # [-] the disturbance over the largest thrust of a rotor
    disturbed_error: float  # [m] largest tracking error where all rotors lose that fraction of their thrust
    tilted_by_drag: bool = False  # whether the path misses a gate's attitude, as drag differs along x and y

    @property
    def diverges_disturbed(self) -> bool:
        """True if the disturbed flight diverges: its error is then where it was given up."""
        return self.disturbed_error >= DIVERGENCE_RADIUS

    @property
    def remedy(self) -> str:
        """The remedies that may mend the plan's defects, in words; empty where there are none."""
        if self.tilted_by_drag:
            return (
                "drag differs along body x and y, and attitudes in gates are planned for the mean of it: "
                "allow the gates more attitude_tolerance_deg"
            )
        found = []
        if self.misses_gate:
            found.append("ask more speed of the passage or widen the opening")
        if self.wants_reserve:
            found.append("keep more reserve for the controller")
        return ", ".join([*found, "or take another planner"]) if found else ""

    def __str__(self) -> str:
        """The finding in a sentence without its full stop."""
        if self.defects:
            found = " and ".join(self.defects)
            return (
                f"not flyable: its own flight {found}, a defect of the plan, not of the flight; {self.remedy}"
            )
        if not self.disturbance:
            return f"flies within {length(self.error)}, with no reserve left"
        disturbed = "it diverges" if self.diverges_disturbed else f"within {length(self.disturbed_error)}"
        return (
            f"flies within {length(self.error)}; the reserve left, {self.disturbance:.2g} N, is "
            f"{100 * self.disturbed_fraction:.2g} % of a rotor's thrust: with as much less from all rotors "
            f"{disturbed}"
        )


def own_flight(task: Task, trajectory: Trajectory, stages: Sequence[PlacedStage]) -> OwnFlight:
    """Return the findings of the nominal flight of a path with placed stages."""
    flight = nominal_flight(trajectory, task.vehicle, task.environment)
    states = flight.states
    rows = log_rows(flight.times, states.position, states.velocity, states.q_world_body)
    planned, body = planned_passages(stages, task.problem), task.vehicle.bounding_ellipsoid
    flown = passages_in_log(rows, planned, body, flight.diverged_at)
    return OwnFlight(
        error=_largest_error(flight),
        passages=tuple(_flown(passage.of_flight(0)) for passage in flown),
        nearest=nearest_in_log(
            task.environment.pieces, flight.times, states.position, states.q_world_body, body
        ),
    )


def _flown(passage: Passage) -> FlownPassage:
    error, tolerance = radians(passage.attitude_error_deg), radians(passage.attitude_tolerance_deg)
    return FlownPassage(
        gate=passage.gate,
        attitude_error=None if isnan(error) else error,
        attitude_tolerance=None if isinf(tolerance) else tolerance,
        failure="" if passage.failure is None else passage.failure.sentence(),
        clearance=None if isnan(passage.clearance) else passage.clearance,
    )


def own_flights(
    task: Task, trajectory: Trajectory, stages: Sequence[PlacedStage], certificate: Certificate
) -> Flyability:
    """Fly a path twice: nominally, and with the rotors' reserve used up.

    Args:
        task: The task, with vehicle and environment.
        trajectory: The path that is flown.
        stages: The placed stages.
        certificate: The path's certificate; its proven margin of the rotors is the disturbance.
    """
    disturbance = max(certificate.margin or 0.0, 0.0)
    fraction = disturbance / float(task.vehicle.max_thrusts.max())
    nominal = own_flight(task, trajectory, stages)
    disturbed = disturbed_flight(trajectory, task.vehicle, task.environment, fraction)
    return Flyability(
        **vars(nominal),
        disturbance=disturbance,
        disturbed_fraction=fraction,
        disturbed_error=_largest_error(disturbed),
        tilted_by_drag=has_unequal_drag(task.vehicle) and _is_tilted(certificate),
    )


def _is_tilted(certificate: Certificate) -> bool:
    """Return whether the path itself, whatever its flight, misses the attitude of a gate."""
    attitudes = (finding for finding in certificate.findings if finding.name == "attitude")
    return any(finding.verdict is Verdict.VIOLATED for finding in attitudes)


@lru_cache(maxsize=2)
def nominal_flight(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> Flight:
    """Return the flight of a path by default settings, without disturbances; the latest two are cached."""
    return fly(trajectory, vehicle, environment=environment)


def disturbed_flight(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment, fraction: float
) -> Flight:
    """Return the flight of a vehicle whose rotors all lose a fraction of their thrust.

    Args:
        trajectory: The path [m] over time [s], world.
        vehicle: The nominal vehicle, which the controller knows.
        environment: The environment of the flight.
        fraction: The fraction of every rotor's thrust that is lost [-], below 1.
    """
    factor = 1.0 / (1.0 - fraction)
    weak = replace(
        vehicle,
        mass=factor * vehicle.mass,
        inertia=factor * vehicle.inertia,
        drag_body=factor * vehicle.drag_body,
    )
    return fly(trajectory, weak, environment=environment, config=FlightConfig(nominal=vehicle))


def _largest_error(flight: Flight) -> float:
    error = float(flight.position_error.max())
    return error if flight.outcome is Outcome.COMPLETE else max(error, DIVERGENCE_RADIUS)
