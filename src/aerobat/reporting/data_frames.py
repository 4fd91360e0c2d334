"""to_dataframe(): a result as a table of pandas."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from aerobat.declaration import unknown_name, validated
from aerobat.errors import BackendMissing
from aerobat.reporting.facts import Columns, Facts, facts
from aerobat.reporting.plain_data import plain

if TYPE_CHECKING:
    from pandas import DataFrame


@validated
def to_dataframe(result: Any, table: str | None = None) -> DataFrame:
    """Return a pandas DataFrame of a result, or of a list of results; units as in its columns' names.

    A result that has tables gives the first of them: of a flight its rows, the series by their components, as
    `position_x` and `thrusts_0`, of a batch with the number of the vehicle first; of a plan its attempts, of
    a comparison its planners, of scores the flights with their passages through each gate, of a sweep its
    flights, of a map of what is feasible its cells. A result without tables is one row.
    Raises BackendMissing without pandas, SpecError for what is no result, or has no such table.

    Args:
        result: What it is of.
        table: The key of another of its tables, as "stages" of a plan.
    """
    try:
        from pandas import DataFrame
    except ImportError:
        remedy = 'pip install "aerobat[pandas]"'
        raise BackendMissing(f"to_dataframe needs pandas; install it with {remedy}") from None
    if isinstance(result, list):
        return DataFrame([dict(_cells(plain(each))) for each in result])
    tables = {fact.key: fact.value for fact in facts(result) if fact.key and _is_table(fact.value)}
    if table is not None and table not in tables:
        raise unknown_name("table", table, list(tables))
    found = tables.get(table) if table is not None else next(iter(tables.values()), None)
    if isinstance(found, Columns):
        return DataFrame(dict(found))
    rows = [plain(result)] if found is None else map(plain, found)
    return DataFrame([dict(_cells(row)) for row in rows])


def _is_table(value: Any) -> bool:
    """True for columns, and for a sequence of results, an empty one too."""
    is_rows = isinstance(value, list | tuple) and not isinstance(value, Facts)
    return isinstance(value, Columns) or (
        is_rows and not any(isinstance(each, int | float | str) for each in value)
    )


def _cells(row: dict[str, Any], begin: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the cells of a row, those within others by dotted keys."""
    for key, value in row.items():
        if isinstance(value, dict):
            yield from _cells(value, f"{begin}{key}.")
        else:
            yield f"{begin}{key}", value
