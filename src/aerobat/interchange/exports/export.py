"""A plan in the files of other systems, each with its loss."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aerobat.declaration import PathName, Positive, unknown_name, validated
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.interchange.columns import ALL, columns_text
from aerobat.interchange.exports.bags import ROS2_BAG, mcap, ros1_bag, ros2_bag
from aerobat.interchange.exports.crazyflie import PIECES, crazyflie_pieces
from aerobat.interchange.exports.gltf import blender_scene
from aerobat.interchange.exports.loss import Content, ExportRows, Loss
from aerobat.interchange.exports.mjcf import mujoco_scene
from aerobat.interchange.exports.px4 import SETPOINTS, px4_setpoints
from aerobat.planning import Plan
from aerobat.storage import require_replaceable, whole_folder, write_whole

MAX_ROWS = 100_000  # a quarter of an hour at 100 a second; a bag of them takes a minute


@dataclass(frozen=True)
class Format:
    """A format that plans are exported to."""

    content: Callable[[Plan, float], Content]
    suffix: str = ""  # of the file, if the format is one file
    files: tuple[str, ...] = ()  # in a folder, if the format has several
    rate: float | None = 100.0  # [1/s] of its rows, by default; None for a format without rows


def _table(plan: Plan, rate: float) -> Content:
    """Return all columns, as in a run's plan.csv. The plan between rows is lost."""
    rows = ExportRows.of(reference(plan, rate=rate))
    return Content((columns_text(plan, ALL, rate).encode(),), rows.loss(plan))


FORMATS: Mapping[str, Format] = {
    "csv": Format(_table, ".csv"),
    "crazyflie": Format(crazyflie_pieces, files=PIECES, rate=None),
    "ros1-bag": Format(ros1_bag, ".bag"),
    "ros2-bag": Format(ros2_bag, files=ROS2_BAG),
    "mcap": Format(mcap, ".mcap"),
    "px4": Format(px4_setpoints, files=SETPOINTS, rate=250.0),  # its attitude control's own
    "blender": Format(blender_scene, ".glb"),
    "mujoco": Format(mujoco_scene, ".xml"),
}


@dataclass(frozen=True)
class Export:
    """The files that an export wrote, and their loss."""

    format: str
    files: tuple[Path, ...]
    loss: Loss

    def __str__(self) -> str:
        """Return one line of text."""
        return f"{', '.join(map(str, self.files))}: {self.loss}"


@validated
def export(plan: Plan, path: PathName, to: str, rate: Positive | None = None) -> Export:
    """Write a plan for its vehicle as another system reads it, and return the files and their loss.

    An earlier file with the format's suffix is replaced, and a folder that holds only an earlier export. All
    files appear, or none. Frames, units and readers of each format are in docs/exports.md.

    Raises SpecError for an unknown format, a plan without a vehicle or one that the format cannot hold, a
    path with another suffix and a place that cannot be written; BackendMissing for bags without rosbags.

    Args:
        plan: The plan to export.
        path: The file to write, with the format's suffix; of crazyflie, px4 and ros2-bag a folder.
        to: csv, crazyflie, ros1-bag, ros2-bag, mcap, px4, blender or mujoco.
        rate: Rows a second [1/s], by default 100, of px4 250; crazyflie has none.
    """
    if to not in FORMATS:
        raise unknown_name("format", to, list(FORMATS))
    form = FORMATS[to]
    if plan.vehicle is None:
        raise SpecError("vehicle is missing: attitudes follow from one, and the plan has none; plan for one")
    if form.rate is None and rate is not None:
        raise SpecError(f"rate is for rows, and {to} has none; leave it out")
    if form.rate is not None and plan.duration * (rate or form.rate) > MAX_ROWS:
        raise SpecError(
            f"rate must ask for {MAX_ROWS} rows at most over {plan.duration:.4g} s; ask for fewer"
        )
    target = Path(path)
    _require_place(target, to, form)
    content = form.content(plan, rate or form.rate or 0.0)
    if form.suffix:
        (made,) = content.files
        write_whole(target, made)
        return Export(to, (target,), content.loss)
    with whole_folder(target, form.files.__contains__) as folder:
        for name, made in zip(form.files, content.files, strict=True):
            (folder / name).write_bytes(made)
    return Export(to, tuple(target / name for name in form.files), content.loss)


def _require_place(target: Path, to: str, form: Format) -> None:
    """Raise SpecError for a path that the format does not fit, before anything is made."""
    if form.files:
        require_replaceable(target, form.files.__contains__)
    elif target.suffix != form.suffix:
        raise SpecError(f"a file of {to} ends in {form.suffix}, got {target}")
