"""Sections of ellipsoids by planes reach as far as the points of the ellipsoids that lie in the plane."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines.floats import FloatOps
from aerobat.kernels.gates.section import BoundingEllipsoid, farthest, fraction_of_farthest, section
from suites import examples

seeds = st.integers(0, 2**32 - 1)
TURN = np.linspace(0.0, 2.0 * np.pi, 4_000, endpoint=False)


class Body:
    """A random ellipsoid at a random attitude, the axes of a random plane, and the way that it takes."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.semi_axes, self.centre = rng.uniform(0.05, 0.6, 3), rng.normal(scale=0.1, size=3)
        self.attitude = so3.normalize(rng.normal(size=4))
        self.plane = np.linalg.qr(rng.normal(size=(3, 3)))[0].T  # normal, along, beside
        self.turned = so3.axes(self.attitude)
        normal_reach = np.linalg.norm(self.semi_axes * (self.plane[0] @ self.turned))
        middle = rng.uniform(-0.9, 0.9) * normal_reach * self.plane[0]
        middle = middle + rng.normal(scale=0.3, size=2) @ self.plane[1:]
        self.offset = middle - self.turned @ self.centre
        self.way = self.plane.T @ (rng.uniform(-0.9, 0.9, 3) * [normal_reach, 2.0, 2.0])

    def section(self) -> object:
        """What the kernel says of it."""
        ellipsoid = BoundingEllipsoid(tuple(self.centre.tolist()), tuple(self.semi_axes.tolist()))
        directions = tuple(tuple(axis) for axis in self.plane.tolist())
        return section(
            FloatOps, ellipsoid, directions, tuple(self.offset.tolist()), tuple(self.attitude.tolist())
        )

    def outline(self, fraction: float) -> Array | None:
        """Points of the section along and beside at a fraction of the way, (points, 2); None without one."""
        shape = self.turned * self.semi_axes  # the ellipsoid is centre + shape w, |w| = 1
        centre = self.offset + self.turned @ self.centre - (1.0 - fraction) * self.way
        normal = self.plane[0] @ shape
        size = np.linalg.norm(normal)
        height = -(self.plane[0] @ centre) / size  # of the circle of w in the plane
        if abs(height) > 1.0:
            return None
        first, second = np.linalg.svd(normal[None])[2][1:]
        circle = np.cos(TURN)[:, None] * first + np.sin(TURN)[:, None] * second
        w = height * normal / size + np.sqrt(1.0 - height**2) * circle
        return np.asarray((centre + w @ shape.T) @ self.plane[1:].T)


@examples(60)
@given(seeds)
def test_the_farthest_point_of_a_section_is_the_farthest_that_lies_in_the_plane(seed: int) -> None:
    body = Body(np.random.default_rng(seed))
    found, outline = body.section(), body.outline(1.0)
    assert outline is not None
    point = outline[outline[:, 0].argmax()]
    assert farthest(FloatOps, found, 0.0) == pytest.approx(point, abs=2e-3)
    side = np.sign(outline[:, 0].mean())
    point = outline[(side * outline[:, 0]).argmax()]
    assert farthest(FloatOps, found, 1.0) == pytest.approx(point, abs=2e-3)


@examples(60)
@given(seeds, st.sampled_from([0.0, 1.0]))
def test_on_a_straight_way_the_section_reaches_nowhere_farther_than_at_the_fraction_said(
    seed: int, both_ways: float
) -> None:
    """To the side where the section's centre is in the middle of the fractions, where both ways count."""
    rng = np.random.default_rng(seed)
    for _ in range(6):
        check_fraction(rng, both_ways)


def check_fraction(rng: np.random.Generator, both_ways: float) -> None:
    """A random body on a random way reaches the farthest where the kernel says."""
    body = Body(rng)
    within = tuple(sorted(rng.uniform(0.0, 1.0, 2).tolist()))
    middle = body.outline(sum(within) / 2)
    ends = [body.outline(fraction) for fraction in within]
    if middle is None or ends[0] is None or ends[1] is None:
        return
    change = body.plane[:2] @ body.way
    fraction = fraction_of_farthest(FloatOps, body.section(), tuple(change.tolist()), within, both_ways)
    assert within[0] <= fraction <= within[1]
    side = -1.0 if both_ways and middle[:, 0].mean() < 0.0 else 1.0
    outlines = [body.outline(each) for each in [fraction, *np.linspace(*within, 20)]]
    reached = [(side * outline[:, 0]).max() for outline in outlines if outline is not None]
    assert reached[0] >= max(reached) - 1e-6
