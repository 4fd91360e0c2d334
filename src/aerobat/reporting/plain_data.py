"""Results as JSON and as tables of pandas: their facts by key, units in the keys."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat.declaration import shown, unknown_name, validated
from aerobat.errors import SpecError, import_extra
from aerobat.reporting.facts import Columns, Facts, Rows, facts

if TYPE_CHECKING:
    from pandas import DataFrame


@validated
def to_dataframe(result: Any, table: str | None = None) -> DataFrame:
    """Return a pandas DataFrame of a result, or of a list or tuple of results; units as in columns' names.

    A result that has tables gives the first of them: of a flight its rows, the series by their components, as
    `position_x` and `thrusts_0`, of a batch with the number of the vehicle first; of references and estimates
    their rows likewise; of a plan its attempts, of a comparison its planners, of scores the flights with
    their passages through each gate, of a sweep its flights, of a map of what is feasible its cells. A
    result without tables, or with empty ones alone, is one row.
    Raises BackendMissing without pandas, SpecError for what is no result, or has no such table.

    Args:
        result: The result.
        table: The key of another of its tables, as "stages" of a plan.
    """
    pandas = import_extra("pandas", "to_dataframe needs pandas", "aerobat[pandas]")
    if isinstance(result, list | tuple) and not isinstance(result, Facts):
        several = [plain(each) for each in result]
        if not all(isinstance(each, dict) for each in several):
            raise SpecError(f"result must be a result, or a list of results, got {shown(result)}")
        return pandas.DataFrame([dict(_cells(each)) for each in several])
    tables = {fact.key: fact.value for fact in facts(result) if fact.key and _is_table(fact.value)}
    if table is not None and table not in tables:
        raise unknown_name("table", table, list(tables))
    filled = (each for each in tables.values() if isinstance(each, Rows) or len(each))
    found = tables[table] if table is not None else next(filled, None)
    if isinstance(found, Columns):
        return pandas.DataFrame(dict(found))
    rows = [plain(result)] if found is None else map(plain, found)
    return pandas.DataFrame([dict(_cells(row)) for row in rows])


def _is_table(value: Any) -> bool:
    """Return True for columns, and for a sequence of results, even an empty one; arrays are no tables."""
    if isinstance(value, list | tuple) and not isinstance(value, Facts):
        return all(isinstance(plain(each), dict) for each in value[:1])
    return isinstance(value, Columns)


def _cells(row: dict[str, Any], begin: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the cells of a row, those within others by dotted keys."""
    for key, value in row.items():
        if isinstance(value, dict):
            yield from _cells(value, f"{begin}{key}.")
        else:
            yield f"{begin}{key}", value


def plain(value: Any) -> Any:
    """Return a result, or a value of a fact, as numbers, strings, lists and dictionaries.

    NaN and infinity, which JSON does not have, become None: unknown, or not limited.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Enum):
        return value.value if isinstance(value, str) else value.name.lower()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | range) and not isinstance(value, Facts):
        return [plain(each) for each in value]
    filed = (fact for fact in facts(value) if fact.key and not isinstance(fact.value, Columns))
    return {fact.key: plain(fact.value) for fact in filed}


def to_json(result: Any) -> str:
    """Return a result, or a list of results, as JSON text."""
    return json.dumps(plain(result), indent=2, ensure_ascii=False, allow_nan=False)
