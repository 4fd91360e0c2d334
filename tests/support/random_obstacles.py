"""Obstacles of every simple kind, drawn at random."""

import numpy as np

from aerobat.environment.obstacles import OBSTACLES, Obstacle

KINDS = ("box", "sphere", "capsule", "cylinder", "half-space", "polytope")


def random_obstacle(rng: np.random.Generator, kind: str, place: np.ndarray, size: float = 1.0) -> Obstacle:
    """One at a place (3,) [m], about `size` [m] large."""
    cls, other = OBSTACLES[kind], place + size * rng.normal(size=3)
    if kind == "box":
        angles = dict(zip(("heading", "elevation", "tilt"), rng.uniform(-1.5, 1.5, 3), strict=True))
        return cls(position=place, size=size * rng.uniform(0.1, 2.0, 3), **angles)
    if kind == "sphere":
        return cls(position=place, radius=size * rng.uniform(0.1, 1.0))
    if kind == "half-space":
        return cls(position=place, normal=rng.normal(size=3))
    if kind == "polytope":
        return cls(points=place + size * rng.normal(size=(10, 3)))
    return cls(start=place, end=other, radius=size * rng.uniform(0.1, 1.0))
