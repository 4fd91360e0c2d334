"""The result of planning: a trajectory that solves a problem, and the evidence for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import TypeVar

import numpy as np

from aerobat.certification import Certificate
from aerobat.declaration import PathName, by_value, in_notebooks, validated
from aerobat.planning.assessment.assessment import Assessment, SecondOpinion
from aerobat.planning.evidence import Evidence
from aerobat.planning.flyability import Flyability
from aerobat.planning.passages import PlacedStage, timed_stages
from aerobat.planning.recorder import Attempt, Progress
from aerobat.planning.rotor_margin import RotorMargin, reserve_shortfalls
from aerobat.planning.task import Task
from aerobat.planning.tube import Tube
from aerobat.problem.problem import Problem
from aerobat.simulation.autopilot import Recoveries
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# reserve of plans that are to be flown, as a fraction of every limit's range, by planners that otherwise use
# the whole range: with rotors without lag they would leave the controller nothing
FLYING_RESERVE = 0.15
KEPT_PART = 0.5  # part of that reserve that is kept where no plan keeps the whole
FLYING_CLEARANCE = 0.1  # clearance from obstacles of plans to be flown [m]: covers tracking errors under lab


@validated
@in_notebooks
@by_value
class Plan:
    """A trajectory that solves a problem, and the evidence for it."""

    problem: Problem
    trajectory: Trajectory
    planner: str  # the planner's registered name
    order: int | None = None  # the derivative of position that is the input, or is in the closed form's cost
    cost: float | None = None  # the minimized cost: Σ|u|², ∫|p⁽ˢ⁾|² dt, or the duration [s]
    status: str = "feasible"  # or optimal, time_limit (the best found by then), locally optimal, stopped
    backend: str = ""  # the solver
    stages: tuple[PlacedStage, ...] = ()
    attempts: tuple[Attempt, ...] = ()
    dt: float | None = None  # [s] of the intervals, where they are equal
    bound: float | None = None  # a proven lower bound on the cost of any solution at this dt
    gap: float | None = None  # (cost − bound) / cost
    vehicle: Vehicle | None = None  # the vehicle of the plan and its certificate
    recoveries: Recoveries | None = None  # to a hover, from instants along the path; None where not computed
    opinion: SecondOpinion | None = None  # another planner's answer; None where not asked
    rescue: str = ""  # how the plan was found, where the requested settings found none
    starts: tuple[float, ...] = ()  # [s] durations of the rough paths from several starts, ascending
    reserve: float = 0.0  # fraction of every limit's range that its planner was to keep from either end
    tube: Tube | None = None  # of simulated flights, where the plan was tightened until they pass
    evidence: Evidence | None = None  # for the plan's own path, vehicle and stages; None without a vehicle

    def __post_init__(self) -> None:
        own = None
        if self.vehicle is not None:
            own = Evidence(Task.of(self.problem, self.vehicle), self.trajectory, self.stages)
        if self.evidence != own:  # left over from another path by `replace`
            object.__setattr__(self, "evidence", own)

    @property
    def certificate(self) -> Certificate | None:
        """The proof for the vehicle, over continuous time; None without a vehicle."""
        return None if self.evidence is None else self.evidence.certificate

    @property
    def flyability(self) -> Flyability | None:
        """The findings of the plan's simulated flights; None without a vehicle."""
        return None if self.evidence is None else self.evidence.flyability

    @property
    def assessment(self) -> Assessment | None:
        """The assessment of the plan against what is possible and usual; None without a vehicle."""
        if self.evidence is None:
            return None
        return replace(self.evidence.assessment, opinion=self.opinion)

    def for_vehicle(self, vehicle: Vehicle) -> Plan:
        """Return the plan for another vehicle, without the results that were computed for the present one.

        Raises SpecError for a vehicle that its dead rotors leave without control.
        """
        vehicle = vehicle.without_dead_rotors()
        return replace(self, vehicle=vehicle, recoveries=None, opinion=None, tube=None)

    @property
    def duration(self) -> float:
        """The trajectory's duration [s]."""
        return self.trajectory.duration

    @property
    def certified(self) -> bool:
        """True if it is proven that the plan's vehicle can fly the trajectory within all limits."""
        return self.certificate is not None and self.certificate.certified

    @property
    def flies(self) -> bool:
        """True if the vehicle, simulated, tracks the path within FLYABLE_ERROR and passes gates as asked."""
        return self.flyability is not None and self.flyability.flies

    def keeps(self, reserve: float) -> bool:
        """Return whether the plan is certified and its rotors keep a fraction `reserve` of their ranges."""
        certificate = self.certificate
        return certificate is not None and self.certified and not reserve_shortfalls(certificate, reserve)

    @property
    def margin(self) -> RotorMargin | None:
        """The certificate's findings about rotors, in short; None without a vehicle."""
        return None if self.certificate is None else RotorMargin.of(self.certificate)

    @property
    def wants_second_opinion(self) -> bool:
        """True if the plan is suspicious and no other planner was asked.

        False for plans of time-optimal, and where a time limit ended the planning.
        """
        found = self.assessment
        is_open = self.planner != "time-optimal" and self.status != "time_limit"
        return found is not None and found.suspicious and self.opinion is None and is_open

    @property
    def spread(self) -> float | None:
        """The slowest start's duration relative to the fastest's, minus one [-]; None below two starts."""
        return self.starts[-1] / self.starts[0] - 1.0 if len(self.starts) > 1 else None

    @property
    def laps(self) -> tuple[float, ...]:
        """The times [s] at which laps end, of a closed course or of several laps; empty for other plans.

        A lap ends at its last stage. On a closed course each lap ends later, by the time from the last stage
        to the seam.
        """
        if len(self.problem.stages(1.0).stages) != len(self.stages):
            return ()
        in_time = sorted(self.stages, key=lambda place: place.time)
        ends = {stage.lap: time for stage, time in timed_stages(in_time, self.problem)}
        if self.problem.ends:
            return tuple(ends.values()) if len(ends) > 1 else ()
        to_seam = self.duration - max(ends.values())
        return tuple(end + to_seam for end in ends.values())

    @property
    def lap_times(self) -> tuple[float, ...]:
        """The durations [s] of laps; the first lap begins at the start."""
        return tuple(np.diff([0.0, *self.laps]).tolist())

    @property
    def intervals(self) -> int:
        """The trajectory's number of segments."""
        return self.trajectory.segments

    @property
    def pieces(self) -> str:
        """The number of the trajectory's segments in words; segments of equal duration are intervals."""
        one = "segment" if self.dt is None else "interval"
        return f"1 {one}" if self.intervals == 1 else f"{self.intervals} {one}s"

    @property
    def nodes(self) -> int:
        """The number of QPs solved, or of iterations, over all attempts."""
        return sum(attempt.nodes for attempt in self.attempts)

    @property
    def solve_time(self) -> float:
        """The time in the solver over all attempts [s]."""
        return sum(attempt.solve_time for attempt in self.attempts)

    @validated
    def save(self, path: PathName) -> None:
        """Write the plan as one file, completely or not at all; `load_plan` reads it back.

        Raises SpecError when the file cannot be written.
        """
        from aerobat.planning.plan_file import PlanRecord, write_plan_file

        facts = PlanRecord(**{field.name: getattr(self, field.name) for field in fields(PlanRecord)})
        write_plan_file(path, self.problem, self.trajectory, self.vehicle, facts)

    def __str__(self) -> str:
        """The plan's main results in one line."""
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
            f"{self.problem.name}: {self.duration:.3f} s in {self.pieces}{dt}, {self.status} by "
            f"{self.planner}{backend}; {stages}{margin}{proof}{flown}{given_up}{assessed}{rescue}{tube}"
        )


def reserve_kept(found: Plan, asked: float) -> float:
    """Return the reserve that a plan keeps: what was asked, the part that fallbacks keep of it, or none."""
    return next((part * asked for part in (1.0, KEPT_PART) if found.keeps(part * asked)), 0.0)


P = TypeVar("P")
PlanMethod = Callable[[P, Problem, Vehicle | None, Progress | None], Plan]  # the method `plan` of a planner P


@validated
def load_plan(path: PathName) -> Plan:
    """Return the plan that `Plan.save` wrote, exactly; its certificate and its flights are computed anew.

    Raises SpecError, one sentence, for any other file, a damaged or a changed one.
    """
    from aerobat.planning.plan_file import read_plan_file

    problem, trajectory, vehicle, facts = read_plan_file(path)
    return Plan(problem, trajectory, vehicle=vehicle, **facts)
