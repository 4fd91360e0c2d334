"""Distances between ellipsoids and obstacles by FCL, the Flexible Collision Library."""

import fcl
import numpy as np
from scipy.spatial import ConvexHull

from aerobat import so3
from aerobat.environment.obstacles import Obstacle

EXACT = 1e-4  # [m] what FCL's distances of curved bodies are good for; larger than they are, if anything


def solid(obstacle: Obstacle) -> fcl.CollisionObject:
    """A declared obstacle, made of FCL's own shapes."""
    if obstacle.kind == "box":
        return fcl.CollisionObject(fcl.Box(*obstacle.size), fcl.Transform(obstacle.axes, obstacle.position))
    if obstacle.kind == "sphere":
        return fcl.CollisionObject(fcl.Sphere(obstacle.radius), fcl.Transform(np.eye(3), obstacle.position))
    if obstacle.kind in ("capsule", "cylinder"):
        along = obstacle.end - obstacle.start
        length = np.linalg.norm(along)
        shape = {"capsule": fcl.Capsule, "cylinder": fcl.Cylinder}[obstacle.kind](obstacle.radius, length)
        turned = so3.axes(so3.smallest_rotation(so3.UP, along / length))
        return fcl.CollisionObject(shape, fcl.Transform(turned, (obstacle.start + obstacle.end) / 2))
    return convex(np.concatenate([piece.points for piece in obstacle.pieces]))


def convex(points: np.ndarray) -> fcl.CollisionObject:
    """The hull of points (k, 3)."""
    hull = ConvexHull(points)
    count = len(hull.simplices)
    faces = np.concatenate([np.full((count, 1), 3), hull.simplices], axis=1).ravel()
    return fcl.CollisionObject(fcl.Convex(points, count, faces), fcl.Transform())


def distance(
    other: fcl.CollisionObject, centre: np.ndarray, axes: np.ndarray, semi_axes: np.ndarray
) -> float:
    """Of an ellipsoid with these columns as axes; negative where it overlaps, by nothing that counts."""
    return gap_between(other, fcl.CollisionObject(fcl.Ellipsoid(*semi_axes), fcl.Transform(axes, centre)))


def gap_between(one: fcl.CollisionObject, other: fcl.CollisionObject) -> float:
    """The distance of any two; negative where they overlap, by nothing that counts."""
    request = fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_LIBCCD)
    return float(fcl.distance(one, other, request, fcl.DistanceResult()))
