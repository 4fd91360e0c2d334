"""Obstacles from mesh files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from aerobat.declaration import Angle, FieldError, Label, Vector3, positive, within_field
from aerobat.documents import file_name
from aerobat.environment.obstacles.attitude import ATTITUDE, axes_of
from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.mesh_file import mesh_parts
from aerobat.environment.obstacles.obstacle import Obstacle, obstacle
from aerobat.environment.obstacles.shapes import Points


@obstacle("mesh")
class Mesh(Obstacle):
    """A solid of convex parts, as a mesh file has them.

    A problem's file names the mesh file. Plans and runs store the parts themselves, so later changes of the
    mesh file do not affect them.
    """

    parts: tuple[Points, ...]  # [m] the corners of each convex part, in the mesh's own axes
    position: Vector3 = field(default_factory=lambda: np.zeros(3))  # [m] where the mesh's origin stands
    heading: Angle = 0.0  # [rad] of the mesh's x axis, from x toward y
    elevation: Angle = 0.0  # [rad] climb of that axis
    tilt: Angle = 0.0  # [rad] roll about that axis, right-handed
    name: Label = "mesh"  # by which findings name it

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "file": "an STL, OBJ, PLY, GLB or glTF file, from the problem's folder, instead of `parts`",
        "scale": "[m] the length of the file's unit (1)",
        **ATTITUDE,
    }

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace the file by its parts."""
        if "file" in table:
            if "parts" in table:
                raise FieldError("file", "stands beside parts; give one or the other")
            scale = positive(table.pop("scale", 1.0), "scale")
            with within_field("file"):
                table["parts"] = mesh_parts(file_name(table.pop("file")), scale)
        elif "scale" in table:
            raise FieldError("scale", "is of a file; give file, or leave it out")
        elif "parts" not in table:
            raise FieldError("file", "is missing; add it, or parts")
        return table

    def __post_init__(self) -> None:
        """Raise FieldError for a mesh without parts."""
        if not self.parts:
            raise FieldError("parts", "must be one part or more")

    @property
    def pieces(self) -> tuple[ConvexPiece, ...]:
        """The parts, in the world."""
        axes = axes_of(self.heading, self.elevation, self.tilt)
        return tuple(ConvexPiece(self.position + part @ axes.T, name=self.name) for part in self.parts)
