"""Files that lie: whatever a file holds, reading it ends in what it says or in one sentence, at once."""

from __future__ import annotations

import io
import os
import random
import zipfile
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from aerobat.errors import SpecError
from aerobat.interchange import read_plan
from aerobat.interchange.number_table import MAX_ROWS
from aerobat.planning import Plan, load_plan
from aerobat.problem import load_problem
from aerobat.simulation import load_flight
from aerobat.trajectory import Trajectory, load_trajectory
from aerobat.vehicle import load_vehicle
from damaged_files import checking_lines, plan_files
from flight_package import read_flight_package
from mutated_files import READERS, Trial
from random_command_lines import faults

QUAD = load_vehicle("agile-quad")


def parts(few: int, all: int) -> Any:
    """Some of the files that a test damages for the default suite, all others for the full one."""
    return pytest.mark.parametrize(
        ("begin", "end"), [(0, few), pytest.param(few, all, marks=pytest.mark.slow)]
    )


@pytest.fixture(scope="module")
def plan_file(tmp_path_factory) -> Path:
    """A plan of two segments, saved."""
    path = tmp_path_factory.mktemp("plan") / "whole.plan"
    trajectory = Trajectory([0.7, 0.8], np.linspace(-1.0, 1.0, 48).reshape(2, 8, 3))
    Plan(load_problem("line"), trajectory, "miqp", vehicle=QUAD).save(path)
    return path


@parts(12, 60)
@pytest.mark.parametrize("name", READERS)
def test_whatever_a_file_holds_its_reader_ends_in_what_it_says_or_in_one_sentence(
    name, begin, end, tmp_path
) -> None:
    trial = Trial.of(READERS[name], tmp_path, seed=7)
    for k, content in enumerate(islice(trial.contents, begin, end)):
        assert trial.fault(content) == "", f"file {begin + k}"


def test_what_the_reader_to_copy_reads_has_setpoints(plan_file, tmp_path) -> None:
    path, read = tmp_path / "damaged.plan", 0
    for content in islice(plan_files(plan_file.read_bytes(), random.Random(2)), 40):
        path.write_bytes(content)
        with suppress(ValueError, OSError), np.errstate(all="ignore"):
            package = read_flight_package(path)
            if package.duration < 10.0 and package.document["vehicle"]:
                assert package.setpoints([0.0]).thrust.shape == (1,)
                read += 1
    assert read


@parts(5, 20)
def test_commands_that_read_damaged_files_end_in_a_sentence_or_a_judgement(
    begin, end, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for line in islice(checking_lines(random.Random(6)), begin, end):
        assert faults(line) == [], line


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


def packed(entries: int, size: int) -> bytes:
    """An archive of zeros, a thousandth of their size."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made:
        for k in range(entries):
            made.writestr(f"{k}.npy", bytes(size))
    return archive.getvalue()


@pytest.mark.parametrize(("entries", "size"), [(20, 2**22), (6000, 0)])
def test_what_unpacks_to_much_more_than_the_file_is_refused_before(entries, size, tmp_path, monkeypatch):
    monkeypatch.setattr(np, "load", lambda *_, **__: pytest.fail("it was unpacked"))
    path = tmp_path / "bomb.plan"
    path.write_bytes(packed(entries, size))
    for read in (load_plan, load_trajectory, load_flight, read_flight_package):
        with pytest.raises(ValueError, match="is not a whole"):
            read(path)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("mass = " + "9" * 10**6, "a number of a thousand digits"),
        ("mass = 0x" + "f" * 10**6, "a number of a thousand digits"),
        ("mass = 0." + "1_" * 10**6, "a number of a thousand digits"),
        ("a." * 20_000 + "b = 1", "a key of a hundred parts"),
        ("\"a\" . 'b' ." * 20_000 + "b = 1", "a key of a hundred parts"),
    ],
)
def test_what_a_parser_takes_gigabytes_for_is_refused_before_it_is_parsed(text, what, tmp_path, monkeypatch):
    monkeypatch.setattr("tomllib.loads", lambda text: pytest.fail("it was parsed"))
    (tmp_path / "huge.toml").write_text(f"name = 'huge'\n{text}\n")
    with pytest.raises(SpecError, match=f"line 2 holds {what}"):
        load_vehicle(tmp_path / "huge.toml")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("x," * 10**6 + "y\n1,1\n", "line 1 has 1000001 numbers"),
        ("1," * 10**6 + "1\n1,1\n", "line 1 has 1000001 numbers"),
        ("\n" * (MAX_ROWS + 1), "more than 2000000 lines"),
    ],
    ids=["header", "row", "rows"],
)
def test_tables_that_no_path_has_are_refused_before_they_are_cut_into_words(
    text, what, tmp_path, monkeypatch
) -> None:
    def cut(line: str, number: int) -> list[float]:
        pytest.fail("it was cut")

    monkeypatch.setattr("aerobat.interchange.number_table._numbers", cut)
    (tmp_path / "long.csv").write_text(text)
    with pytest.raises(SpecError, match=what):
        read_plan(tmp_path / "long.csv")


WITHOUT_END = (load_plan, load_trajectory, load_flight, read_plan, load_vehicle, load_problem)


@pytest.mark.skipif(os.name != "posix", reason="no such files there")
@pytest.mark.parametrize("read", WITHOUT_END, ids=lambda read: read.__name__)
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
