"""A certified path whose own flight has a defect, mended: straighter through the gate, or with a reserve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.flyability import OwnFlight, own_flight
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.miqp.refinement import PathProgram, descent, finished
from aerobat.planning.ways import Way, straightened, straighter
from aerobat.problem.stage import Stage

MAX_HALVINGS = 3  # of how straight a way is, where it leads to no path
RESERVES = (0.02, 0.05, 0.1, 0.2)  # of the rotors' ranges, for paths that leave the controller too little


@dataclass(frozen=True, eq=False)
class _Mended:
    """A certified path on ways through gates."""

    attempts: Attempts
    judged: Judged[Placement]
    program: PathProgram  # without ways
    ways: tuple[Way, ...] = ()

    @property
    def flight(self) -> OwnFlight:
        """Its own."""
        trajectory, vehicle = self.judged.solution.trajectory, self.attempts.vehicle
        assert vehicle is not None
        assert trajectory is not None
        placed = self.attempts.placed(self.judged)
        return own_flight(trajectory, vehicle, self.attempts.formulation.problem, placed)

    def straighter(self, flight: OwnFlight) -> _Mended | None:
        """The path, straighter through the gates that a flight did not pass; None where none is found."""
        formulation, vehicle = self.attempts.formulation, self.attempts.vehicle
        assert vehicle is not None
        ways = straighter(self.ways, formulation.sequence.stages, formulation.problem, vehicle, flight)
        for _ in range(MAX_HALVINGS if ways != self.ways else 0):
            again = replace(self, ways=ways)._refined()
            if again is not None or out_of_time():
                return again
            ways = self._halfway_to(ways)
        return None

    def _halfway_to(self, ways: Sequence[Way]) -> tuple[Way, ...]:
        """Ways between its own, of which those that there are not yet bend by nothing, and others."""
        bending = {way.stage: way.bending for way in self.ways}
        return tuple(replace(way, bending=0.5 * (way.bending + bending.get(way.stage, 0.0))) for way in ways)

    def with_reserve(self, reserve: float) -> _Mended | None:
        """The path with a reserve kept for the controller; None where none is found."""
        kept = max(reserve, self.program.reserve)
        return replace(self, program=replace(self.program, reserve=kept))._refined()

    def _refined(self) -> _Mended | None:
        """The path refined to its program and ways; None where that leads to none that is certified."""
        source = self.judged.solution.source
        assert source.path is not None
        found = descent(self._program_on_ways(), source.path.x).path
        if found is None:
            return None
        judged = self.attempts.refined(source, partial(finished, found))
        return replace(self, judged=judged) if judged.feasible else None

    def _program_on_ways(self) -> PathProgram:
        """The program with what the ways ask of a path that crosses their gates much as this one does."""
        sequence = self.program.formulation.sequence
        stages = list(sequence.stages)
        for way in self.ways:
            stages[way.stage] = self._on_way(stages[way.stage], way)
        formulation = replace(self.program.formulation, sequence=replace(sequence, stages=tuple(stages)))
        return replace(self.program, formulation=formulation)

    def _on_way(self, stage: Stage, way: Way) -> Stage:
        trajectory, vehicle = self.judged.solution.trajectory, self.attempts.vehicle
        assert vehicle is not None
        assert trajectory is not None
        time = self.attempts.placed(self.judged)[way.stage].time
        position, velocity, acceleration = (trajectory.evaluate(time, k) for k in range(3))
        thrust = self.attempts.formulation.balance.specific_thrust(velocity, acceleration)
        asked = way.conditions(position, velocity, thrust, vehicle.bounding_ellipsoid)
        return replace(stage, conditions=(*stage.conditions, *asked))


def flyable(attempts: Attempts, judged: Judged[Placement]) -> Judged[Placement]:
    """The same, or where its own flight has a defect a slower one without, if there is.

    A path that lingers in its gate, or turns back there, is made straighter there, any other gets a reserve
    for the controller.
    """
    path = judged.solution.source.path
    if path is None:
        return judged
    mended = _Mended(attempts, judged, path.program)
    best = flight, mended = straightened(mended, lambda found: found.flight, _Mended.straighter)
    for reserve in RESERVES:
        if not flight.wants_reserve or out_of_time():
            break
        again = mended.with_reserve(reserve)
        if again is not None:
            flight, mended = again.flight, again
            best = min(best, (flight, mended), key=lambda pair: pair[0].rank)
    return best[1].judged
