"""The interface of obstacles, and the register of obstacles by name."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, TypeVar, cast, dataclass_transform

import numpy as np
from pydantic import Field

from aerobat.declaration import Label, Vector3, validated
from aerobat.environment.obstacles.convex_piece import ConvexPiece, ObstacleMotion
from aerobat.environment.obstacles.path_rows import PathRows
from aerobat.registry import Registry


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Obstacle(ABC):
    """Something solid in the world that stands or moves without turning, made of convex pieces.

    A custom obstacle inherits from this class, is registered by `@obstacle("its-name")`, and defines its
    `pieces`. Planners, certificates, flights and pictures use nothing else of it.
    """

    velocity: Vector3 = dataclasses.field(default_factory=lambda: np.zeros(3))  # [m/s] with which it moves
    # t [s], x, y, z [m] of a point of it: straight from row to row, in its place at the first
    path: PathRows = dataclasses.field(default_factory=lambda: np.zeros((0, 4)))

    kind: ClassVar[str] = ""  # its name in files, set when it is registered

    @property
    @abstractmethod
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The convex pieces, in the world."""

    @property
    def motion(self) -> ObstacleMotion | None:
        """The motion; None for an obstacle at rest."""
        return ObstacleMotion.of(self.velocity, self.path)


O = TypeVar("O", bound=Obstacle)  # noqa: E741 - an obstacle

OBSTACLES: Registry[Obstacle] = Registry(
    Obstacle,  # type: ignore[type-abstract]
    "obstacle",
    "aerobat.obstacles",
    dict.fromkeys(
        ("box", "capsule", "cylinder", "half-space", "polytope", "sphere"),
        "aerobat.environment.obstacles.shapes",
    )
    | {name: f"aerobat.environment.obstacles.{name}" for name in ("mesh", "grid")},
)


@validated
@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def obstacle(kind: Label) -> Callable[[type[O]], type[O]]:
    """Declare the class that follows and register it: `kind` is its name in problem files."""

    def register(cls: type[O]) -> type[O]:
        return cast(type[O], OBSTACLES.add(kind, cls))

    return register
