"""What planning returns: a trajectory that solves a problem, and the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.certification import Certificate
from aerobat.declaration import PathName, by_value, in_notebooks, short, validated
from aerobat.planning.assessment.assessment import Assessment
from aerobat.planning.recorder import Attempt
from aerobat.planning.rotor_margin import RotorMargin
from aerobat.planning.tube import Tube
from aerobat.problem.problem import Problem
from aerobat.simulation.autopilot import Recoveries
from aerobat.simulation.outcome import length
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@dataclass(frozen=True)
class PlacedStage:
    """Where a stage ended up."""

    name: str
    interval: int  # counted from 0; the stage holds at its end
    time: float  # [s]
    gate: str | None = None  # the name of the gate that is passed there


# of every limit's range, kept from either end for the controller by planners that use all of it, where a
# plan shall be flown: rotors without lag leave it nothing otherwise
FLYING_RESERVE = 0.03
FLYABLE_ERROR = 0.05  # [m] that a plan's own flight may leave its path by, a frame's usual clearance


@dataclass(frozen=True)
class FlownPassage:
    """A gate in a plan's own flight."""

    gate: str
    attitude_error: float | None  # [rad] between the thrust axis and where it shall point; None: not crossed
    attitude_tolerance: float | None  # [rad] that is allowed; None where no attitude is asked
    failure: str = ""  # what went wrong, in words; empty where it was passed as asked
    clearance: float | None = None  # [m] the least between body and frame; None: not crossed

    @property
    def is_missed(self) -> bool:
        """True where the gate is not crossed, or not as far as counts, or its frame is touched."""
        return bool(self.failure) and (self.clearance is None or self.clearance < 0.0)


@dataclass(frozen=True, kw_only=True)
class OwnFlight:
    """A plan's own nominal flight: the simulated closed loop, nothing unknown."""

    error: float  # [m] the largest position error, 5 m or more where it diverges
    passages: tuple[FlownPassage, ...] = ()  # the planned ones, in their order

    @property
    def flies(self) -> bool:
        """True if it stays within FLYABLE_ERROR of the path and passes the gates as they ask."""
        return not self.defects

    @property
    def lingers(self) -> bool:
        """True if it does not pass the plane of a gate, or not as far as counts, or touches the frame."""
        return any(passage.is_missed for passage in self.passages)

    @property
    def wants_reserve(self) -> bool:
        """True if it has a defect that more reserve for the controller may mend: any but a gate missed."""
        return len(self.defects) > sum(passage.is_missed for passage in self.passages)

    @property
    def rank(self) -> tuple[int, float]:
        """The number of defects, and the error [m]: the better of two flights has the lesser."""
        return len(self.defects), self.error

    @property
    def defects(self) -> tuple[str, ...]:
        """All that it does wrong, in words."""
        failed = tuple(passage.failure for passage in self.passages if passage.failure)
        if self.error <= FLYABLE_ERROR:
            return failed
        allowed = f"{100 * FLYABLE_ERROR:g} cm at most allowed"
        return (f"leaves the path by {length(self.error)}, {allowed}", *failed)


@dataclass(frozen=True, kw_only=True)
class Flyability(OwnFlight):
    """A plan's own flights: the nominal one, and one with the reserve used up.

    The disturbance is the largest that the rotors' reserve buys at every instant: all rotors give less than
    commanded by a fraction of it, of which no rotor's limit need take notice.
    """

    disturbance: float  # [N] by which every rotor may miss its thrust; 0 where nothing is left
    disturbed_fraction: float  # [-] the same over the largest thrust of a rotor
    disturbed_error: float  # [m] the largest position error where all rotors give less by that fraction

    @property
    def remedy(self) -> str:
        """What may mend its defects, in words; empty where there are none."""
        found = []
        if self.lingers:
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
        return (
            f"flies within {length(self.error)}; the reserve left, {self.disturbance:.2g} N, is "
            f"{100 * self.disturbed_fraction:.2g} % of a rotor's thrust: with as much less from all rotors "
            f"within {length(self.disturbed_error)}"
        )


