"""The interface of maneuvers, and the register of maneuvers by name."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from types import MappingProxyType
from typing import ClassVar, TypeVar, cast, dataclass_transform

from pydantic import Field

from aerobat.arrays import Array
from aerobat.declaration import Angle, Label, Positive, validated
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate
from aerobat.problem.stage import StageSequence
from aerobat.registry import Registry


class Maneuver(ABC):
    """A maneuver: a sequence of stages, which depends on gates and on the available thrust.

    A custom maneuver inherits from this class, is registered by `@maneuver("its-name")`, and implements
    `stage_sequence`. The other methods have defaults for maneuvers of no special kind.
    """

    kind: ClassVar[str] = ""  # its name in files, set when it is registered
    TITLE: ClassVar[str] = ""  # its name in text, where that differs from `kind` with spaces

    @abstractmethod
    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the stages through `gates` for a vehicle with this maximum specific thrust [m/s²].

        Raises SpecError for gates that do not suit the maneuver.
        """

    def as_in_paper(self) -> Maneuver:
        """Return the maneuver exactly as the paper prints it; unchanged when it is not in the paper."""
        return self

    @validated
    def with_gate_tilt(self, gates: Sequence[Gate], tilt: Angle) -> tuple[Gate, ...]:
        """Return the gates at another tilt [rad]. Raises SpecError for maneuvers other than half-flips."""
        raise SpecError(f"only the gate of a half-flip can be tilted, this maneuver is a {self.kind}")

    @validated
    def with_stage_thrust(self, gates: Sequence[Gate], thrust: Positive) -> Maneuver:
        """Return a copy with a minimum specific thrust [m/s²] in gate or stages; unchanged if it has none."""
        return self

    @property
    def turn_axis(self) -> Array | None:
        """The unit vector about which the vehicle turns, right-handed, (3,); None where there is none."""
        return None

    @property
    def through_points(self) -> bool:
        """True where every stage is a waypoint: closed-form polynomials are then a good initial guess."""
        return False

    def in_words(self, gates: Sequence[Gate]) -> str:
        """Return the maneuver in words, with the gate that it names, or the only one."""
        name: str | None = getattr(self, "gate", None)
        if name is None and len(gates) == 1:
            name = gates[0].name
        within = "" if name is None else f" in {gate_in_words(name)}"
        return (self.TITLE or self.kind.replace("-", " ")) + within

    @property
    def first_times(self) -> tuple[float, ...] | None:
        """The times [s] of all stages and of the end in the initial guess; None: the planner's choice."""
        return None


def gate_in_words(name: str) -> str:
    """Return a gate in words: the gate, the red gate, gate 3."""
    if name == "gate":
        return "the gate"
    if "gate" not in name.lower():
        return f"the {name} gate"
    return name if name[-1].isdigit() else f"the {name}"


def in_sequence(words: Iterable[str]) -> str:
    """Return words as a sequence, with a count of words that repeat in a row."""
    runs = [(word, len(tuple(run))) for word, run in groupby(words)]
    return ", ".join(word if count == 1 else f"{word}, {count} times" for word, count in runs)


M = TypeVar("M", bound=Maneuver)

MANEUVERS: Registry[Maneuver] = Registry(
    Maneuver,  # type: ignore[type-abstract]
    "maneuver",
    "aerobat.maneuvers",
    {
        "barrel-roll": "aerobat.problem.maneuvers.figures.rolls",
        "corkscrew": "aerobat.problem.maneuvers.figures.rolls",
        "course": "aerobat.problem.maneuvers.course",
        "flip": "aerobat.problem.maneuvers.flip",
        "gate": "aerobat.problem.maneuvers.elements",
        "half-flip": "aerobat.problem.maneuvers.half_flip",
        "hold": "aerobat.problem.maneuvers.elements",
        "immelmann": "aerobat.problem.maneuvers.figures.loops",
        "inverted-pass": "aerobat.problem.maneuvers.figures.passes",
        "knife-edge-pass": "aerobat.problem.maneuvers.figures.passes",
        "line": "aerobat.problem.maneuvers.line",
        "matty-flip": "aerobat.problem.maneuvers.figures.loops",
        "power-loop": "aerobat.problem.maneuvers.figures.loops",
        "split-s": "aerobat.problem.maneuvers.figures.loops",
        "stages": "aerobat.problem.maneuvers.custom",
        "waypoint": "aerobat.problem.maneuvers.elements",
        "waypoints": "aerobat.problem.maneuvers.waypoints",
    },
)


@validated
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def maneuver(kind: Label) -> Callable[[type[M]], type[M]]:
    """Declare the class that follows and register it: `kind` is its name in problem files."""

    def register(cls: type[M]) -> type[M]:
        return cast(type[M], MANEUVERS.add(kind, cls))

    return register


def registered_maneuvers() -> Mapping[str, type[Maneuver]]:
    """Return the maneuvers by name: those of this package, of plugins and of installed packages."""
    return MappingProxyType({kind: MANEUVERS[kind] for kind in MANEUVERS})
