"""Problems of planning: a start and a goal, gates, a maneuver, and limits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field, replace
from functools import cached_property, lru_cache
from itertools import permutations
from math import radians
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import (
    FieldError,
    Label,
    NonNegative,
    Positive,
    declared,
    from_table,
    in_degrees,
    number,
    shown,
    to_table,
    validated,
    within_field,
)
from aerobat.environment import Environment
from aerobat.errors import OwnCodeError, SpecError
from aerobat.problem.condition import Condition, ForceBalance, Quantity
from aerobat.problem.end_state import EndState
from aerobat.problem.gate import Gate, named_gate
from aerobat.problem.heading import Heading, as_heading
from aerobat.problem.limits import DERIVATIVES, PAPER_LIMITS, UNITS, Limits
from aerobat.problem.maneuvers.line import Line
from aerobat.problem.maneuvers.maneuver import MANEUVERS, Maneuver
from aerobat.problem.stage import StageSequence
from aerobat.problem.tolerance import Tolerance
from aerobat.registry import placed

ROUNDING = 1e-9  # [-] tolerance relative to the scale of a bound
MIN_PLACES = 2  # fewest places of a closed course


def _file_name(name: str) -> str:
    if not re.fullmatch(r"\w[\w .-]*", name):
        raise FieldError("", f"must be letters, digits, spaces, points and dashes, got {shown(name)}")
    return name


@declared
class Problem:
    """A maneuver between two states, or a closed course, free of any vehicle.

    Raises SpecError when an end lies outside the limits or contradicts a path constraint of the maneuver, is
    missing, or is given for a closed course, and when the maneuver lacks its gate.
    """

    name: Annotated[Label, AfterValidator(_file_name)]  # left out in a file, the file's
    start: EndState = field(default_factory=EndState)  # where and how fast it begins
    goal: EndState = field(default_factory=EndState)  # where and how fast it ends
    maneuver: Annotated[Maneuver, PlainValidator(MANEUVERS.read)] = Line()  # what happens on the way
    gates: tuple[Gate, ...] = ()  # openings to pass
    limits: Limits = field(default_factory=Limits)  # bounds on the path
    # about the thrust axis at the start, carried along without spin; or a table of what it follows
    heading: Annotated[Heading, PlainValidator(as_heading)] = Heading()  # [rad]
    environment: Environment = field(default_factory=Environment)  # where it is flown
    tolerance: Tolerance = Tolerance()  # how exactly flights keep to it beside gates and radii
    description: str = ""  # what it is, for people

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "heading_deg": "[deg] `start` of `heading` in degrees",
        "gate": "the only one of `gates`",
    }

    def __post_init__(self) -> None:
        """Check gates, ends, limits, obstacles and stages for contradictions."""
        names = [gate.name for gate in self.gates]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise FieldError(f"gates[{i}].name", f": there are two gates named '{name}'; rename one")
        for key, what in (("free_attitude", "attitude"), ("free_velocity", "velocity")):
            if getattr(self.start, key):
                raise FieldError(f"start.{key}", f"is for goals, a start has its {what}; drop it")
        for inner, outer in permutations(self.gates, 2):
            if inner.stands_in(outer):
                raise FieldError(
                    "gates",
                    f": gate '{inner.name}' stands in the opening of gate '{outer.name}'; move one of them",
                )
        sequence = self.stages(1.0)
        self._check_given_ends(sequence)
        self._check_within_limits()
        self._check_clear_of_obstacles()
        for stage in sequence.stages:
            for condition in stage.where:
                self._check_place(stage.name, condition)
        for i, condition in enumerate(sequence.path_constraints):
            self._check_ends(i, condition)

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace the shorthands. Raises FieldError for a file without a maneuver."""
        if "maneuver" not in table:
            raise FieldError("maneuver", "is missing; add it")
        if "gate" in table:
            if "gates" in table:
                raise SpecError("gate and gates are both given; give all gates as tables [[gates]]")
            with within_field("gate"):
                table["gates"] = (from_table(Gate, table.pop("gate")),)
        heading = table.get("heading")
        if "heading_deg" in table and isinstance(heading, Mapping):
            if "start" in heading:
                raise FieldError("heading_deg", "stands beside heading.start; drop either")
            table["heading"] = {**heading, "start": radians(number(table.pop("heading_deg"), "heading_deg"))}
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write the heading in degrees where that reproduces it exactly; short entries come first."""
        table.setdefault("maneuver", to_table(self.maneuver))
        heading = table.get("heading", {})
        angle = in_degrees({"heading": heading["start"]}, "heading") if "start" in heading else {}
        if "heading_deg" in angle:
            del heading["start"]
            return angle | {key: value for key, value in table.items() if key != "heading" or value}
        return table

    def _check_given_ends(self, sequence: StageSequence) -> None:
        """Raise FieldError for a missing end, and for closed courses with ends, times, holds or motion."""
        for end, state in (("start", self.start), ("goal", self.goal)):
            if not sequence.closed and state.is_left_out:
                raise FieldError(f"{end}.position", "is missing; add it")
            if sequence.closed and state != EndState():
                raise FieldError(end, "stands beside maneuver.closed, which has none; drop either")
        if not sequence.closed:
            return
        if sum(stage.is_placed for stage in sequence.stages) < MIN_PLACES:
            raise FieldError("maneuver.closed", f"needs {MIN_PLACES} elements that say where; add some")
        for stage in sequence.stages:
            if stage.hold:
                raise FieldError("maneuver.closed", ": a hold rests, a closed course never does; drop either")
            if stage.window != (0.0, 1.0):
                raise FieldError(
                    "maneuver.closed", f": '{stage.name}' asks for its time, which no lap counts; free it"
                )
        moving = [gate.name for gate in self.gates if gate.motion is not None]
        moving += [piece.name for piece in self.surroundings.pieces.pieces if piece.motion is not None]
        if moving:
            raise FieldError(
                "maneuver.closed", f": '{moving[0]}' moves, so that no two laps are alike; drop either"
            )

    def _check_within_limits(self) -> None:
        ground, top = self.environment.ground, self.limits.upper[2]
        if ground is not None and ground >= top:
            raise FieldError(
                "environment.ground", f"must be below limits.upper, got {ground:g} and {top:g} m"
            )
        for derivative, quantity in enumerate(DERIVATIVES[:3]):
            for end, state in self.ends.items():
                self._check_point(f"{end}.{quantity}", state.derivatives(3)[derivative], derivative)
        for i, gate in enumerate(self.gates):
            self._check_point(f"gates[{i}].position", gate.position, 0)

    def _check_clear_of_obstacles(self) -> None:
        """Raise FieldError for ends and gate centres inside an obstacle."""
        pieces = self.surroundings.pieces.still
        places = {f"{end}.position": state.position for end, state in self.ends.items()}
        places |= {f"gates[{i}].position": gate.position for i, gate in enumerate(self.gates)}
        for field_name, place in places.items():
            found = pieces.holding(place)
            if found is not None:
                raise FieldError(field_name, f": it lies in {found.name}, an obstacle; move one of them")

    def _check_place(self, stage: str, condition: Condition) -> None:
        """Raise FieldError for a condition on one axis's position outside the limits or below the ground."""
        lower, upper = self.path_limits.of(0)
        for axis, along, low, high in zip("xyz", condition.direction.tolist(), lower, upper, strict=True):
            if abs(along) == np.linalg.norm(condition.direction):
                first, last = sorted((condition.lower / along, condition.upper / along))
                if first > high or last < low:
                    raise FieldError(
                        "maneuver",
                        f": '{stage}' asks for {axis} from {first:g} to {last:g} m, outside the limits and "
                        f"the ground, [{low:g}, {high:g}]; move it or widen them",
                    )

    def _check_ends(self, number: int, condition: Condition) -> None:
        """Raise FieldError for ends that violate a path constraint; drag is unknown here and left out."""
        balance = ForceBalance(self.environment.gravity)
        for end, state in self.ends.items():
            bound = condition.bound(balance)
            still = (state.velocity == self.environment.wind).all()
            if condition.quantity is Quantity.SPECIFIC_THRUST and not still:
                continue
            if state.free_velocity and condition.quantity is not Quantity.POSITION:
                continue
            derivatives = state.derivatives(3)
            if bound.excess(derivatives) > ROUNDING * bound.scale:
                value = float(bound.value(derivatives))
                raise FieldError(
                    end,
                    f": its {condition.name}, {value:g}, lies outside what the "
                    f"maneuver asks throughout, path_constraints[{number}]: from {condition.lower:g} to "
                    f"{condition.upper:g}; change either",
                )

    def __str__(self) -> str:
        """Return one line with the course and its ends."""
        course = self.maneuver.in_words(self.gates)
        if self.ends:
            start, goal = (
                "({:g}, {:g}, {:g}) m".format(*end.position.tolist()) for end in self.ends.values()
            )
            on_ground = self.goal.position[2] == self.environment.ground
            moves = self.goal.free_velocity or self.goal.velocity.any()
            at_end = "pass" if moves else "land at" if on_ground else "stop at"
            course = f"from {start}: {course}, {at_end} {goal}"
        return "; ".join(filter(None, (f"{self.name}: {course}", " ".join(self.description.split()))))

    def _check_point(self, name: str, value: Array, derivative: int) -> None:
        lower, upper = self.path_limits.of(derivative)
        for axis, x, low, high in zip("xyz", value, lower, upper, strict=True):
            if not low <= x <= high:
                limit = f"limits.{DERIVATIVES[derivative]}" if derivative else "limits.lower and limits.upper"
                remedy = f"widen {limit}"
                if not derivative and axis == "z" and x < low == self.environment.ground:
                    remedy = "lower environment.ground"
                raise FieldError(
                    name,
                    f": its {axis} component, {x:g} {UNITS[derivative]}, lies outside the limits "
                    f"[{low:g}, {high:g}]; move it or {remedy}",
                )

    @property
    def ends(self) -> Mapping[str, EndState]:
        """The start and the goal by these names; empty for a closed course, which has no ends."""
        return {} if self.start.is_left_out else {"start": self.start, "goal": self.goal}

    @property
    def path_limits(self) -> Limits:
        """The limits, with the ground as a lower limit of height."""
        ground = self.environment.ground
        if ground is None:
            return self.limits
        return replace(self.limits, lower=np.maximum(self.limits.lower, [-np.inf, -np.inf, ground]))

    @cached_property
    def surroundings(self) -> Environment:
        """The environment, with the walls of gates among its obstacles."""
        walls = tuple(gate.solid for gate in self.gates if gate.solid is not None)
        environment = self.environment
        return replace(environment, obstacles=environment.obstacles + walls) if walls else environment

    @validated
    def stages(self, max_specific_thrust: Positive, body_radius: NonNegative = 0.0) -> StageSequence:
        """Return the maneuver's stages through the problem's gates, for a vehicle of this thrust and size.

        Each stage's requirements, its place and attitude included, are among its conditions. Only its ball is
        not; `StageSequence.linear` adds a polytope inside the ball.

        Args:
            max_specific_thrust: Of the vehicle [m/s²].
            body_radius: Of the vehicle's body about its centre of mass [m], the clearance from the edges of
                openings with a free crossing point.

        Raises:
            SpecError: Gates do not suit the maneuver.
        """
        return _explicit_stages(self.maneuver, self.gates, float(max_specific_thrust), float(body_radius))

    @validated
    def gate(self, name: str) -> Gate:
        """Return the gate of that name. Raises SpecError when there is none."""
        return named_gate(self.gates, name)

    def as_in_paper(self) -> Problem:
        """Return the problem as the paper formulates it, with the reference code's limits and ε."""
        return replace(self, maneuver=self.maneuver.as_in_paper(), limits=PAPER_LIMITS)


@lru_cache(maxsize=64)
def _explicit_stages(
    maneuver: Maneuver,
    gates: tuple[Gate, ...],
    max_specific_thrust: float,
    body_radius: float,
) -> StageSequence:
    """Return what `Problem.stages` returns, cached: planner, certificate and score need the same stages."""
    try:
        return _explicit(maneuver, maneuver.stage_sequence(gates, max_specific_thrust), gates, body_radius)
    except SpecError as error:
        raise placed(error, maneuver.stage_sequence) from None
    except (ValueError, AssertionError) as error:
        raise OwnCodeError(f"maneuver '{maneuver.kind}': {error!r}") from error


def _explicit(
    maneuver: Maneuver, sequence: Any, gates: tuple[Gate, ...], body_radius: float
) -> StageSequence:
    """Return a maneuver's sequence with explicit conditions in all stages."""
    if not isinstance(sequence, StageSequence):
        complaint = f"returned {shown(sequence)} from stage_sequence(), not a StageSequence"
        raise SpecError(f"maneuver '{maneuver.kind}' {complaint}")
    stages = (
        s.explicit(None if s.gate is None else named_gate(gates, s.gate), body_radius)
        for s in sequence.stages
    )
    return replace(sequence, stages=tuple(stages))
