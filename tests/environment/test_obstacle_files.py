"""Obstacles in problem files: what is written is read back, meshes and maps are what their files hold."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import aerobat as ab
from aerobat.declaration import from_table, to_table
from aerobat.environment.obstacles import OBSTACLES
from obstacle_cases import walled_cruise

SIZE = np.array([1.0, 2.0, 3.0])


def problem_with(folder: Path, obstacle: str) -> ab.Problem:
    """The problem of a file in a folder, with one obstacle."""
    path = folder / "problem.toml"
    ends = 'maneuver.kind = "line"\nstart.position = [0, 0, 0]\ngoal.position = [4, 0, 0]\n'
    path.write_text(f"{ends}[[environment.obstacles]]\n{obstacle}\n", encoding="utf-8")
    return ab.load_problem(path)


def refusal(folder: Path, obstacle: str) -> str:
    with pytest.raises(ab.SpecError) as refused:
        problem_with(folder, obstacle)
    return str(refused.value).partition("environment.obstacles[0]")[2].removeprefix(".")


def box_mesh(path: Path, **moved: Any) -> None:
    made = trimesh.creation.box(SIZE)
    made.apply_translation(moved.get("to", (0.0, 0.0, 0.0)))
    made.export(path, file_type="stl_ascii" if moved.get("as_text") else None)


def test_the_path_of_what_moves_is_read_from_a_csv_file(tmp_path: Path) -> None:
    (tmp_path / "path.csv").write_text("t, x, y, z\n0, 1, 2, 3\n2, 1, 4, 3\n", encoding="utf-8")
    kind = 'kind = "sphere"\nposition = [9, 0, 0]\nradius = 0.5\npath = '
    (obstacle,) = problem_with(tmp_path, kind + '"path.csv"').environment.obstacles
    assert obstacle.motion is not None
    assert obstacle.motion.moved(np.array([-1.0, 0.5, 3.0])).tolist() == [[0, 0, 0], [0, 0.5, 0], [0, 2, 0]]
    assert OBSTACLES.read(to_table(obstacle)) == obstacle
    (tmp_path / "path.csv").write_text("0, 1, 2, 3\n2, x, 4, 3\n", encoding="utf-8")
    assert "has a row that is not four numbers" in refusal(tmp_path, kind + '"path.csv"')
    assert "there is no such file" in refusal(tmp_path, kind + '"other.csv"')
    assert "the time rising" in refusal(tmp_path, kind + "[[1, 0, 0, 0], [1, 1, 0, 0]]")
    assert "must be a CSV file's name or rows of t, x, y, z, got 3" in refusal(tmp_path, kind + "3")


@pytest.mark.parametrize("start", ["", "\ufeff", "# by a spreadsheet\n"])
def test_the_header_of_a_path_says_which_column_is_which(start: str, tmp_path: Path) -> None:
    kind = 'kind = "sphere"\nposition = [9, 0, 0]\nradius = 0.5\npath = "path.csv"'
    rows = {"t,x,y,z": "0,1,2,3\n2,1,4,3", '"t","z","y","x","yaw"': "0,3,2,1,0\n2,3,4,1,0"}
    paths = []
    for header, numbers in rows.items():
        (tmp_path / "path.csv").write_text(f"{start}{header}\n{numbers}\n", encoding="utf-8")
        paths += [obstacle.path.tolist() for obstacle in problem_with(tmp_path, kind).environment.obstacles]
    assert paths == [[[0.0, 1.0, 2.0, 3.0], [2.0, 1.0, 4.0, 3.0]]] * 2
    (tmp_path / "path.csv").write_text(f"{start}time,x,y,z\n0,1,2,3\n2,1,4,3\n", encoding="utf-8")
    assert "path.csv must have the columns t, x, y, z, got 'time,x,y,z'" in refusal(tmp_path, kind)
    (tmp_path / "path.csv").write_text(f"{start}t,x,y,z\n", encoding="utf-8")
    assert "two rows or more" in refusal(tmp_path, kind)
    (tmp_path / "path.csv").write_text(f"{start}0,1,2,3,4\n2,1,4,3,5\n", encoding="utf-8")
    assert "path.csv has a row that is not four numbers" in refusal(tmp_path, kind)


def directions() -> np.ndarray:
    made = np.random.default_rng(0).normal(size=(500, 3))
    return made / np.linalg.norm(made, axis=1, keepdims=True)


EACH = {
    "box": ab.Box((9.0, 2.0, 3.0), (1.0, 2.0, 3.0), heading=0.3, elevation=0.1, tilt=0.2, name="crate"),
    "sphere": ab.Sphere((9.0, 2.0, 3.0), 0.5),
    "capsule": ab.Capsule((9.0, 0.0, 0.0), (9.0, 2.0, 3.0), 0.5),
    "cylinder": ab.Cylinder((9.0, 0.0, 0.0), (9.0, 2.0, 3.0), 0.5),
    "half-space": ab.HalfSpace((0.0, 0.0, 5.0), (0.0, 0.0, -1.0)),
    "polytope": ab.Polytope(((9.0, 0.0, 0.0), (9.5, 0.0, 0.0), (9.0, 1.0, 0.0), (9.0, 0.0, 1.0))),
    "mesh": ab.Mesh((np.eye(4)[:, :3], 2.0 + np.eye(4)[:, :3]), (9.0, 0.0, 0.0), tilt=0.2),
    "grid": ab.Grid(((0, 0, 0, 1, 2, 3), (-4, 0, 0, -3, 1, 1)), 0.1, (9.0, 0.0, 0.0)),
}


def test_every_kind_of_obstacle_is_tried_here() -> None:
    assert sorted(EACH) == sorted(OBSTACLES)


@pytest.mark.parametrize("kind", EACH)
def test_an_obstacle_that_is_written_is_read_back(kind: str, tmp_path: Path) -> None:
    world = ab.Environment(obstacles=(EACH[kind],))
    problem = ab.Problem("world", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((4.0, 0.0, 0.0)), environment=world)
    ab.write_problem(problem, tmp_path / "world.toml")
    assert ab.load_problem(tmp_path / "world.toml") == problem
    assert from_table(ab.Problem, to_table(problem)) == problem


def test_a_plan_keeps_its_obstacles_and_walls(tmp_path: Path) -> None:
    walled_cruise().save(tmp_path / "cruise.plan")
    read = ab.load_plan(tmp_path / "cruise.plan").problem
    assert read == walled_cruise().problem
    assert len(read.surroundings.pieces) == len(walled_cruise().problem.surroundings.pieces)


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_a_box_as_a_mesh_reaches_as_far_as_the_box(suffix: str, tmp_path: Path) -> None:
    box_mesh(tmp_path / f"box.{suffix}")
    angles = "heading_deg = 30\nelevation_deg = 20\ntilt_deg = 10"
    read = problem_with(
        tmp_path, f'kind = "mesh"\nfile = "box.{suffix}"\nscale = 0.5\nposition = [2, 2, 2]\n{angles}'
    )
    size = SIZE[[0, 2, 1]] if suffix == "glb" else SIZE  # y is up there
    box = ab.Box((2.0, 2.0, 2.0), size / 2.0, *np.deg2rad([30.0, 20.0, 10.0]))
    (found,), (piece,) = read.environment.obstacles[0].pieces, box.pieces
    assert found.support(directions()) == pytest.approx(piece.support(directions()), abs=1e-6)


def test_a_reader_of_meshes_writes_nothing_to_standard_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(logging.root, "handlers", [])  # as in a process without pytest's own
    box_mesh(tmp_path / "box.stl", as_text=True)
    text = (tmp_path / "box.stl").read_text()
    (tmp_path / "box.stl").write_text(text.replace("facet normal", "facet normal x", 1))
    ab.mesh_parts(tmp_path / "box.stl")
    assert capsys.readouterr().err == ""


def test_what_is_up_in_a_gltf_file_is_up_in_the_world(tmp_path: Path) -> None:
    box_mesh(tmp_path / "high.glb", to=(0.0, 10.0, 0.0))
    (part,) = ab.mesh_parts(tmp_path / "high.glb")
    assert part.mean(axis=0) == pytest.approx([0.0, 0.0, 10.0])


def test_parts_of_a_mesh_that_do_not_touch_are_pieces_of_their_own(tmp_path: Path) -> None:
    boxes = [trimesh.creation.box(SIZE), trimesh.creation.box(SIZE).apply_translation((5.0, 0.0, 0.0))]
    trimesh.util.concatenate(boxes).export(tmp_path / "two.stl")
    parts = ab.mesh_parts(tmp_path / "two.stl")
    assert sorted(part.mean(axis=0)[0] for part in parts) == pytest.approx([0.0, 5.0])


def test_a_mesh_that_is_not_convex_is_cut_into_parts_that_are_by_coacd(tmp_path: Path) -> None:
    """An L of two boxes: its parts hold both arms and leave the corner between them free."""
    pytest.importorskip("coacd")
    corners = np.array([[0, 0], [2, 0], [2, 0.5], [0.5, 0.5], [0.5, 2], [0, 2]], dtype=float)
    trimesh.Trimesh(*_prism(corners)).export(tmp_path / "l.stl")
    solids = [ab.Polytope(part).pieces[0] for part in ab.mesh_parts(tmp_path / "l.stl")]
    pieces = ab.Environment(obstacles=tuple(ab.Polytope(solid.points) for solid in solids)).pieces
    for arm in ((1.8, 0.2, 0.5), (0.2, 1.8, 0.5), (0.2, 0.2, 0.5)):
        assert pieces.holding(np.array(arm)) is not None
    assert pieces.holding(np.array([1.2, 1.2, 0.5])) is None


def _prism(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a prism of height one over an L, whose first corner sees all others."""
    n = len(corners)
    low, high = (np.column_stack([corners, np.full(n, z)]) for z in (0.0, 1.0))
    faces = [[0, k + 1, k] for k in range(1, n - 1)] + [[n, n + k, n + k + 1] for k in range(1, n - 1)]
    for k in range(n):
        after = (k + 1) % n
        faces += [[k, after, n + after], [k, n + after, n + k]]
    return np.concatenate([low, high]), np.array(faces)


