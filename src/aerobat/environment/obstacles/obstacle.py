"""The interface of obstacles, and the register of obstacles by name."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar, TypeVar, cast, dataclass_transform

from pydantic import Field

from aerobat.declaration import Label, Registry, validated
from aerobat.environment.obstacles.convex_piece import ConvexPiece


class Obstacle(ABC):
    """Something solid that stands in the world, made of convex pieces.

    An obstacle of one's own inherits from this class, is registered by `@obstacle("its-name")`, and says its
    pieces: planners, certificates, flights and pictures know nothing else of it.
    """

    kind: ClassVar[str] = ""  # its name in files, set when it is registered

    @property
    @abstractmethod
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The convex pieces, in the world."""


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