@validated
@in_notebooks
@short
@by_value
@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """A trajectory that solves a problem, and the evidence for it."""

    problem: Problem
    trajectory: Trajectory
    planner: str  # its registered name
    order: int | None = None  # of the derivative of position that is the input, or the closed form's cost
    cost: float | None = None  # what the planner minimizes: Σ|u|², ∫|p⁽ˢ⁾|² dt, or the duration [s]
    status: str = "feasible"  # or optimal, time_limit (the best found by then), locally optimal, stopped
    backend: str = ""  # what solved it
    stages: tuple[PlacedStage, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    dt: float | None = None  # [s] of the intervals, where they are equal
    bound: float | None = None  # the cost of any solution at this dt is at least this, proven
    gap: float | None = None  # (cost − bound) / cost
    vehicle: Vehicle | None = None  # what it was planned or certified for
    certificate: Certificate | None = None  # for the vehicle, over continuous time
    flyability: Flyability | None = None  # of the vehicle's own flight, simulated
    recoveries: Recoveries | None = None  # to a hover, from instants all along it; None where none is known
    assessment: Assessment | None = None  # beside what is possible and usual, for the vehicle
    rescue: str = ""  # what found it, where what was asked for found nothing
    starts: tuple[float, ...] = ()  # [s] that first, coarse solves from several starts came to, rising
    tube: Tube | None = None  # of its flights, where it was tightened until they pass

    @property
    def duration(self) -> float:
        """The trajectory's duration [s]."""
        return self.trajectory.duration

    @property
    def certified(self) -> bool:
        """True if it is proven that its vehicle can fly it within all limits."""
        return self.certificate is not None and self.certificate.certified

    @property
    def flies(self) -> bool:
        """True if its vehicle, simulated, keeps to it within FLYABLE_ERROR and passes its gates as asked."""
        return self.flyability is not None and self.flyability.flies

    @property
    def margin(self) -> RotorMargin | None:
        """The certificate's findings about rotors, in short; None without a vehicle."""
        return None if self.certificate is None else RotorMargin.of(self.certificate)

    @property
    def wants_second_opinion(self) -> bool:
        """True if it is suspicious and no other planner was asked yet; one that a limit ended has no time."""
        found = self.assessment
        is_open = self.planner != "time-optimal" and self.status != "time_limit"
        return found is not None and found.suspicious and found.opinion is None and is_open

    @property
    def spread(self) -> float | None:
        """By how much more the slowest start came to than the fastest [-]; None of fewer than two."""
        return self.starts[-1] / self.starts[0] - 1.0 if len(self.starts) > 1 else None

    @property
    def laps(self) -> tuple[float, ...]:
        """The times [s] at which laps end, of a closed course or one of several.

        They end with their last stages, those of a closed course as long after that as it is to the seam.
        """
        stages = self.problem.stages(1.0).stages
        if len(stages) != len(self.stages):
            return ()
        ends = {stage.lap: place.time for stage, place in zip(stages, self.stages, strict=True)}
        if self.problem.ends:
            return tuple(ends.values()) if len(ends) > 1 else ()
        to_seam = self.duration - max(ends.values())
        return tuple(end + to_seam for end in ends.values())

    @property
    def lap_times(self) -> tuple[float, ...]:
        """The durations [s] of laps, the first since the start."""
        return tuple(np.diff([0.0, *self.laps]).tolist())

    @property
    def intervals(self) -> int:
        """The trajectory's number of segments."""
        return self.trajectory.segments

    @property
    def nodes(self) -> int:
        """QPs solved, or iterations, over all attempts."""
        return sum(attempt.nodes for attempt in self.attempts)

    @property
    def solve_time(self) -> float:
        """Time in the solver over all attempts [s]."""
        return sum(attempt.solve_time for attempt in self.attempts)

    @validated
    def save(self, path: PathName) -> None:
        """Write the whole plan as one file, whole or not at all; `load_plan` reads it back.

        Raises SpecError when the file cannot be written.
        """
        from aerobat.planning.plan_file import save_plan

        save_plan(self, path)

    def __str__(self) -> str:
        """One line for people."""
        stages = ", ".join(f"{s.name} at {s.time:.2f} s" for s in self.stages) or "no stages"
        margin = "" if self.margin is None else f"; rotors {self.margin}"
        proof = "" if self.certificate is None else f"; {self.certificate}"
        flown = "" if self.flyability is None else f"; {self.flyability}"
        given_up = "" if self.recoveries is None else f"; {self.recoveries}"
        assessed = "" if self.assessment is None else f"; {self.assessment}"
        rescue = f"; {self.rescue}" if self.rescue else ""
        tube = "" if self.tube is None else f"; {self.tube}"
        dt = "" if self.dt is None else f" of {self.dt:.4f} s"
        backend = f" ({self.backend})" if self.backend else ""
        return (
            f"{self.problem.name}: {self.duration:.3f} s in {self.intervals} intervals{dt}, {self.status} by "
            f"{self.planner}{backend}; {stages}{margin}{proof}{flown}{given_up}{assessed}{rescue}{tube}"
        )
