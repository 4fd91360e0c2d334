"""A run's folder is one result: the old one or the new one, whatever happens in between."""

from __future__ import annotations

import errno
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from aerobat.errors import SpecError
from aerobat.storage import whole_folder, write_whole

NAMES = [f"part-{i}" for i in range(6)]
WRITER = """
import sys
from aerobat.storage import whole_folder, write_whole
for mark in range(1_000_000):
    with whole_folder(sys.argv[1], lambda name: name.startswith("part-")) as folder:
        for i in range(6):
            (folder / f"part-{i}").write_text(str(mark))
    print(mark, flush=True)
"""


def ours(name: str) -> bool:
    return name in NAMES


def contents(folder: Path) -> set[tuple[str, str]]:
    return {(path.name, path.read_text()) for path in folder.iterdir()}


def written(folder: Path, mark: str) -> None:
    with whole_folder(folder, ours) as staging:
        for name in NAMES:
            (staging / name).write_text(mark)


def test_a_folder_is_replaced_as_one(tmp_path: Path) -> None:
    target = tmp_path / "new" / "run"
    with whole_folder(target, ours) as staging:
        (staging / "part-0").write_text("old")
        (staging / "part-5").write_text("old")
    written(target, "new")
    assert contents(target) == {(name, "new") for name in NAMES}
    assert [path.name for path in target.parent.iterdir()] == ["run"]


def test_the_current_folder_stays_and_has_the_new_files_alone(tmp_path: Path, monkeypatch) -> None:
    """It was replaced: whoever was in it saw an empty folder."""
    monkeypatch.chdir(tmp_path)
    Path("part-5").write_text("old")
    for mark in ("first", "second"):
        with whole_folder(".", ours) as folder:
            (folder / "part-0").write_text(mark)
        assert contents(Path()) == {("part-0", mark)}
    Path("notes").write_text("of others")
    with pytest.raises(SpecError, match="holds notes"):
        written(Path(), "third")
    assert contents(Path()) == {("part-0", "second"), ("notes", "of others")}


def test_a_block_that_fails_leaves_the_old_folder_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "run"
    written(target, "old")

    def fail() -> None:
        with whole_folder(target, ours) as staging:
            (staging / "part-0").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert contents(target) == {(name, "old") for name in NAMES}
    assert os.listdir(tmp_path) == ["run"]


def test_somebody_elses_files_are_not_replaced(tmp_path: Path) -> None:
    target = tmp_path / "run"
    target.mkdir()
    (target / "thesis.tex").write_text("years of work")
    with pytest.raises(SpecError, match=r"holds thesis\.tex, which no run wrote"):
        written(target, "new")
    assert os.listdir(target) == ["thesis.tex"]
    assert os.listdir(tmp_path) == ["run"]


def test_a_place_that_is_no_folder_is_refused_in_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("a file")
    with pytest.raises(SpecError, match="cannot write"):
        written(tmp_path / "run", "new")


def test_a_link_to_a_folder_or_a_file_stays_and_what_it_names_is_replaced(tmp_path: Path) -> None:
    written(tmp_path / "real" / "run", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real" / "run")
    written(tmp_path / "link", "new")
    write_whole(tmp_path / "real" / "file", "old")
    (tmp_path / "to-file").symlink_to(tmp_path / "real" / "file")
    write_whole(tmp_path / "to-file", "new")
    assert contents(tmp_path / "real" / "run") == {(name, "new") for name in NAMES}
    assert (tmp_path / "real" / "file").read_text() == "new"
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "to-file").is_symlink()
    assert sorted(os.listdir(tmp_path)) == ["link", "real", "to-file"]
    assert sorted(os.listdir(tmp_path / "real")) == ["file", "run"]


def test_a_message_about_a_full_disk_names_the_folder_that_was_asked_for(tmp_path: Path, monkeypatch) -> None:
    def fail(self: Path, content: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(Path, "write_bytes", fail)
    target = tmp_path / "run"
    with pytest.raises(SpecError) as refused, whole_folder(target, ours) as staging:
        write_whole(staging / "part-0", "new")
    assert str(refused.value) == f"cannot write {target}: No space left on device"
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name != "posix", reason="modes are of such systems")
@pytest.mark.parametrize("mode", [0o600, 0o440, 0o755])
def test_what_is_replaced_keeps_its_mode(tmp_path: Path, mode: int) -> None:
    write_whole(tmp_path / "file", "old")
    written(tmp_path / "run", "old")
    kept = tmp_path / "file", tmp_path / "run" / "part-0", tmp_path / "run"
    for path, bits in zip(kept, (mode, mode, 0o700), strict=True):
        path.chmod(bits)
    write_whole(tmp_path / "file", "new")
    written(tmp_path / "run", "new")
    assert (tmp_path / "file").read_text() == "new"
    assert [path.stat().st_mode & 0o777 for path in kept] == [mode, mode, 0o700]


@pytest.mark.skipif(os.name != "posix", reason="no such files there")
def test_a_pipe_or_a_device_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SpecError, match=r"cannot write .*pipe: it is a pipe or a device"):
        write_whole(tmp_path / "pipe", "new")
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="two folders change places at once on Linux")
def test_killed_at_any_instant_it_is_the_old_run_or_the_new_one_and_the_next_run_clears_up(
    tmp_path: Path,
) -> None:
    target, rng = tmp_path / "run", random.Random(0)
    for _ in range(12):
        with subprocess.Popen([sys.executable, "-c", WRITER, str(target)], stdout=subprocess.PIPE) as process:
            assert process.stdout is not None
            process.stdout.readline()
            time.sleep(rng.uniform(0.0, 0.02))
            process.send_signal(signal.SIGKILL)
        marks = {text for _, text in contents(target)}
        assert len(marks) == 1
        assert len(os.listdir(target)) == 6
    written(tmp_path / "another", "end")
    assert sorted(os.listdir(tmp_path)) == ["another", "run"]


@pytest.mark.skipif(os.name != "posix", reason="only there a process can be asked for")
def test_what_dead_processes_left_is_cleared_and_nothing_else(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as process:
        dead = process.pid
    (tmp_path / f".run.{dead}.aerobat-part").mkdir()
    (tmp_path / f".run.{dead}.aerobat-part" / "part-0").write_text("half")
    (tmp_path / f".flip.x_1.{dead}.aerobat-part.plan").write_text("half")
    kept = [
        f".v{dead}.{os.getpid()}.aerobat-part",  # of one that runs
        f".v.{dead}.{os.getpid()}.aerobat-part.toml",
        ".mine.aerobat-part",
        f".mine.{dead}",
    ]
    for name in kept:
        (tmp_path / name).write_text("")
    write_whole(tmp_path / "file", "whole")
    assert sorted(os.listdir(tmp_path)) == sorted([*kept, "file"])
