"""Write docs/files.md from the declarations: `uv run python docs/make_files_page.py`.

A field's type and default come from its declaration, unit and meaning from the comment beside it.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import types
from collections.abc import Sequence
from enum import Enum
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np

from aerobat.control import Controller
from aerobat.environment import (
    Battery,
    Dispersion,
    Environment,
    Gusts,
    HandOff,
    Imu,
    MotionCapture,
    Obstacle,
    Outage,
)
from aerobat.environment.obstacles import OBSTACLES
from aerobat.problem import (
    Attitude,
    Ball,
    Condition,
    EndState,
    Figure,
    Gate,
    GatePassage,
    Heading,
    Limits,
    Maneuver,
    Problem,
    Stage,
    Tolerance,
    Wall,
    Waypoint,
    registered_maneuvers,
)
from aerobat.vehicle import Ellipsoid, Rotor, Vehicle

PAGE = Path(__file__).parent / "files.md"
ANNOTATED = PAGE.parent.parent / "examples" / "vehicles" / "annotated.toml"
WRITTEN = "## The files of a run"  # from here on the page is written by hand

PLACES = {  # where each class stands in a file
    EndState: "`[start]` and `[goal]`",
    Heading: "`[heading]`: where the body's x axis points along the way; [how](how-to/heading.md)",
    Gate: "`[[gates]]`, or `[gate]` for a single one",
    Wall: "`wall` of a gate, an obstacle around its opening; `wall = true` for one of the usual size",
    Limits: "`[limits]`, at the ends of intervals and, planned with a vehicle, between them",
    Environment: "`[environment]`",
    Tolerance: "`[tolerance]`: what a flight keeps to that went well, where no gate or radius says it",
    GatePassage: "`[maneuver.passage]`",
    Stage: "`[[maneuver.stages]]`",
    Attitude: "`attitude` of a stage: where the thrust points, its drag counted",
    Ball: "`ball` of a stage: where it is, within a radius",
    Figure: "A figure of `[maneuver]`, or of the `elements` of a course; what each is: [courses](courses.md)",
    Condition: "`conditions` and `path_constraints`: lower ≤ direction · quantity ≤ upper",
    Waypoint: "`[[maneuver.waypoints]]`",
    Rotor: "`[[rotors]]`",
    Imu: "`[imu]`",
    MotionCapture: "`[motion_capture]`",
    Outage: "`[motion_capture.outage]`",
    HandOff: "`[motion_capture.hand_off]`",
    Gusts: "`[gusts]`",
    Battery: "`[battery]`",
    Ellipsoid: "`body`: what passes gates, propellers included",
    Controller: "`[controller]` of a vehicle: what tracks its paths",
}
INTRODUCTION = """# Files

SI units; the world is ENU (x east, y north, z up), the body FLU (x forward, y left, z up, thrust along +z).
Keys without a default must be given, themselves or by a shorthand. An unknown key is an error that names it.
`aerobat.load_problem`, `load_vehicle` and `load_dispersion` read these files, `write_problem`,
`write_vehicle` and `write_dispersion` write them, exactly. From Python, the classes below take the same
fields, without the shorthands.

This page is written by `docs/make_files_page.py` from the declarations in the code.
"""
STAGES = """
```toml
[maneuver]
kind = "stages"

[[maneuver.stages]]
name = "knife edge"
conditions = [
    { quantity = "velocity", direction = [0.0, 0.0, 1.0], lower = 0.0 },
]
attitude = { up = [1.0, 0.0, 0.0], tolerance_deg = 3.0, min_thrust = 10.0 }
at = [0.3, 0.6]
```
"""
OBSTACLE_KINDS = """### Obstacle

