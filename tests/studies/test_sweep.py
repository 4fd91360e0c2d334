"""A sweep's numbers are those of its flights, whatever cuts them into batches, processes and sittings."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

import aerobat as ab
from aerobat.storage import read_arrays
from aerobat.studies.flights import CHUNK
from aerobat.studies.sweep import Share, Sweep, sweep
from interrupted import Interrupted

HERE = Path(__file__).parent
RUNS = 2 * CHUNK + 20
SEED = 7
SPREAD = ab.Dispersion(mass=0.03, inertia=0.1, rotor=0.03, lag=0.25, start_position=0.02)  # quick to compile


@cache
def hop() -> ab.Plan:
    """A plan of a second or so, without a gate."""
    up = ab.Problem("hop", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((0.5, 0.2, 0.3)))
    return ab.plan(up, ab.Miqp(), "agile-quad")


@cache
def whole(conditions: ab.Dispersion = SPREAD) -> Sweep:
    """The sweep, unbroken, in this process."""
    return sweep(hop(), conditions, RUNS, SEED, workers=1)


def test_batches_change_no_bit() -> None:
    assert sweep(hop(), SPREAD, RUNS, SEED, workers=1, batch=7) == whole()


@pytest.mark.process
def test_neither_batches_nor_processes_change_a_bit_of_flights_that_are_observed() -> None:
    lab = ab.load_dispersion("lab")
    for workers in (1, 2):
        assert sweep(hop(), lab, RUNS, SEED, workers=workers, batch=7) == whole(lab)


def test_a_batch_of_one_flies_as_it_does_among_others() -> None:
    few, many = (sweep(hop(), SPREAD, 3, SEED, workers=1, batch=batch, engine="compiled") for batch in (1, 3))
    assert few == many


def test_a_row_is_the_score_of_that_flight_alone() -> None:
    for number in (0, CHUNK, RUNS - 1):
        numbers = range(number, number + 1)
        (alone,) = ab.score_flights(hop(), conditions=SPREAD, seed=SEED, flights=numbers, engine="compiled")
        row = {name: column[number] for name, column in whole().table.items()}
        assert row["flight"] == number
        assert row["outcome"] == alone.outcome.name.lower()
        for name in ("max_position_error_m", "rms_attitude_error_deg", "saturated_fraction"):
            assert row[name] == getattr(alone, name)


def test_more_flights_begin_with_those_of_fewer() -> None:
    fewer = sweep(hop(), SPREAD, CHUNK + 3, SEED, workers=1)
    for name, column in fewer.table.items():
        np.testing.assert_array_equal(column, whole().table[name][: len(fewer)])


def test_other_seeds_are_other_flights() -> None:
    other = sweep(hop(), SPREAD, 3, SEED + 1, workers=1)
    assert not np.isin(other.table["mass"], whole().table["mass"]).any()


@pytest.mark.parametrize("chunks", [0, 2])
def test_an_interrupted_sweep_goes_on_where_it_stopped(tmp_path: Path, chunks: int) -> None:
    kept = tmp_path / "kept"
    with pytest.raises(KeyboardInterrupt):
        sweep(hop(), SPREAD, RUNS, SEED, workers=1, keep=kept, executor=Interrupted(chunks))
    flown: list[int] = []
    again = sweep(
        hop(),
        SPREAD,
        RUNS,
        SEED,
        workers=1,
        batch=9,
        keep=kept,
        progress=lambda done, well: flown.append(done),
    )
    assert again == whole()
    assert flown[-1] == RUNS
    # all is kept by now: nothing is flown any more
    assert sweep(hop(), SPREAD, RUNS, SEED, keep=kept, executor=Interrupted(0)) == whole()


def test_finished_flights_of_another_sweep_are_not_taken(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    sweep(hop(), "none", 2, SEED, workers=1, keep=kept)
    others = {
        "conditions": {"conditions": "lab"},
        "seed": {"seed": 8},
        "vehicle": {"vehicle": "crazyflie"},
        "controller": {"controller": ab.Controller(moment_feedforward=False)},
        "engine": {"engine": "floats"},
    }
    for name, change in others.items():
        options: dict[str, Any] = {"conditions": "none", "seed": SEED} | change
        with pytest.raises(ab.SpecError, match=rf"keeps flights of another sweep \({name}\); remove it"):
            sweep(hop(), runs=2, workers=1, keep=kept, **options)
    (kept / "fingerprint.json").write_text("{}")
    with pytest.raises(ab.SpecError, match="keeps no flights of a sweep"):
        sweep(hop(), "none", 2, SEED, workers=1, keep=kept)
    (tmp_path / "file").write_text("")
    with pytest.raises(ab.SpecError, match=r"cannot keep flights in .*: Not a directory"):
        sweep(hop(), "none", 2, SEED, workers=1, keep=tmp_path / "file")


@pytest.mark.parametrize("damage", [b"", b"PK", None])
def test_kept_flights_that_are_damaged_are_flown_again(tmp_path: Path, damage: bytes | None) -> None:
    kept = tmp_path / "kept"
    first = sweep(hop(), "none", 3, SEED, workers=1, keep=kept)
    (file,) = kept.glob("*.npz")
    if damage is None:
        np.savez(file, something=np.zeros(3))
    else:
        file.write_bytes(damage)
    assert sweep(hop(), "none", 3, SEED, workers=1, keep=kept) == first


@pytest.mark.parametrize("number", [np.nan, 1e9])
def test_kept_flights_of_which_a_number_was_changed_are_flown_again(tmp_path: Path, number: float) -> None:
    kept = tmp_path / "kept"
    first = sweep(hop(), "none", 3, SEED, workers=1, keep=kept)
    (file,) = kept.glob("*.npz")
    content = read_arrays(file, "sweep")
    changed = next(name for name, column in content.items() if column.dtype.kind == "f")
    content[changed].flat[0] = number
    np.savez(file, **content)
    assert sweep(hop(), "none", 3, SEED, workers=1, keep=kept) == first


# flies with two processes, and ends itself by a signal when some chunks are finished
ENDED_BY = """
import os, signal, sys
from test_sweep import RUNS, SEED, SPREAD, hop, sweep

