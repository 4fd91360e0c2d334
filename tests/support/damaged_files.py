"""Files that lie, drawn at random: presets with values replaced, bytes flipped, arrays of wrong shapes.

    uv run python tests/support/damaged_files.py documents 1000 0 FOLDER
    uv run python tests/support/damaged_files.py plans 700 0 FOLDER

runs so many of a seed, problems and vehicles planned by whichever planner, plans and CSV files checked or
flown, and prints what is not as it should be; its files are kept in the folder.
"""

from __future__ import annotations

import io
import json
import random
import re
import shutil
import sys
import tempfile
import time
import tomllib
import warnings
from collections.abc import Callable, Iterator
from contextlib import chdir, suppress
from importlib.resources import files
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from aerobat.environment import dispersion_names
from aerobat.interchange import write_columns
from aerobat.planning import registered_planners
from aerobat.problem import problem_names
from aerobat.storage import digest_of
from aerobat.vehicle import vehicle_names
from random_command_lines import faults
from shared_plans import closed_form

NUMBERS = (0, -1, 1e300, -1e300, 1e-300, 1e-7, 1e17, 1e29, float("nan"), float("inf"), 3, 2**70)
VALUES = (*NUMBERS, "", "text\nof two lines", True, [], {}, [1.0], [[1.0, 2.0], [3.0]], None)
SILENCE = 60.0  # [s] without a word, at most
ROOMS = {"problem": problem_names, "vehicle": vehicle_names, "environment": dispersion_names}
PLANNED = ("problem", "vehicle")


def damaged_bytes(content: bytes, rng: random.Random) -> bytes:
    """Bytes flipped, cut out, repeated or cut off."""
    damaged = bytearray(content)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(damaged))
        match rng.randrange(4):
            case 0:
                damaged[at] ^= 1 << rng.randrange(8)
            case 1:
                del damaged[at : at + rng.randint(1, 40)]
            case 2:
                damaged[at:at] = damaged[at : at + rng.randint(1, 40)]
            case _:
                damaged[at:] = damaged[at : at + rng.randint(1, len(damaged))]
        if not damaged:
            break
    return bytes(damaged)


def lying_array(rng: random.Random) -> Any:
    """An array of a shape, a type or of numbers that no trajectory has."""
    shape = rng.choice([(), (0,), (1,), (2,), (2, 8, 3), (2, 201, 3), (2, 0, 3), (3, 2, 8, 3)])
    kind = rng.choice([float, int, complex, bool, "U7", "S3", "M8[s]", "f2"])
    number = rng.choice([0.0, 1.0, -1.0, 1e300, 1e200, 1e-300, 1e-7, 1e17, 1e29, np.nan, np.inf])
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.full(shape, 1).astype(kind) if kind is not float else np.full(shape, number)


def mutated_table(table: Any, rng: random.Random) -> Any:
    """The table with one of its values replaced, removed or doubled, wherever it stands."""
    keys = list(table) if isinstance(table, dict) else list(range(len(table)))
    if not keys:
        return table
    key = rng.choice(keys)
    if isinstance(table[key], dict | list) and rng.random() < 0.7:
        mutated_table(table[key], rng)
        return table
    match rng.randrange(5):
        case 0:
            del table[key]
        case 1 if isinstance(table, dict):
            table[f"{key}x"] = table.pop(key)
        case 2 if isinstance(table[key], int | float):
            table[key] = table[key] * rng.choice([-1.0, 0.0, 1e3, 1e-3, 1e200])
        case _:
            table[key] = rng.choice(VALUES)
    return table


def nudged_table(table: Any, rng: random.Random) -> Any:
    """The table with one of its numbers changed by so little that it may still make sense."""
    keys = list(table) if isinstance(table, dict) else list(range(len(table)))
    key = rng.choice(keys) if keys else None
    if key is None or isinstance(table[key], str | bool):
        return table
    if isinstance(table[key], dict | list):
        nudged_table(table[key], rng)
    else:
        table[key] = rng.choice([table[key] * rng.choice([-1.0, 0.3, 0.9, 1.1, 3.0]), table[key] + 0.5])
    return table


def documents(room: str, rng: random.Random) -> Iterator[bytes]:
    """Contents of a room's files, damaged, mutated or changed by little in turn, without end."""
    presets = [(files(f"aerobat.{room}") / "presets" / f"{name}.toml").read_bytes() for name in ROOMS[room]()]
    for change in cycle((None, mutated_table, mutated_table, nudged_table)):
        content = rng.choice(presets)
        if change is None:
            yield damaged_bytes(content, rng)
            continue
        table = tomllib.loads(content.decode())
        for _ in range(rng.randint(1, 3)):
            change(table, rng)
        with suppress(TypeError):  # TOML has no None
            yield tomli_w.dumps(table).encode()


