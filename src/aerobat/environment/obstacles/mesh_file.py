"""Mesh files as convex parts: STL, OBJ, PLY, glTF, read by trimesh.

Each convex connected part of the file is used unchanged. A part that is not convex is decomposed by CoACD.
The decomposition covers the part up to CoACD's threshold, relative to the part's size.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import FieldError, PathName, Positive, validated
from aerobat.documents import beside_document, read_named_file

MAX_FILE = 2**26  # bytes: a million triangles
MAX_PARTS = 1000
# formats with y up by their standard; files of other formats are assumed to have z up
Y_UP = {".glb", ".gltf"}
CONCAVITY = 0.05  # CoACD's threshold, its own default
FORMATS = (".stl", ".obj", ".ply", ".glb", ".gltf")


@validated
def mesh_parts(path: PathName, scale: Positive = 1.0) -> tuple[Array, ...]:
    """Return the corners of the convex parts of a mesh file [m], in the file's axes, z up, (n, 3) each.

    SpecError is raised for a file that cannot be read or is not closed, and where trimesh is not installed,
    or CoACD for parts that are not convex.

    Args:
        path: An STL, OBJ, PLY, GLB or glTF file. In a problem's file, the path is relative to that file's
            folder.
        scale: The length of the file's unit [m].
    """
    suffix = beside_document(path).suffix.lower()
    if suffix not in FORMATS:
        raise FieldError("", f": a mesh ends in {', '.join(FORMATS)}, got {path}; convert it")
    read_named_file(path, MAX_FILE)  # raises SpecError for unreadable files
    parts = [part for body in _bodies(path, suffix) for part in _convex_parts(path, body)]
    if not parts or len(parts) > MAX_PARTS:
        raise FieldError(
            "", f": {path} has {len(parts)} solid parts, from 1 to {MAX_PARTS} are allowed; export it anew"
        )
    turned = (part[:, [0, 2, 1]] * [1.0, -1.0, 1.0] if suffix in Y_UP else part for part in parts)
    return tuple(scale * part for part in turned)


def _bodies(path: PathName, suffix: str) -> list[Any]:
    """Return the connected parts of a file, each a closed mesh of trimesh."""
    trimesh = required_trimesh()
    bodies: list[Any] = []
    try:
        scene = trimesh.load_scene(str(beside_document(path)), file_type=suffix[1:])
        for mesh in scene.dump():
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                mesh.merge_vertices(merge_tex=True, merge_norm=True)
                bodies += mesh.split(only_watertight=False) if mesh.is_watertight else [None]
    except Exception as error:  # a parser of foreign formats may raise anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FieldError("", f": {path} is no mesh that trimesh reads ({reason}); export it anew") from None
    if None in bodies:
        raise FieldError("", f": {path} is not closed; fill its holes, so that it has an inside")
    return bodies


def _convex_parts(path: PathName, body: Any) -> list[Array]:
    """Return the corners of a connected mesh, or of its parts where it is not convex."""
    if body.is_convex:
        return [np.array(body.convex_hull.vertices)]
    try:
        import coacd
    except ImportError:
        remedy = "cut it into closed convex parts, or pip install coacd, which does that"
        raise FieldError("", f": {path} has a part that is not convex; {remedy}") from None
    coacd.set_log_level("error")
    cut = coacd.run_coacd(coacd.Mesh(body.vertices, body.faces), threshold=CONCAVITY, seed=0)
    return [np.array(vertices) for vertices, _ in cut]


def required_trimesh() -> Any:
    """Return the module trimesh. Raise FieldError where it is not installed."""
    try:
        import trimesh
    except ImportError:
        raise FieldError("", ': this needs trimesh; pip install "aerobat[meshes]"') from None
    if not (log := logging.getLogger("trimesh")).hasHandlers():
        log.addHandler(logging.NullHandler())  # or its tracebacks go to standard error
    return trimesh
