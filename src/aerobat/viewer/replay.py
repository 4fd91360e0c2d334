"""Replays: pages that show plans and flights, each one file that loads nothing from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from aerobat.declaration import PathName, validated
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.simulation import Flight
from aerobat.storage import write_whole
from aerobat.vehicle import Vehicle
from aerobat.viewer.document import MARK, document
from aerobat.viewer.scene import Scene, scene_of

HEAD = 1000  # first characters of a page, which include MARK


@dataclass(frozen=True, repr=False)
class Replay:
    """A page that replays a scene; notebooks show it inline."""

    scene: Scene = field(compare=False)  # all of it is in the page
    html: str

    def __repr__(self) -> str:
        """The scene's title and the page's size."""
        return f"Replay({self.scene.title}, {len(self.html) / 1e6:.2f} MB)"

    def _repr_html_(self) -> str:
        """The page in a frame, so that its styles and scripts do not affect the notebook."""
        return inline_frame(f'srcdoc="{escape(self.html, quote=True)}"')


def inline_frame(content: str) -> str:
    """Return the HTML of a frame for a notebook; `content` is the attribute that holds or names the page."""
    style = "width:100%;border:1px solid #dfe6ec;border-radius:8px"
    return f'<iframe style="{style}" height="640" {content}></iframe>'


@validated
def view(shown: Flight | Plan, plan: Plan | None = None, vehicle: Vehicle | str | None = None) -> Replay:
    """Return the page that replays a flight, a batch of flights, or a plan; a notebook shows it inline.

    With the plan of a flight its gates and stages are shown, and whether it passed them. Raises SpecError
    where there is nothing to show or the vehicle is not known.

    Args:
        shown: What is looked at.
        plan: What was flown.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
    """
    scene = scene_of(shown, plan, vehicle)
    return Replay(scene, document(scene))


@validated
def write_replay(
    shown: Flight | Plan,
    path: PathName,
    plan: Plan | None = None,
    vehicle: Vehicle | str | None = None,
) -> None:
    """Write the page of `view` as one HTML file, whole or not at all; it opens from the disk.

    An earlier replay is replaced. Raises SpecError as `view` does, for a file that is something else, and
    where it cannot be written.

    Args:
        shown: What is looked at.
        path: Of the file.
        plan: What was flown.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
    """
    save_replay(view(shown, plan, vehicle), path)


def save_replay(replay: Replay, path: PathName) -> None:
    """Write a page as `write_replay` does."""
    require_replaceable(path)
    write_whole(path, replay.html)


def require_replaceable(path: PathName) -> None:
    """Raise SpecError if a file exists at the path and is no replay."""
    try:
        with Path(path).open(encoding="utf-8") as file:
            found = MARK in file.read(HEAD)
    except (IsADirectoryError, ValueError):  # a folder, bytes that are no text
        found = False
    except OSError:  # nothing is there, or writing says why not
        return
    if not found:
        raise SpecError(f"{path} is there already and no replay; name another file")