def test_a_mesh_that_is_not_closed_is_refused(tmp_path: Path) -> None:
    leaking = trimesh.creation.box(SIZE)
    leaking.faces = leaking.faces[1:]
    leaking.export(tmp_path / "open.stl")
    said = refusal(tmp_path, 'kind = "mesh"\nfile = "open.stl"')
    assert said == "file: open.stl is not closed; fill its holes, so that it has an inside"


@pytest.mark.parametrize(
    ("module", "remedy"), [("trimesh", "aerobat[meshes]"), ("coacd", "pip install coacd")]
)
def test_what_is_not_installed_is_named_with_its_remedy(
    module: str, remedy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trimesh.creation.annulus(1.0, 2.0, 0.5, sections=8).export(tmp_path / "ring.stl")
    monkeypatch.setitem(sys.modules, module, None)
    assert remedy in refusal(tmp_path, 'kind = "mesh"\nfile = "ring.stl"')


@pytest.mark.parametrize(
    ("obstacle", "said"),
    [
        ('kind = "mesh"', "file is missing; add it, or parts"),
        ('kind = "mesh"\nfile = 3', "file must be the path of a file, got 3"),
        ('kind = "mesh"\nfile = "hall.dwg"', "file: a mesh ends in .stl"),
        ('kind = "mesh"\nfile = "bad.stl"', "file: bad.stl has 0 solid parts"),
        ('kind = "mesh"\nscale = 2', "scale is of a file; give file"),
        ('kind = "mesh"\nfile = "bad.stl"\nscale = -1', "scale must be positive, got -1"),
        ('kind = "mesh"\nparts = []', "parts must be one part or more"),
        ('kind = "grid"\ncell = 0.1', "file is missing; add it, or boxes"),
        ('kind = "grid"\nfile = "bad.npy"', "cell is missing; add it"),
        ('kind = "grid"\nfile = "bad.npy"\ncell = 0', "cell must be positive, got 0"),
        ('kind = "grid"\nfile = "bad.npy"\ncell = 1', "file: bad.npy is no whole .npy file of numbers"),
        ('kind = "grid"\nfile = "bad.stl"\ncell = 1', "file: a grid or a cloud ends in .npy or .ply"),
        ('kind = "grid"\nfile = "flat.npy"\ncell = 1', "file: a map is a grid with three axes"),
        ('kind = "grid"\nboxes = []\ncell = 1', "boxes must be one box or more"),
        ('kind = "grid"\nboxes = [[0, 0, 0, 1, 1, 0]]\ncell = 1', "boxes must be boxes of six whole"),
        ('kind = "box"\nposition = [9, 0, 0]\nsize = [1, 0, 1]', "size must be three positive numbers"),
        ('kind = "polytope"\npoints = [[0, 0, 0]]', "points must be four points or more"),
        ('kind = "polytope"\npoints = []', "points must be four points or more"),
        ('kind = "mesh"\nparts = [[]]', "parts[0] must be four points or more"),
        ('kind = "grid"\nfile = "free.npy"\ncell = 1', "file: free.npy has no occupied cell"),
        ('kind = "bos"', "kind must be one of your own"),
        ('kind = "sphere"\nposition = [9, 0, 0]\nradius = -1', "radius"),
    ],
)
def test_a_bad_obstacle_is_refused_in_a_sentence_that_names_the_field(
    obstacle: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / "bad.stl").write_text("nothing")
    (tmp_path / "bad.npy").write_bytes(b"nothing")
    np.save(tmp_path / "flat.npy", np.zeros((3, 4)))
    np.save(tmp_path / "free.npy", np.zeros((3, 4, 5)))
    assert refusal(tmp_path, obstacle).startswith(said)


@pytest.mark.parametrize("place", ["start.position", "goal.position", "gates[0].position"])
def test_an_end_or_a_gate_inside_an_obstacle_is_refused(place: str) -> None:
    at = {"start.position": 0.0, "goal.position": 4.0, "gates[0].position": 2.0}[place]
    world = ab.Environment(obstacles=(ab.Sphere((at, 0.0, 0.0), 0.5, name="the ball"),))
    ends, gates = (
        (ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((4.0, 0.0, 0.0))),
        (ab.tilted_gate((2.0, 0.0, 0.0)),),
    )
    with pytest.raises(ab.SpecError, match=r"it lies in the ball, an obstacle; move one of them") as refused:
        ab.Problem("ball", *ends, gates=gates, environment=world)
    assert place in str(refused.value)


@given(arrays(np.bool_, st.tuples(*[st.integers(1, 6)] * 3)))
def test_the_boxes_of_a_grid_are_exactly_its_occupied_cells(occupied: np.ndarray) -> None:
    filled = np.zeros(occupied.shape, dtype=int)
    for x0, y0, z0, x1, y1, z1 in ab.occupied_boxes(occupied).tolist():
        filled[x0:x1, y0:y1, z0:z1] += 1
    assert (filled == occupied).all(), "each once, and no other"


def test_a_full_grid_is_one_box() -> None:
    assert ab.occupied_boxes(np.ones((4, 5, 6))).tolist() == [[0, 0, 0, 4, 5, 6]]


@pytest.mark.parametrize("suffix", ["npy", "ply"])
def test_every_point_of_a_cloud_lies_in_an_occupied_cell_and_every_cell_has_one(
    suffix: str, tmp_path: Path
) -> None:
    points = np.random.default_rng(2).uniform(1.0, 3.0, (300, 3))
    if suffix == "npy":
        np.save(tmp_path / "cloud.npy", points)
    else:
        trimesh.PointCloud(points).export(tmp_path / "cloud.ply")
    grid = f'kind = "grid"\nfile = "cloud.{suffix}"\ncell = 0.25\norigin = [0.1, 0, 0]'
    pieces = problem_with(tmp_path, grid).environment.obstacles[0].pieces
    boxes = np.array([piece.box for piece in pieces])
    inside = ((points >= boxes[:, :1] - 1e-6) & (points <= boxes[:, 1:] + 1e-6)).all(axis=-1)
    assert inside.any(axis=0).all()
    cells = np.prod((boxes[:, 1] - boxes[:, 0]) / 0.25, axis=-1).sum()
    assert round(cells) == len(np.unique(np.floor((points - [0.1, 0.0, 0.0]) / 0.25), axis=0))


def test_a_file_counts_from_the_folder_of_the_problem_that_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "meshes").mkdir()
    box_mesh(tmp_path / "meshes" / "box.stl")
    monkeypatch.chdir(tmp_path / "elsewhere")
    problem = problem_with(tmp_path, 'kind = "mesh"\nfile = "meshes/box.stl"\nposition = [9, 0, 0]')
    ab.write_problem(problem, tmp_path / "elsewhere" / "same.toml")
    (tmp_path / "meshes" / "box.stl").unlink()
    assert ab.load_problem("./same.toml").environment == problem.environment, "it holds the parts"


