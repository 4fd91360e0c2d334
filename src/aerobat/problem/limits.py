"""Limits of a problem on its path, and the names and units of position's derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from typing import Any, ClassVar

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import Corner, Derivative, FieldError, PerAxis, TiltLimit, declared, validated

DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap", "crackle")
UNITS = ("m", "m/s", "m/s²", "m/s³", "m/s⁴", "m/s⁵")


def _unbounded() -> Array:
    return np.full(3, np.inf)


@declared
class Limits:
    """Bounds on a path, per axis as in the paper's (1), and on its tilt; infinite where nothing is asked.

    `lower` and `upper` bound the position, `max_tilt` the attitude; the others bound the magnitude of each
    component of a derivative.
    """

    lower: Corner = field(default_factory=lambda: -_unbounded())  # [m] corner of the volume allowed
    upper: Corner = field(default_factory=_unbounded)  # [m] opposite corner
    velocity: PerAxis = field(default_factory=_unbounded)  # [m/s] largest magnitude
    acceleration: PerAxis = field(default_factory=_unbounded)  # [m/s²] largest magnitude
    jerk: PerAxis = field(default_factory=_unbounded)  # [m/s³] largest magnitude
    snap: PerAxis = field(default_factory=_unbounded)  # [m/s⁴] largest magnitude
    crackle: PerAxis = field(default_factory=_unbounded)  # [m/s⁵] largest magnitude
    max_tilt: TiltLimit = np.inf  # [rad] largest angle between the thrust axis and the vertical

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"max_tilt_deg": "[deg] `max_tilt` in degrees"}

    def __post_init__(self) -> None:
        """Check the corners."""
        if not (self.lower < self.upper).all():
            raise FieldError("lower", "must be below upper on every axis")

    @validated
    def of(self, derivative: Derivative) -> tuple[Array, Array]:
        """Return the lower and upper bounds of a derivative of position, each (3,)."""
        if derivative == 0:
            return self.lower, self.upper
        bound = np.asarray(getattr(self, DERIVATIVES[derivative]))
        return -bound, bound

    @validated
    def without(self, derivative: Derivative) -> Limits:
        """Return the limits without the bounds on one derivative."""
        if derivative == 0:
            return replace(self, lower=np.full(3, -np.inf), upper=np.full(3, np.inf))
        bounds: dict[str, Any] = {DERIVATIVES[derivative]: np.inf}
        return replace(self, **bounds)

    def tightened(self, derivative: int, below: Array, above: Array) -> Limits:
        """Return the limits with one derivative tightened: `below` at its lower, `above` at its upper bound.

        Raises SpecError when no room is left between them.
        """
        if derivative == 0:
            return replace(self, lower=self.lower + below, upper=self.upper - above)
        bound = self.of(derivative)[1] - np.maximum(below, above)
        tighter: dict[str, Any] = {DERIVATIVES[derivative]: bound}
        return replace(self, **tighter)


PAPER_LIMITS = Limits(velocity=10.0, acceleration=90.0, jerk=200.0)  # the authors' reference code