def plan_files(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """Contents of a plan's file, its bytes, its arrays or its document changed, without end."""
    content = dict(np.load(io.BytesIO(whole)))
    content.pop("digest", None)  # what is changed is then read, as of the revisions that had none
    while True:
        if rng.random() < 0.6:
            yield damaged_bytes(whole, rng)
            continue
        if rng.random() < 0.5:
            changed = content | {rng.choice(list(content)): lying_array(rng)}
        else:
            document = mutated_table(json.loads(content["document"].tobytes()), rng)
            text = json.dumps(document, default=str).encode()
            changed = content | {"document": np.frombuffer(text, np.uint8)}
        archive = io.BytesIO()
        np.savez(archive, **changed)
        yield archive.getvalue()


def numbers(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every number in a document, however deep, by its container and its key there."""
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(inner, dict | list):
            yield from numbers(inner)
        elif isinstance(inner, int | float) and not isinstance(inner, bool):
            yield value, key


def change_one_number(path: Path, rng: random.Random) -> bool:
    """Change any number of a plan's file: of its path, vehicle, environment, problem or evidence.

    True if its digest is made anew.
    """
    content = dict(np.load(path))
    digest = content.pop("digest")
    document = json.loads(content["document"].tobytes())
    arrays = [content["coefficients"], content["durations"]]
    parts = [list(numbers(part)) for part in (document, *document.values()) if isinstance(part, dict)]
    parts += [[(array, index) for index in np.ndindex(array.shape)] for array in arrays]
    container, key = rng.choice(rng.choice([part for part in parts if part]))
    value = float(container[key])
    others = (value * rng.uniform(0.5, 1.7) + 1e-3, -value - 1e-9, value + 2.0, value + 1e-6, *NUMBERS)
    container[key] = rng.choice([other for other in others if other != value])
    content["document"] = np.frombuffer(json.dumps(document).encode(), np.uint8)
    is_forged = rng.random() < 0.5
    with path.open("wb") as file:
        np.savez(file, **content, digest=digest_of(content) if is_forged else digest)
    return is_forged


def csv_files(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """Contents of a CSV file, its bytes or some of its numbers changed, without end."""
    rows = [line.split(",") for line in whole.decode().splitlines()]
    while True:
        yield damaged_bytes(whole, rng)
        changed = [list(row) for row in rows]
        for _ in range(rng.randint(1, 4)):
            row = rng.choice(changed)
            row[rng.randrange(len(row))] = str(rng.choice(NUMBERS))
        yield "".join(",".join(row) + "\n" for row in changed).encode()


class Spoken(io.StringIO):
    """Standard error that knows for how long nothing was said."""

    def __init__(self) -> None:
        super().__init__()
        self.last = time.monotonic()
        self.silence = 0.0  # [s]

    def write(self, text: str) -> int:
        """Take note of the time."""
        now = time.monotonic()
        self.silence, self.last = max(self.silence, now - self.last), now
        return super().write(text)


def planning_lines(rng: random.Random) -> Iterator[list[str]]:
    """Write a mutated problem or vehicle, and yield the command line that plans it, without end."""
    rooms = {room: documents(room, rng) for room in PLANNED}
    while True:
        room = rng.choice(PLANNED)
        Path(f"{room}.toml").write_bytes(next(rooms[room]))
        named = {each: f"{room}.toml" if each == room else rng.choice(ROOMS[each]()) for each in PLANNED}
        planner = rng.choice(list(registered_planners()))
        yield ["plan", named["problem"], "--vehicle", named["vehicle"], "--planner", planner, "--out", "out"]


def checking_lines(rng: random.Random) -> Iterator[list[str]]:
    """Write a damaged plan or CSV file, and yield a command line that reads it, without end."""
    closed_form().save("whole.plan")
    write_columns(closed_form(), "whole.csv")
    whole = {kind: Path(f"whole.{kind}").read_bytes() for kind in ("plan", "csv")}
    drawn = {"plan": plan_files(whole["plan"], rng), "csv": csv_files(whole["csv"], rng)}
    while True:
        kind = rng.choice(["plan", "csv"])
        Path(f"damaged.{kind}").write_bytes(next(drawn[kind]))
        yield rng.choice([["check", f"damaged.{kind}"], ["fly", f"damaged.{kind}", "--out", "out"]])


def main(lines: Callable[[random.Random], Iterator[list[str]]], count: int, seed: int, kept: Path) -> None:
    """Run so many, print what is wrong, and keep the files that it was wrong with."""
    kept = kept.resolve()
    kept.mkdir(parents=True, exist_ok=True)
    wrong, refused, silence = 0, 0, 0.0
    with tempfile.TemporaryDirectory() as scratch, chdir(scratch):
        for i, line in enumerate(islice(lines(random.Random(seed)), count)):
            spoken, began = Spoken(), time.process_time()
            found = faults(line, spoken)
            spoken.write("")
            silence = max(silence, spoken.silence)
            if spoken.silence > SILENCE:
                found.append(f"{spoken.silence:.0f} s without a word")
            spent = time.process_time() - began
            refused += bool(re.search(r"^aerobat: (?!warning:|planning with)", spoken.getvalue(), re.M))
            wrong += bool(found)
            if found or spent > SILENCE:
                print(i, line, f"{spent:.0f} s of the processor", *found, sep="\n    ", flush=True)
                for path in Path().glob("*.*"):
                    shutil.copy(path, kept / f"{i}-{path}")
    print(f"{wrong} of {count} are not as they should be, {refused} refused; silent {silence:.0f} s at most")


if __name__ == "__main__":
    main(
        {"documents": planning_lines, "plans": checking_lines}[sys.argv[1]],
        *map(int, sys.argv[2:4]),
        Path(sys.argv[4]),
    )
