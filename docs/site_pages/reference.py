"""The reference of all public names: a page a room, from `aerobat/__init__.pyi` and the docstrings."""

import ast
import inspect
from pathlib import Path

import aerobat

TITLES = {
    "problem": "Problems: gates, maneuvers, stages, limits",
    "vehicle": "Vehicles",
    "environment": "Environment and conditions",
    "planning": "Planning",
    "trajectory": "Trajectories",
    "flatness": "Flatness",
    "certification": "Certificates",
    "control": "Control",
    "simulation": "Flights",
    "estimation": "Estimation",
    "evaluation": "Scores",
    "studies": "Studies of many plans and flights",
    "reporting": "Pictures, videos and tables",
    "viewer": "Replays",
    "interchange": "Files of other systems",
    "declaration": "Plugins",
    "states": "States",
    "errors": "Errors",
}


def public_names() -> dict[str, list[str]]:
    """Every public name, by the room that it comes from, in the order of the stub."""
    stub = Path(aerobat.__file__).with_name("__init__.pyi")
    rooms: dict[str, list[str]] = {}
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            room = node.module.partition(".")[0]
            rooms.setdefault(room, []).extend(alias.name for alias in node.names)
    return rooms


def page(room: str, names: list[str]) -> str:
    """The page of a room: functions, then classes."""
    title = TITLES.get(room, room.capitalize())
    parts = [f"# {title}\n"]
    for name in sorted(names, key=lambda name: (inspect.isclass(getattr(aerobat, name)), name.lower())):
        directive = "autoclass" if inspect.isclass(getattr(aerobat, name)) else "autofunction"
        members = "\n   :members:" if directive == "autoclass" else ""
        parts.append(f"## {name}\n\n```{{eval-rst}}\n.. {directive}:: aerobat.{name}{members}\n```\n")
    return "\n".join(parts)


def write(folder: Path) -> None:
    """Write all pages, and the one that leads to them."""
    rooms = public_names()
    target = folder / "reference"
    target.mkdir(parents=True, exist_ok=True)
    for room, names in rooms.items():
        (target / f"{room}.md").write_text(page(room, names), encoding="utf-8")
    ordered = [*(room for room in TITLES if room in rooms), *(room for room in rooms if room not in TITLES)]
    listed = "\n".join(ordered)
    (target / "index.md").write_text(
        "# Reference\n\nEvery public name of `import aerobat as ab`, by the room that it comes from. SI "
        "units, world ENU, body FLU, quaternions (w, x, y, z) body to world.\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n",
        encoding="utf-8",
    )
