"""Headings: the direction that the body's x axis follows along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum
from math import degrees, inf, isclose, radians
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, PlainValidator, Strict

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.declaration import (
    Angle,
    FieldError,
    Limit,
    PartialVector,
    declared,
    from_table,
    number,
    shown,
)
from aerobat.errors import SpecError
from aerobat.problem.condition import free
from aerobat.so3 import UP
from aerobat.states import FlatState
from aerobat.trajectory import minimum_effort

MIN_DISTANCE = 0.1  # [m] distance from the point below which its direction is unreliable
MIN_SPEED = 0.5  # [m/s] speed below which the direction of velocity is unreliable


class HeadingMode(StrEnum):
    """Modes of a heading, by the reference that it follows."""

    FREE = "free"  # no reference: the heading is carried along without spin
    FIXED = "fixed"  # the heading at the start
    TOWARDS = "towards"  # a point
    VELOCITY = "along-velocity"
    SPLINE = "spline"  # angles at fractions of the duration


def _rows(value: ArrayLike) -> Array:
    try:
        rows = frozen(value, "knots_deg")
    except SpecError:
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != 2:
        raise FieldError("", f"must be rows [fraction of the duration, degrees], got {shown(value)}")
    if not (np.diff(rows[:, 0], prepend=-1e-12, append=1.0 + 1e-12) > 0.0).all():
        raise FieldError("", f"must have rising fractions from 0 to 1, got {rows[:, 0].tolist()}")
    return rows


Knots = Annotated[
    Array, PlainValidator(_rows), Field(description="rows of a fraction of the duration and an angle")
]


@declared
class Heading:
    """The direction of the body's x axis along the path, as a turn about the thrust axis.

    A heading is an angle about the thrust axis, measured from the x axis that results from the smallest
    rotation from upright. A plan follows the reference as closely as the rotors allow. It turns smoothly
    where the reference has no direction: upside down, near the point, or at low speed.
    """

    start: Angle = 0.0  # [rad] about the thrust axis at the start
    mode: Annotated[HeadingMode, Strict(False)] = HeadingMode.FREE  # what is followed from there on
    point: PartialVector = field(default_factory=free)  # [m] world; what `towards` looks at
    # of `spline`: fractions of the duration, and headings [deg] then; it begins with the start's
    knots_deg: Knots = field(default_factory=lambda: np.zeros((0, 2)))
    tolerance_deg: Limit = inf  # [deg] that the heading of a plan may be off where it is asked

    def __post_init__(self) -> None:
        """Check that point and knots belong to the mode."""
        for name, mode, given in (
            ("point", HeadingMode.TOWARDS, not np.isnan(self.point).any()),
            ("knots_deg", HeadingMode.SPLINE, len(self.knots_deg) > 0),
        ):
            if given != (self.mode is mode):
                complaint = f'is for mode = "{mode}"; drop it' if given else f"is missing for {mode}; add it"
                raise FieldError(name, complaint)
        knots = self.knots_deg
        if len(knots) and knots[0, 0] == 0.0 and not isclose(radians(knots[0, 1]), self.start, abs_tol=1e-9):
            begin = f"begins with {knots[0, 1]:g}°, heading_deg is {degrees(self.start):g}"
            raise FieldError("knots_deg", f"{begin}; give both alike, or leave that row out")

    def __float__(self) -> float:
        """Return the heading at the start [rad]."""
        return self.start

    def reference_axes(self, fractions: Array, flat: FlatState, b3: Array) -> Array:
        """Return reference directions of the body's x axis, world, (T, 3), with lengths 0 to 1 as weights.

        Args:
            fractions: Of the duration that have passed, (T,).
            flat: The motion at these instants.
            b3: The thrust axes at these instants, (T, 3).
        """
        upright = (1.0 + b3[:, 2:]) / 2.0
        if self.mode is HeadingMode.TOWARDS:
            return upright * _softened(self.point - flat.position, MIN_DISTANCE)
        if self.mode is HeadingMode.VELOCITY:
            return upright * _softened(flat.velocity, MIN_SPEED)
        angle = self._angles(fractions)
        level = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        return upright * so3.rotate(so3.smallest_rotation(UP, b3), level)

    def _angles(self, fractions: Array) -> Array:
        """Return the headings [rad] of a minimum-effort spline through the knots, at rest at both ends."""
        rows = self.knots_deg[self.knots_deg[:, 0] > 0.0]
        if not len(rows):
            return np.full(len(fractions), self.start)
        knots = np.append(0.0, rows[:, 0])
        fixed = np.full((len(knots), 3, 3), np.nan)
        fixed[:, 0] = np.append(self.start, np.radians(rows[:, 1]))[:, None]
        fixed[[0, -1], 1:] = 0.0
        spline = minimum_effort(fixed, np.diff(knots))
        return spline.evaluate(np.minimum(fractions, knots[-1]))[:, 0]


def as_heading(value: object) -> Heading:
    """Return a heading, from itself, a table, or the initial angle [rad]."""
    if isinstance(value, Heading):
        return value
    if isinstance(value, Mapping):
        return from_table(Heading, value)
    try:
        return from_table(Heading, {"start": number(value, "")})
    except FieldError as error:
        raise FieldError("", error.complaint) from None


def _softened(vectors: Array, small: float) -> Array:
    """Return unit vectors along vectors (T, 3), shortened where these are not much longer than `small`."""
    return np.asarray(vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True) + small**2))
