"""Clearance of the body from a gate's frame, from before the gate's plane until behind it.

A stage constrains the motion at one instant. The body needs some time to pass the plane, and clears the
opening if its motion changes little meanwhile. Let v_n be the velocity along the normal, and v_a the velocity
outward across a side of the opening. The length d is the body's reach plus a margin, before and behind the
plane. s is the body's extent in the outward direction, and r the distance to that side from the crossing
point. With an acceleration of at most a across a straight line, |path − straight line| ≤ ½ a (d/v_n)². The
body is clear where

    (r − s) v_n ± d v_a ≥ ½ a d²/v_n    on all sides    and    v_n ≥ √(2 a d).

The second condition keeps the body from turning back. The body is an ellipsoid with its semi-axes on the
diagonal of D and the attitude R, so s = |D Rᵀ e| along e. Where only the thrust axis is known, the body is
the ellipsoid of revolution about that axis that contains the vehicle at every angle about it. A body that
turns reaches farther before and behind the plane than in it: s is its extent a fraction of d away from the
plane, with the thrust f ± f' t, where f' follows from the path's jerk and t is the time from the plane.

The values are written in components once, for all kinds of numbers: floats, complex steps, symbols.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from aerobat.arrays import Array
from aerobat.kernels.ops import Axes, Ops, Scalar, Vector
from aerobat.kernels.vectors import dot, subtract
from aerobat.problem.gate import Gate
from aerobat.vehicle import Ellipsoid

# [m/s] lower bound of v_n in the curvature term; far below the speeds required at gates
MIN_NORMAL_SPEED = 0.5
FRAME_CLEARANCE = 0.01  # [m] smallest distance of the body from the frame

# Fraction of the reach, away from the plane, at which a turning body must be clear. With 0, x500's half-flip
# through a gate tilted by 20° needs a detour, 4.9 s in place of 3.44. Plans of 300 random problems last
# 1.0146 times the best known on average, with 0 1.0148; with extents in the plane too, one lasts 12 % longer.
TURNING = 0.5

# [m] extent of a body from its centre of mass in an outward direction
Extent: TypeAlias = Callable[[Vector], Scalar]


class OpeningAhead(NamedTuple):
    """An opening and bounds of the motion through it, in numbers or in symbols."""

    place: Vector  # [m] position of the gate
    normal: Vector  # direction of passage
    outward: tuple[Vector, ...]  # normals of its K sides
    distances: tuple[Scalar, ...]  # [m] of the sides from the place
    reach: Scalar  # [m] distance before and behind the plane over which the body must be clear
    lateral_acceleration: Scalar  # [m/s²] largest acceleration across a straight line
    turning: Scalar  # fraction of the reach at which a turning body must be clear

    @classmethod
    def of_parameters(cls, parameters: Sequence[Scalar]) -> OpeningAhead:
        """Return the opening given by 9 + 4 K numbers in the order of the fields."""
        vectors = [(parameters[k], parameters[k + 1], parameters[k + 2]) for k in range(0, 6, 3)]
        sides = (len(parameters) - 9) // 4
        outward = tuple(
            (parameters[k], parameters[k + 1], parameters[k + 2]) for k in range(6, 6 + 3 * sides, 3)
        )
        distances = tuple(parameters[6 + 3 * sides + k] for k in range(sides))
        return cls(vectors[0], vectors[1], outward, distances, *parameters[-3:])

    def time_of_turning(self, ops: Ops, velocity: Vector) -> Scalar:
        """Return the time [s] from the plane to where the extents of a turning body are those that count."""
        return self.turning * self.reach / ops.maximum(dot(self.normal, velocity), MIN_NORMAL_SPEED)

    def clearances(
        self, ops: Ops, position: Vector, velocity: Vector, extents: tuple[Extent, Extent]
    ) -> Iterator[Scalar]:
        """Yield 2 K + 1 values that are nonnegative where the body is clear of the frame.

        The values are the clearance [m²/s] on each side, behind the plane and before it, and the excess speed
        [m/s].

        Args:
            ops: The arithmetic of the arguments.
            position: Position of the centre of mass as it crosses the plane [m].
            velocity: Velocity of the centre of mass there [m/s].
            extents: Extents of the body in its attitudes behind the plane and before it.
        """
        through, offset = dot(self.normal, velocity), subtract(position, self.place)
        deviation = self.lateral_acceleration * self.reach * self.reach / 2.0
        deviation = deviation / ops.maximum(through, MIN_NORMAL_SPEED)
        for outward, distance in zip(self.outward, self.distances, strict=True):
            left, across = distance - dot(outward, offset), self.reach * dot(outward, velocity)
            for moved, extent in zip((across, -across), extents, strict=True):
                yield (left - extent(outward)) * through - deviation - moved
        yield through - ops.sqrt(2.0 * self.lateral_acceleration * self.reach)


@dataclass(frozen=True, eq=False)
class BodyInGate:
    """The clearance of a body in the gate that a stage crosses."""

    gate: Gate
    stage: int
    reach: float  # [m] distance before and behind the plane over which the body must be clear
    lateral_acceleration: float  # [m/s²] largest acceleration across a straight line
    turning: float = TURNING  # fraction of the reach at which a turning body must be clear

    @property
    def min_speed(self) -> float:
        """The smallest speed through the gate [m/s] at which the path cannot turn back."""
        return sqrt(2.0 * self.lateral_acceleration * self.reach)

    def halfway_from(self, other: BodyInGate) -> BodyInGate:
        """Return the clearance halfway between that of another body in the gate and this one."""
        acceleration = 0.5 * (self.lateral_acceleration + other.lateral_acceleration)
        turning = 0.5 * (self.turning + other.turning)
        return replace(self, lateral_acceleration=acceleration, turning=turning)

    @property
    def parameters(self) -> Array:
        """The numbers of its `OpeningAhead`, (9 + 4 K,)."""
        normals, distances = self.gate.opening.sides
        outward = normals @ self.gate.plane_axes
        place = np.concatenate([self.gate.position, self.gate.normal])
        ahead = [self.reach, self.lateral_acceleration, self.turning]
        return np.concatenate([place, outward.ravel(), distances - FRAME_CLEARANCE, ahead])


def extent_of_attitude(ops: Ops, body: Ellipsoid, axes: Axes) -> Extent:
    """Return the extent of a body whose attitude is known.

    Args:
        ops: The arithmetic of the axes.
        body: The ellipsoid around the vehicle.
        axes: Its body axes in the world.
    """
    centre, semi_axes = body.centre.tolist(), body.semi_axes.tolist()

    def extent(outward: Vector) -> Scalar:
        along = [dot(axis, outward) for axis in axes]
        reached = sum(size * size * part * part for size, part in zip(semi_axes, along, strict=True))
        return sum(at * part for at, part in zip(centre, along, strict=True)) + ops.sqrt(reached)

    return extent


def extent_of_thrust(ops: Ops, revolved: Sequence[Scalar], thrust: Vector) -> Extent:
    """Return the largest extent of a body over all angles about its thrust axis.

    Args:
        ops: The arithmetic of the thrust.
        revolved: The numbers of `Revolved`, the body that contains the vehicle at every angle about its
            thrust axis.
        thrust: A vector of any length along the thrust axis.
    """
    wide, high, up, aside = revolved
    size = ops.sqrt(dot(thrust, thrust))

    def extent(outward: Vector) -> Scalar:
        along = dot(thrust, outward) / size
        squared = along * along
        return up * along + aside + ops.sqrt(wide * wide * (1.0 - squared) + high * high * squared)

    return extent
