"""Every reader of files, and files for it that are mutated at random, the same for the same seed.

    uv run --dev python tests/support/mutated_files.py 10000 1 FOLDER

reads so many of a seed, prints what is not as it should be, and keeps the files that it was wrong with in the
folder: another exception than one sentence, a warning, something else read from bytes that checksums guard,
more than 5 s of the processor, more than 500 MB of memory.
"""

from __future__ import annotations

import io
import json
import random
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np

import aerobat as ab
from aerobat.cli.runs.record import RunRecord, read_record, write_record
from aerobat.documents import in_document
from aerobat.environment.files import write_dispersion
from aerobat.errors import SpecError
from aerobat.interchange import read_csv, read_flight_log, read_table, write_columns, write_table
from aerobat.interchange.csv import write_csv
from aerobat.interchange.robots import import_vehicle, read_robot_description
from aerobat.problem.files import write_problem
from aerobat.simulation import load_flight
from aerobat.simulation.autopilot import Recoveries
from aerobat.storage import digest_of
from aerobat.studies.flights import FlightTask
from aerobat.studies.kept import KeptParts
from aerobat.studies.sweep.flights import Chunk, fly_chunk
from aerobat.trajectory import load_trajectory, save_trajectory
from aerobat.vehicle.files import write_vehicle
from damaged_files import csv_files, damaged_bytes, documents, lying_array, mutated_table
from flight_package import read_flight_package
from places import CASES
from shared_plans import closed_form, shared_flight

MAX_SECONDS, MAX_MEGABYTES = 5.0, 500.0
LONG = (  # what parsers take long or much memory for
    "9" * 10**6, "0x" + "f" * 10**6, "1." + "0" * 10**6, "[" * 10**5, "{" * 10**5, "a." * 10**5,
    "," * 10**6, "\n" * 10**6, " " * 10**6, "-" * 10**6, "1," * 10**6, "x" * 10**6, '"' * 10**5,
    "\0" * 10**5, "<a>" * 10**5, "\\u0041" * 10**5, "é" * 10**5, "#" * 10**6,
)  # fmt: skip
Damaging = Callable[[bytes, random.Random], Iterator[bytes]]


@dataclass(frozen=True)
class Reader:
    """A reader with a file that it reads, and what damages such files."""

    name: str  # of the file, as it must be called
    write: Callable[[Path], object]
    read: Callable[[Path], Any]
    damaged: Damaging
    is_guarded: bool = False  # True where checksums tell any other bytes
    refusals: tuple[type[Exception], ...] = (SpecError,)


