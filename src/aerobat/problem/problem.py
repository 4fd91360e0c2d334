"""What is wanted: from where to where, through which gate, doing what, within which limits."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, frozen, frozen_bounds
from aerobat.documents import within
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate
from aerobat.problem.maneuver import Line, Maneuver, named_gate
from aerobat.problem.stage import StageSequence

DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap", "crackle")
UNITS = ("m", "m/s", "m/s²", "m/s³", "m/s⁴", "m/s⁵")
ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class EndState:
    """Where a trajectory begins or ends; derivatives above acceleration are zero there. World frame."""

    position: Array  # [m], (3,)
    velocity: Array = field(default_factory=lambda: np.zeros(3))  # [m/s]
    acceleration: Array = field(default_factory=lambda: np.zeros(3))  # [m/s²]

    def __post_init__(self) -> None:
        """Check."""
        for f in fields(self):
            object.__setattr__(self, f.name, frozen(getattr(self, f.name), f.name, (3,)))

    def derivatives(self, order: int) -> Array:
        """Position and its derivatives below `order`, (order, 3)."""
        known = [self.position, self.velocity, self.acceleration]
        return np.array([known[k] if k < len(known) else np.zeros(3) for k in range(order)])


@dataclass(frozen=True)
class Limits:
    """Bounds per axis, at the interval ends as in the paper's (1); infinite where nothing is asked.

    `lower` and `upper` bound the position [m]; the others bound the magnitude of each component of a
    derivative, a number for all axes or one per axis.
    """

    lower: Array = field(default_factory=lambda: np.full(3, -np.inf))  # [m]
    upper: Array = field(default_factory=lambda: np.full(3, np.inf))  # [m]
    velocity: Array | float = np.inf  # [m/s]
    acceleration: Array | float = np.inf  # [m/s²]
    jerk: Array | float = np.inf  # [m/s³]
    snap: Array | float = np.inf  # [m/s⁴]
    crackle: Array | float = np.inf  # [m/s⁵]

    def __post_init__(self) -> None:
        """Check."""
        for name in ("lower", "upper"):
            object.__setattr__(self, name, frozen_bounds(getattr(self, name), f"limits.{name}", (3,)))
        if not (self.lower < self.upper).all():
            raise SpecError("limits.lower must be below limits.upper on every axis")
        for name in DERIVATIVES[1:]:
            bound = frozen_bounds(getattr(self, name), f"limits.{name}")
            if bound.shape not in ((), (3,)) or not (bound > 0).all():
                raise SpecError(f"limits.{name} must be positive, one number or one per axis")
            object.__setattr__(self, name, frozen_bounds(np.broadcast_to(bound, 3), f"limits.{name}"))

    def of(self, derivative: int) -> tuple[Array, Array]:
        """The lower and upper bounds of a derivative of position, each (3,)."""
        if derivative == 0:
            return self.lower, self.upper
        bound = np.asarray(getattr(self, DERIVATIVES[derivative]))
        return -bound, bound

    def without(self, derivative: int) -> Limits:
        """The same limits with those on one derivative taken away."""
        if derivative == 0:
            return replace(self, lower=np.full(3, -np.inf), upper=np.full(3, np.inf))
        bounds: dict[str, Any] = {DERIVATIVES[derivative]: np.inf}
        return replace(self, **bounds)

    def drawn_in(self, derivative: int, below: Array, above: Array) -> Limits:
        """The same limits, one derivative's tighter: by `below` at its lower ends, `above` at its upper ones.

        Raises SpecError when nothing is left between them.
        """
        if derivative == 0:
            return replace(self, lower=self.lower + below, upper=self.upper - above)
        bound = self.of(derivative)[1] - np.maximum(below, above)
        tighter: dict[str, Any] = {DERIVATIVES[derivative]: bound}
        return replace(self, **tighter)


PAPER_LIMITS = Limits(velocity=10.0, acceleration=90.0, jerk=200.0)  # the authors' reference code


@dataclass(frozen=True)
class Problem:
    """A maneuver between two states, free of any vehicle.

    Raises SpecError when an end lies outside the limits, or the maneuver lacks its gate.
    """

    name: str
    start: EndState
    goal: EndState
    maneuver: Maneuver = field(default_factory=Line)
    gates: tuple[Gate, ...] = ()
    limits: Limits = field(default_factory=Limits)
    heading: float = 0.0  # [rad] about the thrust axis at the start, carried along without spin
    environment: Environment = field(default_factory=Environment)
    description: str = ""

    def __post_init__(self) -> None:
        """Check."""
        if not np.isfinite(self.heading):
            raise SpecError("heading_deg must be a finite angle in degrees")
        object.__setattr__(self, "gates", tuple(self.gates))
        names = [gate.name for gate in self.gates]
        for i, name in enumerate(names):
            if name in names[:i]:
                raise SpecError(f"gates[{i}].name: there are two gates named '{name}'; rename one")
        with within(f"problem '{self.name}': "):
            self.stages(1.0)
        self._check_within_limits()

    def _check_within_limits(self) -> None:
        for derivative, quantity in enumerate(DERIVATIVES[:3]):
            for end, state in (("start", self.start), ("goal", self.goal)):
                self._check_point(f"{end}.{quantity}", state.derivatives(3)[derivative], derivative)
        for gate in self.gates:
            self._check_point(f"{gate.name}.position", gate.position, 0)

    def _check_point(self, name: str, value: Array, derivative: int) -> None:
        lower, upper = self.path_limits.of(derivative)
        for axis, x, low, high in zip("xyz", value, lower, upper, strict=True):
            if not low <= x <= high:
                limit = "lower and limits.upper" if derivative == 0 else DERIVATIVES[derivative]
                raise SpecError(
                    f"{name}: its {axis} component, {x:g} {UNITS[derivative]}, lies outside the limits "
                    f"[{low:g}, {high:g}]; move it or widen limits.{limit}"
                )

    @property
    def path_limits(self) -> Limits:
        """The limits, and the ground below."""
        ground = self.environment.ground
        if ground is None:
            return self.limits
        return replace(self.limits, lower=np.maximum(self.limits.lower, [-np.inf, -np.inf, ground]))

    def stages(self, max_specific_thrust: float) -> StageSequence:
        """The maneuver's stages through the problem's gates, for a vehicle that has so much thrust [m/s²].

        Raises SpecError for gates that do not suit the maneuver.
        """
        return self.maneuver.stages(self.gates, max_specific_thrust)

    def gate(self, name: str) -> Gate:
        """The gate of that name. Raises SpecError when there is none."""
        return named_gate(self.gates, name)

    def as_in_paper(self) -> Problem:
        """The same problem as the paper formulates it, with the reference code's limits and ε."""
        return replace(self, maneuver=self.maneuver.as_in_paper(), limits=PAPER_LIMITS)


def at_rest(position: ArrayLike) -> EndState:
    """At rest at `position` [m], (3,)."""
    return EndState(np.asarray(position, dtype=float))
