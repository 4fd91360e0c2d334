"""The layout of a problem's TOML file; angles in degrees, as people type them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from aerobat.states import STANDARD_GRAVITY

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Positive = Annotated[FiniteFloat, Field(gt=0)]
PerAxis = Positive | tuple[Positive, Positive, Positive]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", defer_build=True)


class EndTable(_Table):
    """[start] and [goal], world frame, SI."""

    position: Vector
    velocity: Vector = (0.0, 0.0, 0.0)
    acceleration: Vector = (0.0, 0.0, 0.0)


class GateTable(_Table):
    """[[gates]]: where it is, where one passes it to, how it is tilted, how large its opening is."""

    position: Vector
    heading_deg: FiniteFloat = 0.0
    elevation_deg: FiniteFloat = 0.0
    tilt_deg: FiniteFloat = 0.0
    width: Positive = 1.0
    height: Positive = 0.6
    name: Annotated[str, Field(min_length=1)] = "gate"


class EnvironmentTable(_Table):
    """[environment], world frame, SI."""

    gravity: Positive = STANDARD_GRAVITY
    wind: Vector = (0.0, 0.0, 0.0)
    ground: FiniteFloat | None = None


class LimitsTable(_Table):
    """[limits]: position between two corners, the others by magnitude per axis."""

    lower: Vector | None = None
    upper: Vector | None = None
    velocity: PerAxis | None = None
    acceleration: PerAxis | None = None
    jerk: PerAxis | None = None
    snap: PerAxis | None = None
    crackle: PerAxis | None = None


class ConditionTable(_Table):
    """One linear condition of a stage; `equals` stands for both bounds."""

    quantity: Literal["position", "velocity", "acceleration", "specific_thrust"]
    direction: Vector
    lower: FiniteFloat | None = None
    upper: FiniteFloat | None = None
    equals: FiniteFloat | None = None


class StageTable(_Table):
    """[[maneuver.stages]]"""

    name: Annotated[str, Field(min_length=1)]
    at: Annotated[FiniteFloat, Field(gt=0, lt=1)] | None = None
    interval_offset: int = 0
    gate: str | None = None
    conditions: list[ConditionTable] = []


class PassageTable(_Table):
    """[maneuver.passage]: how the gate is passed."""

    perpendicular: bool = True
    speed: Annotated[FiniteFloat, Field(ge=0)] = 0.0
    centred: bool = True


class FlipTable(_Table):
    """kind = "flip"."""

    kind: Literal["flip"]
    axis_deg: FiniteFloat = 0.0
    min_lateral_thrust: Positive | None = None
    min_inverted_thrust: Positive | None = None
    signed: bool = True
    ordered: bool = True
    passage: PassageTable = PassageTable()


class HalfFlipTable(_Table):
    """kind = "half-flip"."""

    kind: Literal["half-flip"]
    min_lateral_thrust: Positive | None = None
    passage: PassageTable = PassageTable()


class LineTable(_Table):
    """kind = "line"."""

    kind: Literal["line"]
    passage: PassageTable = PassageTable()


class StagesTable(_Table):
    """kind = "stages": any maneuver, spelled out."""

    kind: Literal["stages"]
    stages: Annotated[list[StageTable], Field(min_length=1)]
    path_constraints: list[ConditionTable] = []
    ordered: bool = True


class PartialVector(_Table):
    """Some components of a vector; those left out are free."""

    x: FiniteFloat | None = None
    y: FiniteFloat | None = None
    z: FiniteFloat | None = None


class WaypointTable(_Table):
    """[[maneuver.waypoints]]: what is given there; the rest is free."""

    position: Vector | PartialVector = PartialVector()
    velocity: Vector | PartialVector = PartialVector()
    acceleration: Vector | PartialVector = PartialVector()
    up: Vector | None = None
    thrust: Positive | None = None
    time: Positive | None = None
    gate: str | None = None


class WaypointsTable(_Table):
    """kind = "waypoints"."""

    kind: Literal["waypoints"]
    waypoints: Annotated[list[WaypointTable], Field(min_length=1)]
    duration: Positive | None = None


class ProblemTable(_Table):
    """The whole file."""

    name: Annotated[str, Field(pattern=r"^[\w][\w .-]*$")]
    description: str = ""
    heading_deg: FiniteFloat = 0.0
    start: EndTable
    goal: EndTable
    gate: GateTable | None = None  # short for one table [[gates]]
    gates: list[GateTable] = []
    environment: EnvironmentTable = EnvironmentTable()
    maneuver: Annotated[
        FlipTable | HalfFlipTable | LineTable | StagesTable | WaypointsTable, Field(discriminator="kind")
    ]
    limits: LimitsTable = LimitsTable()
