"""Gravity, wind, ground and obstacles: the environment of a problem, independent of the vehicle."""

from __future__ import annotations

from collections import Counter
from dataclasses import field, replace
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import Finite, Gravity, Vector3, declared
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.obstacle import OBSTACLES, Obstacle
from aerobat.environment.obstacles.separation import Pieces
from aerobat.so3 import UP
from aerobat.states import STANDARD_GRAVITY


@declared
class Environment:
    """The world around the vehicle, ENU axes.

    Drag acts on the velocity relative to the wind. The ground is a lower bound of paths; without a ground
    there is none. The whole body must stay clear of obstacles.
    """

    gravity: Gravity = STANDARD_GRAVITY  # [m/s²] along -z
    wind: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m/s] velocity of the air
    ground: Finite | None = None  # [m] height z that no path goes below; left out, no ground
    obstacles: tuple[Annotated[Obstacle, PlainValidator(OBSTACLES.read)], ...] = ()  # what stands in the way

    @property
    def weight(self) -> Array:
        """The specific thrust [m/s²] in hover, g e3, (3,)."""
        return self.gravity * UP

    @cached_property
    def pieces(self) -> Pieces:
        """The convex pieces of all obstacles; names shared by several obstacles are numbered."""
        solids = [
            tuple(replace(piece, motion=each.motion) for piece in each.pieces) for each in self.obstacles
        ]
        shared = Counter(pieces[0].name for pieces in solids if pieces)
        seen: Counter[str] = Counter()
        found: list[ConvexPiece] = []
        for pieces in solids:
            name = pieces[0].name if pieces else ""
            seen[name] += 1
            if shared[name] > 1:
                pieces = tuple(replace(piece, name=f"{name} {seen[name]}") for piece in pieces)
            found += pieces
        return Pieces(tuple(found))
