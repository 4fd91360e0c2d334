"""Tables of sweeps as files: what is written is read back, to the last digit."""

from __future__ import annotations

import builtins
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.documents import MAX_DOCUMENT
from aerobat.errors import BackendMissing, SpecError
from aerobat.interchange import read_table, write_table
from suites import examples

FLOATS = st.floats(allow_nan=True, allow_infinity=True)
LETTERS = st.characters(codec="utf-8", exclude_categories=["Cc"])  # names are one line
WORDS = st.text(LETTERS, max_size=20).map(lambda text: f"w{text}")


@st.composite
def tables(draw: st.DrawFn) -> dict[str, np.ndarray]:
    rows = draw(st.integers(1, 20))
    kinds = [st.integers(-(2**63), 2**63 - 1), FLOATS, WORDS]
    names = draw(st.lists(WORDS, min_size=1, max_size=5, unique=True))
    return {
        name: np.array(draw(st.lists(draw(st.sampled_from(kinds)), min_size=rows, max_size=rows)))
        for name in names
    }


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@given(table=tables())
@examples(50)
def test_a_table_is_read_back_as_it_was_written(
    tmp_path_factory: pytest.TempPathFactory, suffix: str, table: dict[str, np.ndarray]
) -> None:
    path = tmp_path_factory.getbasetemp() / f"table.{suffix}"
    write_table(table, path)
    found = read_table(path)
    assert list(found) == list(table)
    for name, column in table.items():
        assert found[name].dtype.kind == column.dtype.kind
        np.testing.assert_array_equal(found[name], column)


def test_a_table_longer_than_documents_may_be_is_read_back(tmp_path: Path) -> None:
    table = {"flight": np.arange(250_000) + 10**17}
    write_table(table, tmp_path / "long.csv")
    assert (tmp_path / "long.csv").stat().st_size > MAX_DOCUMENT
    np.testing.assert_array_equal(read_table(tmp_path / "long.csv")["flight"], table["flight"])


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_without_rows_and_one_of_true_and_false_are_read_back(tmp_path: Path, suffix: str) -> None:
    write_table({"a": [], "b": []}, tmp_path / f"table.{suffix}")
    assert {name: column.tolist() for name, column in read_table(tmp_path / f"table.{suffix}").items()} == {
        "a": [],
        "b": [],
    }
    write_table({"well": [True, False]}, tmp_path / f"table.{suffix}")
    np.testing.assert_array_equal(read_table(tmp_path / f"table.{suffix}")["well"], [True, False])


@pytest.mark.parametrize("content", [b"", b"a,b\n1\n", b"a,a\n1,2\n", b"\xff\xfe", b"PAR1\n1,2\n"])
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_file_that_is_no_table_is_refused_in_a_sentence(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    path = tmp_path / f"table.{suffix}"
    for _ in range(2):  # not there, then damaged
        with pytest.raises(SpecError, match=f"^table file .*table.{suffix}: ") as refused:
            read_table(path)
        assert "\n" not in str(refused.value)
        path.write_bytes(content)
    with pytest.raises(SpecError, match=r"ends in \.csv or \.parquet"):
        write_table({"a": [1.0]}, tmp_path / "table.txt")
    assert not (tmp_path / "table.txt").exists()


@pytest.mark.parametrize(
    "table", [{}, {"a": [1.0], "b": [1.0, 2.0]}, {"a": [[1.0]]}, {"a": 1.0}, {"a": [None]}]
)
def test_what_is_no_table_is_refused(tmp_path: Path, table: dict[str, Any]) -> None:
    for suffix in ("csv", "parquet"):
        with pytest.raises(SpecError, match=r"^table must hold columns"):
            write_table(table, tmp_path / f"table.{suffix}")
    assert not list(tmp_path.iterdir())


def test_parquet_without_its_library_names_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import_module = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return import_module(name, *args, **kwargs)

    for name in [name for name in sys.modules if name.startswith("pyarrow")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(BackendMissing, match=r'pip install "aerobat\[parquet\]"'):
        write_table({"a": [1.0]}, tmp_path / "table.parquet")
    assert not list(tmp_path.iterdir())
