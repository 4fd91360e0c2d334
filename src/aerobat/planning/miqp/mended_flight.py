"""A certified path whose own flight has a defect, mended: faster through the gate, or with a reserve.

Remedies grow until one mends it. What the last of them asks too much is then given back by halves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import inf, sqrt

from aerobat.optimization.deadline import out_of_time
from aerobat.planning.certified_solve import Judged
from aerobat.planning.flyability import own_flight
from aerobat.planning.miqp.attempts import Attempts, Placement
from aerobat.planning.miqp.refinement import PathProgram, descent, finished
from aerobat.planning.result import OwnFlight
from aerobat.problem.condition import Condition, Quantity

FASTER = 1.3  # times as fast through gates, of paths that turn back in them
RESERVES = (0.02, 0.05, 0.1, 0.2)  # of the rotors' ranges, for paths that leave the controller too little
DEAR = 1.005  # of a mended path's duration over that of one not mended: worth another try between them
MAX_HALVINGS = 4  # of a remedy


@dataclass(frozen=True)
class _Remedy:
    """What is asked beyond the problem."""

    speed: float = 1.0  # factor on the speeds asked of passages
    reserve: float = 0.0  # of the rotors' ranges

    def halfway_to(self, weaker: _Remedy) -> _Remedy:
        """The remedy half-way to a weaker one."""
        return _Remedy(sqrt(self.speed * weaker.speed), 0.5 * (self.reserve + weaker.reserve))

    def applied(self, program: PathProgram) -> PathProgram:
        """The program that asks it too."""
        formulation = program.formulation
        stages = tuple(
            stage
            if stage.gate is None
            else replace(stage, conditions=tuple(map(self._hastened, stage.conditions)))
            for stage in formulation.sequence.stages
        )
        sequence = replace(formulation.sequence, stages=stages)
        return replace(
            program,
            formulation=replace(formulation, sequence=sequence),
            reserve=max(self.reserve, program.reserve),
        )

    def _hastened(self, condition: Condition) -> Condition:
        asks_speed = (
            condition.quantity is Quantity.VELOCITY and condition.lower > 0.0 and condition.upper == inf
        )
        return replace(condition, lower=self.speed * condition.lower) if asks_speed else condition


@dataclass(frozen=True, eq=False)
class _Tried:
    """A certified path, with the remedy that it was made with and its own flight."""

    judged: Judged[Placement]
    own: OwnFlight
    remedy: _Remedy

    @property
    def duration(self) -> float:
        """[s]."""
        return self.judged.solution.duration


def flyable(attempts: Attempts, judged: Judged[Placement]) -> Judged[Placement]:
    """The same, or where its own flight has a defect a slower one without, if there is.

    A path that lingers in its gate, or turns back there, gets more speed there, any other a reserve for the
    controller.
    """
    path = judged.solution.source.path
    last = best = _Tried(judged, _own_flight(attempts, judged), _Remedy())
    if path is None:
        return judged
    remedy = last.remedy
    for lesser, reserve in pairwise((0.0, *RESERVES)):
        if last.own.flies or out_of_time():
            break
        lingers = last.own.lingers
        remedy = _Remedy(
            remedy.speed * FASTER if lingers else remedy.speed,
            max(lesser if lingers else reserve, remedy.reserve),
        )
        mended = _mended(attempts, path.program, last, remedy)
        if mended is not None:
            failing, last = last, mended
            best = min(best, last, key=lambda tried: tried.own.rank)
    if not best.own.flies or best.judged is judged:
        return best.judged
    return _quickest(attempts, path.program, failing, best).judged


def _quickest(attempts: Attempts, program: PathProgram, failing: _Tried, flying: _Tried) -> _Tried:
    """The path mended by no more than it takes, between a remedy that fails and one that does not."""
    for _ in range(MAX_HALVINGS):
        if flying.duration < DEAR * failing.duration or out_of_time():
            break
        between = _mended(attempts, program, flying, flying.remedy.halfway_to(failing.remedy))
        if between is None:
            break
        if between.own.flies and between.duration < flying.duration:
            flying = between
        else:
            failing = between
    return flying


def _mended(attempts: Attempts, program: PathProgram, start: _Tried, remedy: _Remedy) -> _Tried | None:
    """The path that a remedy leads to; None where none is certified.

    Args:
        attempts: Made and recorded here.
        program: The one to mend.
        start: Where the descent begins.
        remedy: What is asked beyond it.
    """
    source = start.judged.solution.source
    assert source.path is not None
    found = descent(remedy.applied(program), source.path.x).path
    if found is None:
        return None
    judged = attempts.refined(source, partial(finished, found))
    return _Tried(judged, _own_flight(attempts, judged), remedy) if judged.feasible else None


def _own_flight(attempts: Attempts, judged: Judged[Placement]) -> OwnFlight:
    trajectory, vehicle = judged.solution.trajectory, attempts.vehicle
    assert vehicle is not None
    assert trajectory is not None
    return own_flight(trajectory, vehicle, attempts.formulation.problem, attempts.placed(judged))
