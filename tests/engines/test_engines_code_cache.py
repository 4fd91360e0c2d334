"""Machine code in files: compiled once, never a damaged one, and no folder is needed."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from aerobat.engines.llvm import code_cache


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of caches of the test's own."""
    place = tmp_path / "machine-code"
    monkeypatch.setattr(code_cache, "_folder", lambda: place)
    return place


def refuse() -> bytes:
    raise AssertionError("the code is kept: nothing is compiled")


def test_a_listing_is_compiled_once(folder: Path) -> None:
    assert code_cache.cached_code("%0 = input", lambda: b"first") == b"first"
    assert code_cache.cached_code("%0 = input", refuse) == b"first"
    assert code_cache.cached_code("%0 = another", lambda: b"second") == b"second"


def test_another_compiler_compiles_anew(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code_cache.cached_code("%0 = input", lambda: b"first")
    monkeypatch.setattr(code_cache, "_compiler", lambda: "changed sources")
    assert code_cache.cached_code("%0 = input", lambda: b"second") == b"second"


@pytest.mark.parametrize("damage", [lambda code: code[:-1], lambda code: code + b"0", lambda code: b""])
def test_a_damaged_file_is_compiled_anew(folder: Path, damage: Callable[[bytes], bytes]) -> None:
    code_cache.cached_code("%0 = input", lambda: b"code")
    (file,) = folder.iterdir()
    file.write_bytes(damage(file.read_bytes()))
    assert code_cache.cached_code("%0 = input", lambda: b"code") == b"code"
    assert code_cache.cached_code("%0 = input", refuse) == b"code"


def test_no_folder_is_needed(folder: Path) -> None:
    folder.write_text("a file where the folder should be")
    assert code_cache.cached_code("%0 = input", lambda: b"code") == b"code"


def test_files_that_were_used_least_recently_go(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(5):
        code_cache.cached_code(f"%{number} = input", lambda: b"code")
    for age, file in enumerate(folder.iterdir()):
        os.utime(file, (1e9 - age, 1e9 - age))
    code_cache.cached_code("%3 = input", refuse)
    monkeypatch.setattr(code_cache, "MAX_FILES", 2)
    code_cache.cached_code("%5 = input", lambda: b"code")
    assert len([*folder.iterdir()]) == 2
    for number in (3, 5):
        assert code_cache.cached_code(f"%{number} = input", refuse) == b"code"
