"""A course: maneuvers one after another, in laps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated

from pydantic import Field, PlainValidator

from aerobat.declaration import Count, FieldError, Repeats, within_field
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate, named_gate
from aerobat.problem.maneuvers.custom import CustomManeuver
from aerobat.problem.maneuvers.maneuver import MANEUVERS, Maneuver, in_sequence, maneuver
from aerobat.problem.stage import Stage, StageSequence

Element = Annotated[Maneuver, PlainValidator(MANEUVERS.read)]


@maneuver("course")
class Course(Maneuver):
    """Elements one after another, each a maneuver of any kind, flown `laps` times.

    An element receives only the gates that it names, itself or in elements or stages of its own; a course of
    one element need not name them. The last lap may end early, after the first `last_lap` elements. An
    element's path constraints hold along the whole course.

    A `closed` course has neither start nor goal: it is periodic, begins and ends in flight between its last
    element and its first, and can be flown repeatedly.
    """

    elements: Annotated[tuple[Element, ...], Field(min_length=1)]  # in order
    laps: Repeats = 1  # how often they are flown
    last_lap: Count | None = None  # elements of the last lap; left out, all
    closed: bool = False  # it ends as it begins, in flight; `start` and `goal` are left out

    def __post_init__(self) -> None:
        """Check the last lap."""
        if self.last_lap is not None and self.last_lap > len(self.elements):
            raise FieldError(
                "last_lap",
                f"must be {len(self.elements)}, the number of elements, or less, got {self.last_lap}",
            )
        if self.last_lap is not None and self.closed:
            raise FieldError("last_lap", "stands beside closed, whose laps are all whole; drop one of them")

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the stages of all elements of all laps.

        Raises SpecError, which names the element, for gates that do not suit it and for unordered stages.
        """
        sequences = [self._sequence(i, gates, max_specific_thrust) for i in range(len(self.elements))]
        lap = tuple(_named([stage for sequence in sequences for stage in sequence.stages]))
        last = sum(len(sequence.stages) for sequence in sequences[: self.last_lap])
        flown = (lap[:last] if number == self.laps else lap for number in range(1, self.laps + 1))
        stages = [replace(stage, lap=number) for number, each in enumerate(flown, 1) for stage in each]
        throughout = dict.fromkeys(each for sequence in sequences for each in sequence.path_constraints)
        return StageSequence(tuple(stages), tuple(throughout), closed=self.closed)

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the elements in words, with repeated ones counted."""
        said = in_sequence(element.in_words(self._given(element, gates)) for element in self.elements)
        if self.closed:
            return f"{'a closed lap' if self.laps == 1 else f'{self.laps} closed laps'} of {said}"
        if self.laps == 1:
            return said
        partial = "" if self.last_lap is None else f", the last of {self.last_lap} elements"
        return f"{self.laps} laps of {said}{partial}"

    @property
    def through_points(self) -> bool:
        """True where every stage of every element is a waypoint."""
        return all(element.through_points for element in self.elements)

    def _sequence(self, i: int, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the stages of one element."""
        element = self.elements[i]
        with within_field(f"maneuver.elements[{i}]"):
            sequence = element.stage_sequence(self._given(element, gates), max_specific_thrust)
            if not sequence.ordered and len(self.elements) > 1:
                raise SpecError("its stages come in any order, which those of a course do not; order them")
            if sequence.closed:
                raise FieldError("closed", "is for whole courses, this one is an element; drop it")
        return sequence

    def _given(self, element: Maneuver, gates: Sequence[Gate]) -> Sequence[Gate]:
        """Return the gates for an element: those that it names, or all where it is the only element."""
        if len(self.elements) == 1:
            return gates
        return tuple(named_gate(gates, name) for name in dict.fromkeys(_gate_names(element)))


def _gate_names(element: Maneuver | Stage) -> Iterator[str]:
    """Yield the names of the gates that an element names, itself or in elements or stages of its own."""
    name = getattr(element, "gate", None)
    if name is not None:
        yield name
    if isinstance(element, Course | CustomManeuver):
        for part in element.elements if isinstance(element, Course) else element.stages:
            yield from _gate_names(part)


def _named(stages: Sequence[Stage]) -> Iterator[Stage]:
    """Yield a lap's stages; stages of the same name are numbered, except those of gates."""
    counts = Counter(stage.name for stage in stages)
    seen: Counter[str] = Counter()
    for stage in stages:
        seen[stage.name] += 1
        is_one_of_several = counts[stage.name] > 1 and stage.gate is None
        yield replace(stage, name=f"{stage.name} {seen[stage.name]}") if is_one_of_several else stage
