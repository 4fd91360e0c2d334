"""Files of occupancy grids and point clouds: .npy, and .ply by trimesh."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import FieldError
from aerobat.documents import beside_document, read_named_file
from aerobat.environment.obstacles.mesh_file import required_trimesh

MAX_FILE = 2**28  # bytes: ten million points


def read_values(path: str) -> NDArray[Any]:
    """Return the content of a file: the cells of a grid, or points (n, 3).

    FieldError, about a whole field, is raised for a file that holds neither.
    """
    content = read_named_file(path, MAX_FILE)
    suffix = Path(path).suffix.lower()
    if suffix not in (".npy", ".ply"):
        raise FieldError("", f": a grid or a cloud ends in .npy or .ply, got {path}; convert it")
    try:
        if suffix == ".npy":
            return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
        return _points(path)
    except FieldError:
        raise
    except Exception as error:  # a parser of foreign formats may raise anything
        raise FieldError(
            "", f": {path} is no whole {suffix} file of numbers ({error}); save it again"
        ) from None


def _points(path: str) -> NDArray[Any]:
    """Return the points of a .ply file, (n, 3)."""
    scene = required_trimesh().load_scene(str(beside_document(path)), file_type="ply")
    clouds = [np.asarray(each.vertices) for each in scene.dump()]
    return np.concatenate([*clouds, np.zeros((0, 3))])
