"""Files that lie: whatever a file holds, reading it ends in what it says or in one sentence, at once."""

from __future__ import annotations

import io
import json
import os
import random
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from aerobat.certification import certify
from aerobat.environment import Environment, dispersion_names, load_dispersion
from aerobat.errors import SpecError
from aerobat.interchange import read_plan
from aerobat.interchange.csv import write_csv
from aerobat.planning import Plan, load_plan
from aerobat.problem import load_problem, problem_names
from aerobat.simulation import fly, load_flight
from aerobat.trajectory import Trajectory, load_trajectory
from aerobat.vehicle import load_vehicle, vehicle_names

QUAD = load_vehicle("agile-quad")
NUMBERS = (0, -1, 1e300, -1e300, 1e-300, 1e-7, 1e17, 1e29, float("nan"), float("inf"), 3, 2**70)
VALUES = (*NUMBERS, "", "text\nof two lines", True, [], {}, [1.0], [[1.0, 2.0], [3.0]], None)


def in_a_sentence(read: Callable[[], Any]) -> Any:
    """What is read, or None where that is refused in one sentence; a warning is a failure."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return read()
        except SpecError as error:
            sentence = str(error)
    assert sentence.isprintable(), sentence
    assert len(sentence) < 400, sentence
    return None


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory) -> Path:
    """A plan of two segments, saved."""
    path = tmp_path_factory.mktemp("plan") / "whole.plan"
    trajectory = Trajectory([0.7, 0.8], np.linspace(-1.0, 1.0, 48).reshape(2, 8, 3))
    Plan(load_problem("line"), trajectory, "miqp", vehicle=QUAD).save(path)
    return path


def archive(path: Path, content: dict[str, Any]) -> None:
    with path.open("wb") as file:
        np.savez(file, **content)


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


def judged(found: Plan | Trajectory) -> None:
    """What `check` does with what it reads."""
    trajectory = found.trajectory if isinstance(found, Plan) else found
    certify(trajectory, QUAD, Environment())


def test_three_hundred_damaged_plan_files_end_in_a_sentence_or_are_whole(plan_file, tmp_path) -> None:
    rng = random.Random(1)
    path = tmp_path / "damaged.plan"
    for _ in range(300):
        path.write_bytes(damaged_bytes(plan_file.read_bytes(), rng))
        in_a_sentence(lambda: load_plan(path))


def test_two_hundred_plan_files_of_lying_arrays_end_in_a_sentence(plan_file, tmp_path) -> None:
    rng = random.Random(2)
    content = dict(np.load(plan_file))
    path = tmp_path / "lying.plan"
    for _ in range(200):
        if rng.random() < 0.5:
            changed = content | {rng.choice(list(content)): lying_array(rng)}
        else:
            document = mutated_table(json.loads(content["document"].tobytes()), rng)
            text = json.dumps(document, default=str).encode()
            changed = content | {"document": np.frombuffer(text, np.uint8)}
        archive(path, changed)
        found = in_a_sentence(lambda: read_plan(path))
        if found is not None:
            in_a_sentence(lambda found=found: judged(found))


def test_two_hundred_flight_files_of_lying_arrays_end_in_a_sentence_or_are_read(tmp_path) -> None:
    rng = random.Random(5)
    path = tmp_path / "lying.npz"
    fly(Trajectory([0.1], np.zeros((1, 8, 3))), QUAD).save(path)
    content = dict(np.load(path))
    for _ in range(200):
        archive(path, content | {rng.choice(list(content)): lying_array(rng)})
        found = in_a_sentence(lambda: load_flight(path))
        if found is not None:
            in_a_sentence(lambda found=found: found[0] if found.is_batch else found.ends)


def test_two_hundred_damaged_csv_files_end_in_a_sentence_or_are_judged(plan_file, tmp_path) -> None:
    rng = random.Random(3)
    path = tmp_path / "path.csv"
    write_csv(load_plan(plan_file).trajectory, path, rate=10.0)
    rows = [line.split(",") for line in path.read_text().splitlines()]
    for k in range(200):
        if k % 2:
            path.write_bytes(damaged_bytes("\n".join(map(",".join, rows)).encode() + b"\n", rng))
        else:
            changed = [list(row) for row in rows]
            for _ in range(rng.randint(1, 4)):
                row = rng.choice(changed)
                row[rng.randrange(len(row))] = str(rng.choice(NUMBERS))
            path.write_text("\n".join(map(",".join, changed)) + "\n")
        found = in_a_sentence(lambda: read_plan(path))
        if found is not None:
            in_a_sentence(lambda found=found: judged(found))


@pytest.mark.parametrize(
    ("load", "room", "names"),
    [
        (load_vehicle, "vehicle", vehicle_names()),
        (load_problem, "problem", problem_names()),
        (load_dispersion, "environment", dispersion_names()),
    ],
)
def test_five_hundred_mutated_documents_end_in_a_sentence_or_are_read(load, room, names, tmp_path) -> None:
    import tomllib
    from importlib.resources import files

    presets = [(files(f"aerobat.{room}") / "presets" / f"{name}.toml").read_bytes() for name in names]
    rng = random.Random(4)
    path = tmp_path / "mutated.toml"
    for k in range(500):
        content = rng.choice(presets)
        if k % 4:
            table = tomllib.loads(content.decode())
            for _ in range(rng.randint(1, 3)):
                mutated_table(table, rng)
            try:
                content = tomli_w.dumps(table).encode()
            except TypeError:  # TOML has no None
                continue
        else:
            content = damaged_bytes(content, rng)
        path.write_bytes(content)
        in_a_sentence(lambda: load(path))


def test_archives_that_are_no_plans_are_refused(plan_file, tmp_path) -> None:
    content = plan_file.read_bytes()
    encrypted = bytearray(content)
    for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = encrypted.find(signature)
        while at >= 0:
            encrypted[at + flags] |= 1
            at = encrypted.find(signature, at + 4)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_LZMA) as made, zipfile.ZipFile(plan_file) as whole:
        for entry in whole.namelist():
            made.writestr(entry, whole.read(entry))
    lzma = bytearray(packed.getvalue())
    lzma[200:240] = bytes(40)
    header = b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little")
    claim = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }".ljust(117) + b"\n"
    huge = io.BytesIO()
    with zipfile.ZipFile(huge, "w") as made:
        made.writestr("format.npy", header + claim)
    for k, lie in enumerate((bytes(encrypted), bytes(lzma), huge.getvalue(), header + claim)):
        path = tmp_path / f"{k}.plan"
        path.write_bytes(lie)
        for read in (load_plan, load_trajectory, load_flight):
            with pytest.raises(SpecError, match="is not a whole"):
                read(path)


def test_what_unpacks_to_more_than_is_read_is_refused(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("aerobat.storage.MAX_ARRAYS", 2**20)
    path = tmp_path / "bomb.plan"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made,
        made.open("format.npy", "w", force_zip64=True) as entry,
    ):
        for _ in range(3):
            entry.write(bytes(2**20))
    with pytest.raises(SpecError, match="is not a whole"):
        load_plan(path)


READERS = (load_plan, load_trajectory, load_flight, read_plan, load_vehicle, load_problem)


@pytest.mark.skipif(os.name != "posix", reason="no such files there")
@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
def test_pipes_and_endless_devices_are_refused_at_once(read, tmp_path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    for name in ("pipe.toml", "endless.toml"):
        with pytest.raises(SpecError, match="a pipe or a device"):
            read(tmp_path / name)


def test_polynomials_beyond_float64_are_refused() -> None:
    with pytest.raises(SpecError, match="degree 30 at most"):
        Trajectory([1.0], np.zeros((1, 201, 3)))
    with pytest.raises(SpecError, match="check their units"):
        Trajectory([1e-80], np.ones((1, 8, 3)))
    with pytest.raises(SpecError, match="check their units"):
        Trajectory([1.0], np.full((1, 8, 3), 1e300))
    with pytest.raises(SpecError, match="samples at most"):
        Trajectory([1.0], np.ones((1, 8, 3))).sample(1e15)


def test_a_byte_order_mark_is_no_part_of_a_document(tmp_path) -> None:
    path = tmp_path / "bom.toml"
    path.write_text("\ufeff" + tomli_w.dumps({"name": "bom", "start": {"position": [0.0, 0.0, 0.0]},
        "goal": {"position": [3.0, 0.0, 0.0]}, "maneuver": {"kind": "line"}}), encoding="utf-8")  # fmt: skip
    assert load_problem(path).name == "bom"