def progress(done, well):
    print("flown", done, flush=True)
    os.kill(os.getpid(), int(sys.argv[1]))

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a job in the background begins without
    sweep(hop(), SPREAD, RUNS, SEED, workers=2, keep="kept", progress=progress)
"""


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="there processes are ended otherwise")
@pytest.mark.parametrize("ended_by", ["SIGKILL", "SIGINT"])
def test_a_sweep_that_is_killed_leaves_no_process_and_goes_on_where_it_stopped(
    tmp_path: Path, ended_by: str
) -> None:
    number = getattr(signal, ended_by)
    script = tmp_path / "script.py"
    script.write_text(ENDED_BY)
    done = subprocess.run(
        [sys.executable, str(script), str(int(number))],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent / "support")])},
        capture_output=True,  # to its end: the pipes close when the last process that holds them ends
        text=True,
    )
    assert done.returncode == -number
    assert done.stdout.startswith("flown ")
    if ended_by == "SIGINT":
        assert done.stderr.rstrip().endswith("KeyboardInterrupt")
        assert done.stderr.count("Traceback") == 1  # none of a worker's
    finished = list((tmp_path / "kept").glob("flights-*.npz"))
    assert 1 <= len(finished) < 3
    assert {path.name for path in (tmp_path / "kept").iterdir()} == {
        "fingerprint.json",
        *(path.name for path in finished),
    }
    assert sweep(hop(), SPREAD, RUNS, SEED, workers=1, keep=tmp_path / "kept") == whole()


def test_an_executor_can_be_handed_in() -> None:
    with ThreadPoolExecutor(2) as executor:
        assert sweep(hop(), SPREAD, RUNS, SEED, executor=executor) == whole()


@given(of=st.integers(1, 5000), fraction=st.floats(0.0, 1.0))
def test_intervals_of_shares_are_those_of_an_exact_test(of: int, fraction: float) -> None:
    share = Share(round(fraction * of), of)
    expected = binomtest(share.count, of).proportion_ci(method="exact")
    assert share.interval == pytest.approx((expected.low, expected.high), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("count", "of"), [(0, 0), (5, 3), (-1, 3), (0, -1)])
def test_a_share_is_of_one_flight_or_more_and_no_more_than_all(count: int, of: int) -> None:
    with pytest.raises(ab.SpecError, match=f"got {count} of {of}$"):
        Share(count, of)


def test_a_range_is_rounded_outward_so_that_it_excludes_nothing_of_the_interval() -> None:
    assert Share(772, 800).interval[0] < 0.95
    assert Share(772, 800).range == "94.9 to 97.7 %"
    for count in range(1000):
        low, high = Share(count, 999).interval
        first, _, last, _ = Share(count, 999).range.split()
        assert Decimal(first) <= 100 * Decimal(low) <= 100 * Decimal(high) <= Decimal(last)


@pytest.mark.parametrize(
    ("count", "of", "text"),
    [
        (0, 10, "0 % (0 to 30.9 %)"),
        (999_999, 10**6, "99.9999 % (99.999 to 99.999998 %)"),
        (1, 10**5, "0.001 %"),
    ],
)
def test_a_share_that_is_not_all_does_not_say_so(count: int, of: int, text: str) -> None:
    assert str(Share(count, of)).startswith(text)
