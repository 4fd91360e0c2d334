"""Figures of loops: the whole loop, its halves, and the loop that is flown tail first."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import cos, radians, sin
from typing import ClassVar

from aerobat.declaration import Positive, declared
from aerobat.problem.gate import Gate
from aerobat.problem.maneuvers.figures.figure import Figure, Place
from aerobat.problem.maneuvers.maneuver import maneuver
from aerobat.problem.stage import Stage, StageSequence

LOOP_ACCELERATION = 13.5  # [m/s²] centripetal: 4.5 m/s around 1.5 m, the power loop of [DDA]
MARGIN = 0.25  # of a loop's radius, tolerance of positions on the loop
FORWARD = (1.0, 0.0, 0.0)
BACK = (-1.0, 0.0, 0.0)
RIGHT = (0.0, -1.0, 0.0)
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Loop:
    """A loop in a vertical plane, with the thrust toward its centre.

    Angles are counted from the bottom, forward and up: 90° is the front, 180° the top, 270° the rear.
    """

    place: Place  # the point of entry on the loop
    place_deg: int  # angle of the point of entry
    direction: int  # 1 up its front, −1 down it
    radius: float  # [m]

    NAMES: ClassVar[Mapping[int, str]] = {0: "bottom", 90: "front", 180: "top", 270: "rear"}

    def stage(self, angle_deg: int, speed: float = 0.0, name: str = "") -> Stage:
        """Return the stage at an angle of the loop; at the entry it passes the place's gate, if there is one.

        Args:
            angle_deg: of the stage [deg].
            speed: least speed along the loop [m/s].
            name: of the stage; left out, the angle's name, and the stage may be the entry.
        """
        sine, cosine = self._at(angle_deg)
        place_sine, place_cosine = self._at(self.place_deg)
        point = (self.radius * (sine - place_sine), 0.0, self.radius * (place_cosine - cosine))
        along = self.place.heads((self.direction * cosine, 0.0, self.direction * sine), speed)
        at_gate = angle_deg == self.place_deg and not name and self.place.gate is not None
        position = () if at_gate else self.place.near(point, MARGIN * self.radius)
        inward = (-sine, 0.0, cosine)
        return self.place.stage(name or self.NAMES[angle_deg], inward, *position, along, at_gate=at_gate)

    @staticmethod
    def _at(angle_deg: int) -> tuple[float, float]:
        """Return sine and cosine."""
        return sin(radians(angle_deg)), cos(radians(angle_deg))


@declared
class LoopFigure(Figure):
    """A figure of a loop, or of half a loop, with a size given by its radius or its speed."""

    # [m] of the loop; left out, the radius on which `speed` takes 13.5 m/s² to the middle, as in [DDA]
    radius: Positive | None = None

    ENTRY_DEG: ClassVar[int] = 0  # angle of entry on the loop
    DIRECTION: ClassVar[int] = 1  # 1: up the front of the loop; −1: down it

    def stage_sequence(self, gates: Sequence[Gate], max_specific_thrust: float) -> StageSequence:
        """Return the figure's stages. Raises SpecError for a missing gate, or a gate without a heading."""
        radius = self.radius or self.speed**2 / LOOP_ACCELERATION
        place = self.place(gates, max_specific_thrust)
        return StageSequence(tuple(self.stages(Loop(place, self.ENTRY_DEG, self.DIRECTION, radius))))

    @abstractmethod
    def stages(self, loop: Loop) -> Iterator[Stage]:
        """Yield the stages along the loop, before and after it."""


@maneuver("power-loop")
class PowerLoop(LoopFigure):
    """A loop forward and up, back to where it began, nose first all the way [DDA, FPV]."""

    def stages(self, loop: Loop) -> Iterator[Stage]:
        """Yield the stages all around, from the bottom."""
        yield loop.stage(0, self.speed)
        yield from map(loop.stage, (90, 180, 270))
        yield loop.stage(0, self.speed, "end")


@maneuver("split-s")
class SplitS(LoopFigure):
    """A half roll, then half a loop down: back the other way, lower by two radii [FAI, FPV]."""

    TITLE: ClassVar[str] = "Split-S"
    ENTRY_DEG: ClassVar[int] = 180
    DIRECTION: ClassVar[int] = -1

    def stages(self, loop: Loop) -> Iterator[Stage]:
        """Yield the knife edge of the half roll, and the stages down the front."""
        yield loop.place.stage("half roll", RIGHT, loop.place.heads(FORWARD, 0.0))
        yield loop.stage(180, self.speed)
        yield loop.stage(90)
        yield loop.stage(0, self.speed)


@maneuver("immelmann")
class Immelmann(LoopFigure):
    """Half a loop up, then a half roll: back the other way, higher by two radii [FAI, FPV]."""

    TITLE: ClassVar[str] = "Immelmann"

    def stages(self, loop: Loop) -> Iterator[Stage]:
        """Yield the stages up the front, the knife edge of the half roll, and level flight."""
        yield loop.stage(0, self.speed)
        yield from map(loop.stage, (90, 180))
        yield loop.place.stage("half roll", RIGHT, loop.place.heads(BACK, 0.0))
        yield loop.place.stage("level", UP, loop.place.heads(BACK, self.speed))


@maneuver("matty-flip")
class MattyFlip(LoopFigure):
    """Over the top, pitched back, then a loop down that is flown tail first below [DDA, FPV]."""

    TITLE: ClassVar[str] = "Matty flip"
    ENTRY_DEG: ClassVar[int] = 180
    DIRECTION: ClassVar[int] = -1

    def stages(self, loop: Loop) -> Iterator[Stage]:
        """Yield the pitch back, and the stages all around, from the top."""
        yield loop.place.stage("pitched back", BACK, loop.place.heads(FORWARD, 0.0))
        yield from map(loop.stage, (180, 90))
        yield loop.stage(0, self.speed)
        yield loop.stage(270)
        yield loop.stage(180, name="end")