`[[environment.obstacles]]`: what is solid and stands still. Each has a `kind`, and what that kind takes. A
start, a goal or a gate whose middle lies in an obstacle is refused. [A world with walls](how-to/obstacles.md)
has examples, and [kinds of one's own](../CONTRIBUTING.md#add-an-obstacle) are plugins.
"""
WAYPOINTS = """
With the times of all waypoints and `duration`, `--planner min-snap` searches as in the paper's Section V-D,
by 0.1 s at the first waypoint.

```toml
[maneuver]
kind = "waypoints"
waypoints = [
    { position = [2.0, 0.0, 1.0] },
    { position = { x = 4.0, z = 2.0 }, up = [0.0, 0.0, -1.0], thrust = 12.0 },
]
```
"""
VEHICLE = """
`aerobat show agile-quad --out mine.toml` writes a built-in vehicle's file to begin with, the source of
every number beside it; `aerobat show mine.toml` says how yours is understood, and what looks wrong. All
that a file may hold, [annotated](../examples/vehicles/annotated.toml):
"""
ROTOR = """
A rotor's own keys go before those of `[rotor_defaults]`, by whichever keys they are given. In N/rpm², `k_f`
is a number 91.19 times smaller.

Rotors are commanded in thrust. What a data sheet says beyond its ends is lost: the curve between idle and
full throttle, which a motor controller is taken to undo; a torque that is not proportional to thrust; the
voltage that sags; and that it is the speed that lags, by which a large step of thrust rises later and falls
sooner than here.

A rotor with `max_thrust = 0` is dead. Where the others still hold a level hover and yaw, plans, proofs and
flights are theirs, counted without it; where they do not, one sentence says which of them would have to
stop, and what remains. A hexarotor whose spins alternate keeps no control of yaw without any of its rotors,
one with spins 1, 1, -1, -1, 1, -1 does without any of the first four; an octorotor does without any.
"""
BODY = """
Left out, it is a flat ellipsoid in the middle between the rotors that encloses all propellers, its half
height a fifth of its half width. Gates are judged by it: all that it sweeps of a gate's plane is to lie
within the opening. A vehicle that does not fit at all is refused before anything is planned.
"""
CONTROLLER = """
Left out, every field has its default; a flight that names another controller is flown by that one.
`aerobat tune flip-roll --vehicle mine.toml --conditions lab --out tuned.toml` finds gains and writes them.
"""
IMPORT = """
### From URDF and SDF

`aerobat show iris.sdf --out iris.toml`, or `aerobat.import_vehicle("iris.sdf")`, reads mass, inertia,
centre of mass and rotors of a robot's description; `--vehicle iris.sdf` flies it as it is.

| there | here |
| --- | --- |
| all links' masses and inertias, joints at zero | `mass`, `inertia`, `centre_of_mass`: one rigid body |
| motor model: `linkName`, or the child of `jointName` | a rotor at that link's centre of mass |
| `motorConstant` · `maxRotVelocity`² | `max_thrust` |
| `momentConstant`, `turningDirection` | `torque_coefficient`, `spin` |
| the larger of `timeConstantUp` and `timeConstantDown`, of the speed | `lag`, of the thrust |
| `rotorDragCoefficient` · the speed in hover, all rotors | `drag_body` along x and y |
| the cylinder or box that collides of the rotor's link | `radius` |
| gym-pybullet-drones' `<properties>` in a URDF | `max_thrust`, `torque_coefficient`, `radius` |

Without motor models rotors are the links named after rotors or propellers, and what is missing, most often
`spin`, `max_thrust`, `torque_coefficient` and `lag`, is told and left to be added. Lost are the angular
momentum of turning rotors, `rollingMomentCoefficient`, other plugins, sensors, and models that are included
but not merged. Rotors that do not push along the body's +z and turn about it, an `<inertial>` without
`<mass>`, xacro macros and templates are refused.
"""
CONDITIONS = """
What a flight meets that its plan and its controller do not know of. `none`, `lab` (the paper's flight space)
and `field` come with Aerobat; `lab`, as an example:
"""
HAND_OFF = """
To see what the hand-off alone costs, or to put it where and as bad as one likes:

```python
from dataclasses import replace

import aerobat as ab

lab = ab.load_dispersion("lab")
seam = ab.HandOff(point=(4.0, 0.0, 1.0), normal=(1.0, 0.0, 0.0), translation=0.05, rotation=0.035)
bad_seam = replace(lab, motion_capture=replace(lab.motion_capture, hand_off=seam))
```
"""


def page() -> str:
    """The whole page; its part about what a run writes is kept as it stands."""
    by_hand = PAGE.read_text(encoding="utf-8").partition(WRITTEN)[2]
    parts = [INTRODUCTION, "## Problem (`aerobat fly problem.toml`)\n", preset("problem", "flip-roll")]
    parts += [table(Problem)]
    parts += [section(cls) for cls in (EndState, Heading, Gate, Wall, Limits, Environment)]
    parts += [OBSTACLE_KINDS, *(kind(name, OBSTACLES[name]) for name in OBSTACLES), section(Tolerance)]
    parts += ["### Maneuvers\n", "`[maneuver]` has a `kind`, and what that kind takes:\n"]
    parts += [kind(name, cls) for name, cls in registered_maneuvers().items() if of_package(cls)]
    parts += [section(Figure), section(GatePassage), section(Stage), section(Ball), section(Attitude)]
    parts += [section(Condition)]
    parts += [STAGES, section(Waypoint), WAYPOINTS]
    parts += ["## Vehicle (`--vehicle vehicle.toml`)\n", VEHICLE, fenced(ANNOTATED), table(Vehicle)]
    parts += [section(Rotor), ROTOR, section(Ellipsoid), BODY, section(Controller), CONTROLLER, IMPORT]
    parts += ["## Conditions\n", CONDITIONS, preset("environment", "lab"), table(Dispersion)]
    parts += [section(cls) for cls in (Imu, MotionCapture, Outage, HandOff)]
    parts += [HAND_OFF, section(Gusts), section(Battery)]
    return "\n".join(part.strip("\n") + "\n" for part in parts) + "\n" + WRITTEN + by_hand


def of_package(cls: type) -> bool:
    """True for maneuvers that come with Aerobat."""
    return cls.__module__.startswith("aerobat.")


def preset(room: str, name: str) -> str:
    """A built-in file, as an example."""
    return fenced(files(f"aerobat.{room}") / "presets" / f"{name}.toml")


def fenced(path: Path | Traversable) -> str:
    """A TOML file, as an example."""
    return f"```toml\n{path.read_text(encoding='utf-8').strip()}\n```\n"


def section(cls: type) -> str:
    """A class that stands in a table of its own."""
    return f"### {cls.__name__}\n\n{PLACES[cls]}\n\n{table(cls)}"


def kind(name: str, cls: type) -> str:
    """A kind of maneuver, or of obstacle."""
    first = (cls.__doc__ or "").strip().partition("\n")[0]
    shared = next((base for base in cls.__mro__[1:] if base in PLACES), None)
    beside = "" if shared is None else f"Takes what a [{shared.__name__}](#{shared.__name__.lower()}) takes"
    inherited = () if shared is None else tuple(field.name for field in dataclasses.fields(shared))
    own = [field.name for field in dataclasses.fields(cls) if field.name not in inherited]
    if shared is None:
        return f'**`kind = "{name}"`** {first}\n\n{table(cls)}'
    also = f", and:\n\n{table(cls, inherited)}" if own else ".\n"
    return f'**`kind = "{name}"`** {first}\n\n{beside}{also}'


def table(cls: Any, told: Sequence[str] = ()) -> str:
    """The fields and shorthands of a declared class, a row each, without fields that are told elsewhere."""
    meanings = comments(cls)
    hints = get_type_hints(cls, include_extras=True)
    rows = [
        (f"`{field.name}`", type_of(hints[field.name]), default_of(field), *meanings[field.name])
        for field in dataclasses.fields(cls)
        if field.name not in told
    ]
    for key, meaning in ({} if told else getattr(cls, "SHORTHANDS", {})).items():
        unit, text = split_unit(meaning)
        rows.append((f"`{key}`", "shorthand", "", unit, text))
    lines = ["| key | type | default | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def comments(cls: type) -> dict[str, tuple[str, str]]:
    """Unit and meaning of each field, from the comments beside it and right above it, its bases' too."""
    bases = [base for base in reversed(cls.__mro__) if dataclasses.is_dataclass(base)]
    return {name: told for base in bases for name, told in own_comments(base).items()}


def own_comments(cls: type) -> dict[str, tuple[str, str]]:
    """Unit and meaning of each field that the class itself declares."""
    source = inspect.getsource(cls)
    lines = source.splitlines()
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    found = {}
    for node in definition.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        above: list[str] = []
        for line in reversed(lines[: node.lineno - 1]):
            if not line.strip().startswith("#"):
                break
            above.insert(0, line.strip(" #"))
        beside = lines[(node.end_lineno or node.lineno) - 1].rpartition("  # ")
        unit, meaning = split_unit(beside[2] if beside[1] else "")
        found[node.target.id] = (unit, " ".join([*above, meaning]).strip())
    return found


def split_unit(text: str) -> tuple[str, str]:
    """The unit in brackets that a comment begins with, and the rest."""
    unit = re.match(r"\[([^\]]+)\]\s*", text)
    return (unit[1], text[unit.end() :]) if unit else ("", text)


def type_of(hint: Any) -> str:
    """A type as people say it."""
    descriptions = [getattr(each, "description", None) for each in getattr(hint, "__metadata__", ())]
    if any(descriptions):
        return next(each for each in descriptions if each)
    if hasattr(hint, "__metadata__"):
        return type_of(get_args(hint)[0])
    arguments = [argument for argument in get_args(hint) if argument not in (types.NoneType, ...)]
    if get_origin(hint) is tuple:
        described = [getattr(each, "description", "") for each in getattr(arguments[0], "__metadata__", ())]
        return f"list of {'' if any(described) else 'tables, '}{type_of(arguments[0])}"
    if get_origin(hint) is Literal:
        return ", ".join(f"`{choice!r}`" for choice in arguments)
    if arguments:
        return type_of(arguments[0])
    if issubclass(hint, Maneuver):
        return "[maneuver](#maneuvers)"
    if issubclass(hint, Obstacle):
        return "[obstacle](#obstacle)"
    if issubclass(hint, Enum):
        return ", ".join(f'`"{member.value}"`' for member in hint)
    plain = {float: "number", int: "whole number", bool: "`true`, `false`", str: "text"}
    return plain.get(hint) or f"[{hint.__name__}](#{hint.__name__.lower()})"


def default_of(field: dataclasses.Field[Any]) -> str:
    """A field's default as a file would give it; empty where it must be given."""
    if field.default_factory is not dataclasses.MISSING:
        value = field.default_factory()
        return (
            "none" if dataclasses.is_dataclass(value) or not np.isfinite(value).any() else f"{value.tolist()}"
        )
    if field.default is dataclasses.MISSING or isinstance(
        field.default, Maneuver
    ):  # files say what they want
        return ""
    if field.default in (None, "", ()):
        return "none"
    if isinstance(field.default, bool):
        return f"`{str(field.default).lower()}`"
    if dataclasses.is_dataclass(field.default):
        return "its defaults"
    return str(field.default)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