def texts(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """A text with its bytes damaged, or with something long in it, without end."""
    while True:
        yield damaged_bytes(whole, rng)
        at = rng.randrange(len(whole) + 1)
        yield whole[:at] + rng.choice(LONG).encode() + whole[at:]


def tables(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """A CSV file damaged as a text, or with some of its numbers replaced, in turn, without end."""
    for text, table in zip(texts(whole, rng), csv_files(whole, rng), strict=False):
        yield from (text, table)


def room_documents(room: str, whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """Documents of a room that are mutated, or damaged as texts, in turn, without end."""
    for text, document in zip(texts(whole, rng), documents(room, rng), strict=False):
        yield from (text, document)


def archives(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """An .npz file with another array or document and a digest made anew, or that swells, without end."""
    content = dict(np.load(io.BytesIO(whole)))
    for change in cycle(("array", "document", "bomb")):
        changed = dict(content)
        if change == "bomb":
            yield swelling(content, rng)
            continue
        if change == "document" and "document" in content:
            document = mutated_table(json.loads(content["document"].tobytes()), rng)
            text = json.dumps(document, default=str) if rng.random() < 0.9 else rng.choice(LONG)
            changed["document"] = np.frombuffer(text.encode(), np.uint8)
        elif rng.random() < 0.3:
            del changed[rng.choice(list(content))]
        else:
            changed[rng.choice(list(content))] = lying_array(rng)
        if "digest" in changed:
            changed["digest"] = np.asarray(digest_of(changed))
        archive = io.BytesIO()
        np.savez(archive, **changed)
        yield archive.getvalue()


def bytes_alone(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """A file with its bytes damaged, without end."""
    while True:
        yield damaged_bytes(whole, rng)


def swelling(content: Mapping[str, Any], rng: random.Random) -> bytes:
    """A packed archive of which one array is of zeros, or says that it is, up to 2 GB of them."""
    count = 10 ** rng.randint(3, 8)
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count},), }}".ljust(117).encode() + b"\n"
    swollen, archive = rng.choice(list(content)), io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as made:
        for name, array in content.items():
            if name == swollen:
                with made.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    entry.write(b"\x93NUMPY\x01\x00" + (118).to_bytes(2, "little") + header)
                    for _ in range(rng.choice([0, 1, 8 * count >> 20])):
                        entry.write(bytes(2**20))
                continue
            array_file = io.BytesIO()
            np.save(array_file, array)
            made.writestr(f"{name}.npy", array_file.getvalue())
    return archive.getvalue()


@cache
def plan() -> ab.Plan:
    """A plan with all that a file may hold of one."""
    found = closed_form()
    return replace(found, recoveries=Recoveries(*np.ones((4, 5)), reaction=0.1, ground=None))


def shown_plan(path: Path) -> ab.Plan:
    """Read a plan, and show it with its proof."""
    found = ab.load_plan(path)
    str(found)
    return found


def shown_flight(path: Path) -> ab.Flight:
    """Read a flight, and show it, or the first of them."""
    found = load_flight(path)
    str(found[0] if found.is_batch else found)
    return found


def certified_path(path: Path) -> ab.Certificate:
    """Read a path, and judge it as `check` does."""
    return ab.certify(read_csv(path), ab.load_vehicle("agile-quad"))


def flight_log(path: Path) -> None:
    """A flight as a log of another system has it."""
    flight = ab.fly(plan())
    q, f = flight.states.q_world_body, flight.thrusts
    columns = np.column_stack([flight.times, flight.states.position, q, f])[::10]
    header = ["t", *"xyz", "qw", "qx", "qy", "qz", *(f"f{k}" for k in range(f.shape[1]))]
    lines = [",".join(header), *(",".join(map(repr, row)) for row in columns.tolist())]
    path.write_text("\n".join(lines) + "\n")


def run_record(path: Path) -> None:
    """The record of a run."""
    assert plan().vehicle is not None
    write_record(RunRecord("fly", plan().problem, plan().vehicle, ab.Miqp()), path.parent)


@cache
def sweep_task() -> FlightTask:
    """A sweep of a plan."""
    vehicle = plan().vehicle
    assert vehicle is not None
    return FlightTask(plan(), vehicle, ab.load_dispersion("none"), 0, vehicle.controller, "auto", 1)


def sweep_chunk(path: Path) -> None:
    """One kept flight of it."""
    kept_parts(path).write(range(1), fly_chunk(sweep_task(), range(1)).arrays)


def kept_parts(path: Path) -> KeptParts:
    """The folder of a file, as parts of a sweep."""
    return KeptParts.of(path.parent, "flights", "sweep", lambda: {"seed": 0})


def described(path: Path) -> str:
    """A robot as a vehicle's file, where something is missing."""
    with in_document(path, "robot"):
        return read_robot_description(path).toml()


def both(name: str, reader: Reader) -> dict[str, Reader]:
    """A reader of archives, and the same one of those of which bytes are damaged, which a checksum tells."""
    return {name: reader, f"{name}, bytes": replace(reader, damaged=bytes_alone, is_guarded=True)}


def kept_chunk(path: Path) -> str:
    """A digest of what a kept chunk holds."""
    chunk = KeptParts(path.parent).known([range(1)], Chunk.of).get(range(1))
    if chunk is None:
        raise SpecError("it is flown again")
    return digest_of(dict(chunk.table))


TABLE = {"flight": np.arange(20), "error": np.linspace(0.0, 1.0, 20), "outcome": np.array(["complete"] * 20)}
READERS: Mapping[str, Reader] = {
    **both("plan", Reader("x.plan", lambda path: plan().save(path), shown_plan, archives)),
    **both(
        "trajectory",
        Reader("x.npz", lambda path: save_trajectory(plan().trajectory, path), load_trajectory, archives),
    ),
    **both(
        "flight",
        Reader("x.npz", lambda path: shared_flight("half-flip").save(path), shown_flight, archives),
    ),
    **both(
        "sweep",
        Reader("flights-0-1.npz", sweep_chunk, kept_chunk, archives),
    ),
    "package": Reader(
        "x.plan",
        lambda path: plan().save(path),
        lambda path: read_flight_package(path).certified,
        archives,
        refusals=(ValueError, OSError),
    ),
    "fingerprint": Reader("fingerprint.json", sweep_chunk, kept_parts, texts),
    "path": Reader("x.csv", lambda path: write_csv(plan().trajectory, path, 20.0), certified_path, tables),
    "columns": Reader("x.csv", lambda path: write_columns(plan(), path, rate=20.0), certified_path, tables),
    "log": Reader("x.csv", flight_log, lambda path: read_flight_log(path, plan()), tables),
    "table": Reader("x.csv", lambda path: write_table(TABLE, path), read_table, tables),
    "parquet": Reader("x.parquet", lambda path: write_table(TABLE, path), read_table, texts),
    "vehicle": Reader(
        "x.toml",
        lambda path: write_vehicle("agile-quad", path),
        ab.load_vehicle,
        partial(room_documents, "vehicle"),
    ),
    "problem": Reader(
        "x.toml",
        lambda path: write_problem(plan().problem, path),
        ab.load_problem,
        partial(room_documents, "problem"),
    ),
    "conditions": Reader(
        "x.toml",
        lambda path: write_dispersion("lab", path),
        ab.load_dispersion,
        partial(room_documents, "environment"),
    ),
    "run": Reader("run.toml", run_record, lambda path: read_record(path.parent), texts),
    "urdf": Reader(
        "x.urdf",
        lambda path: path.write_bytes((CASES / "robots" / "crazyflie.urdf").read_bytes()),
        described,
        texts,
    ),
    "sdf": Reader(
        "x.sdf",
        lambda path: path.write_bytes((CASES / "robots" / "iris.sdf").read_bytes()),
        import_vehicle,
        texts,
    ),
}


@dataclass(frozen=True)
class Trial:
    """Whole file of a reader, what is read of it, and mutations of it without end."""

    reader: Reader
    path: Path
    whole: Any
    contents: Iterator[bytes]

    @classmethod
    def of(cls, reader: Reader, folder: Path, seed: int) -> Trial:
        """Write the file to a folder."""
        path = folder / reader.name
        reader.write(path)
        return cls(reader, path, reader.read(path), reader.damaged(path.read_bytes(), random.Random(seed)))

    def fault(self, content: bytes) -> str:
        """What is wrong about reading such content, in a few words; empty where nothing is."""
        self.path.write_bytes(content)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = self.reader.read(self.path)
        except self.reader.refusals as error:
            is_sentence = str(error).isprintable() and len(str(error)) < 400
            return "" if is_sentence else f"no sentence: {str(error)[:500]!r}"
        except Exception as error:
            return f"{type(error).__name__}: {str(error)[:300]}"
        return "other than what was written" if self.reader.is_guarded and found != self.whole else ""


def main(count: int, seed: int, kept: Path) -> None:
    """Read so many, print what is wrong and a table of what all took, and keep the files concerned."""
    kept.mkdir(parents=True, exist_ok=True)
    share = -(-count // len(READERS))
    print(f"{'reader':>18} {'files':>6} {'wrong':>6} {'s at most':>10} {'MB at most':>11}")
    for name, reader in READERS.items():
        wrong, slowest, largest = 0, 0.0, 0.0
        with tempfile.TemporaryDirectory() as scratch:
            trial = Trial.of(reader, Path(scratch), seed)
            for i, content in enumerate(islice(trial.contents, share)):
                began, before = time.process_time(), memory("VmRSS", resets=True)
                fault = trial.fault(content)
                spent, grown = time.process_time() - began, memory("VmHWM") - before
                slowest, largest = max(slowest, spent), max(largest, grown)
                if fault or spent > MAX_SECONDS or grown > MAX_MEGABYTES:
                    wrong += 1
                    print(f"{name} {i}: {fault} ({spent:.1f} s, {grown:.0f} MB)", flush=True)
                    (kept / f"{name}-{i}-{reader.name}").write_bytes(content)
        print(f"{name:>18} {share:6} {wrong:6} {slowest:10.2f} {largest:11.0f}", flush=True)


def memory(which: str, resets: bool = False) -> float:
    """A measure of this process's memory [MB], as Linux names it; `resets`: the highest begins anew."""
    if resets:
        Path("/proc/self/clear_refs").write_text("5")
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(which))
    return float(line.split()[1]) / 1024


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