def test_an_obstacle_of_ones_own_stands_in_files(tmp_path: Path) -> None:
    @ab.obstacle("arch")
    class Arch(ab.Obstacle):
        """Two pillars and a beam."""

        width: float

        @property
        def pieces(self) -> tuple[Any, ...]:
            """The three boxes."""
            boxes = (
                ab.Box((2.0, self.width / 2.0, 1.0), (0.2, 0.2, 2.0)),
                ab.Box((2.0, -self.width / 2.0, 1.0), (0.2, 0.2, 2.0)),
                ab.Box((2.0, 0.0, 2.0), (0.2, self.width, 0.2)),
            )
            return tuple(piece for box in boxes for piece in box.pieces)

    problem = problem_with(tmp_path, 'kind = "arch"\nwidth = 2.0')
    assert problem.environment.obstacles == (Arch(2.0),)
    assert len(problem.surroundings.pieces) == 3


def test_obstacles_of_one_name_are_told_apart_by_numbers() -> None:
    balls = tuple(ab.Sphere(position=(float(x), 0.0, 0.0), radius=0.1) for x in range(3))
    world = ab.Environment(obstacles=(*balls, ab.Sphere(position=(9.0, 0.0, 0.0), radius=0.1, name="moon")))
    assert [piece.name for piece in world.pieces.pieces] == ["sphere 1", "sphere 2", "sphere 3", "moon"]
