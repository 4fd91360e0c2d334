"""A gate: a rectangular opening somewhere in the world, with a direction of passage and an upright."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.errors import SpecError


@dataclass(frozen=True)
class Gate:
    """A rectangular opening that a vehicle passes with its thrust axis along `up`.

    An upright gate has up = +z; one that is passed upside down has up = −z; the paper's half-flip
    gate, tilted by 90°, has up in the horizontal plane (Section II-D).

    Raises SpecError when a direction is zero, `up` is not normal to `normal`, or a side is not positive.
    """

    position: Array  # [m] world, the centre of the opening
    normal: Array  # unit, world: the direction of passage
    up: Array  # unit, world, normal to `normal`
    width: float = 1.0  # [m] along `lateral`
    height: float = 0.6  # [m] along `up`
    name: str = "gate"

    def __post_init__(self) -> None:
        """Check and normalise."""
        if not self.name.strip() or not self.name.isprintable():
            raise SpecError(f"gate.name must be one line of text, got {self.name!r}")
        object.__setattr__(self, "position", frozen(self.position, "gate.position", (3,)))
        object.__setattr__(self, "normal", unit(self.normal, "gate.normal"))
        object.__setattr__(self, "up", unit(self.up, "gate.up"))
        if abs(self.normal @ self.up) > 1e-6:
            raise SpecError("gate.up must be normal to gate.normal, the direction of passage")
        for name in ("width", "height"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise SpecError(f"gate.{name} must be a positive length in metres, got {getattr(self, name)}")

    @cached_property
    def lateral(self) -> Array:
        """The unit vector across the opening, to the left of who passes upright, (3,)."""
        return unit(np.cross(self.up, self.normal), "gate.lateral")

    @property
    def corners(self) -> Array:
        """The corners of the opening in the world [m], in order around it, (4, 3)."""
        half_width, half_height = self.lateral * self.width / 2, self.up * self.height / 2
        return np.array(
            [
                self.position + a * half_width + b * half_height
                for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
            ]
        )

    @property
    def angles(self) -> tuple[float, float, float]:
        """Heading, elevation and tilt [rad], as `tilted_gate` takes them."""
        heading = float(np.arctan2(self.normal[1], self.normal[0]))
        elevation = float(np.arcsin(np.clip(self.normal[2], -1.0, 1.0)))
        upright = tilted_gate(self.position, heading, elevation)
        return heading, elevation, float(np.arctan2(-self.up @ upright.lateral, self.up @ upright.up))

    def tilted(self, tilt: float) -> Gate:
        """The same gate with another tilt [rad]."""
        heading, elevation, _ = self.angles
        return tilted_gate(self.position, heading, elevation, tilt, self.width, self.height, self.name)


def tilted_gate(
    position: Array,
    heading: float = 0.0,
    elevation: float = 0.0,
    tilt: float = 0.0,
    width: float = 1.0,
    height: float = 0.6,
    name: str = "gate",
) -> Gate:
    """The gate at `position` [m] that is passed toward `heading`, climbing at `elevation`, rolled by `tilt`.

    All angles in rad. The tilt is a roll about the direction of passage, right-handed: 0 upright,
    π/2 with its upright to the right of who passes, π upside down. The paper's angle α (Section II-D) is
    measured toward +y when passing toward +x, so its α is our −tilt.
    """
    turn = so3.multiply(
        so3.about_axis(np.array([0.0, 0.0, 1.0]), np.asarray(heading)),
        so3.multiply(
            so3.about_axis(np.array([0.0, 1.0, 0.0]), np.asarray(-elevation)),
            so3.about_axis(np.array([1.0, 0.0, 0.0]), np.asarray(tilt)),
        ),
    )
    frame = so3.axes(turn)
    return Gate(position, frame[:, 0], frame[:, 2], width, height, name)


def unit(direction: Array, name: str) -> Array:
    """`direction` scaled to length one, write-protected. Raises SpecError, naming `name`, when it is zero."""
    vector = frozen(direction, name, (3,))
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        raise SpecError(f"{name} must be a direction, not the zero vector")
    vector = vector / length
    # what is only round-off would couple axes that have nothing to do with each other
    return frozen(np.where(np.abs(vector) < 1e-12, 0.0, vector), name)
