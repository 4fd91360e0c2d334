"""Results as tables for a terminal: a row for each fact, or for each result of a list."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from enum import Enum
from itertools import groupby
from typing import Any

import numpy as np
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from aerobat.reporting.facts import EXPLAIN, REPORT, WARNING, Fact, Facts, facts, line

HeadedFact = tuple[str, Fact]  # the heading that a fact stands under, and the fact


def table(result: Any, least: int = REPORT, most: int = EXPLAIN, title: str = "") -> Group:
    """Return the tables of a result: lines, a fact a row, and rows under their headings.

    Args:
        result: The result.
        least: The lowest level of the facts that are shown.
        most: The highest level; the lines of a report, level 0, have no headings.
        title: A first line in place of the result's own.
    """
    headed = [
        (heading if most else "", fact)
        for heading, fact in _headed_facts(result)
        if least <= fact.level <= most
    ]
    if title:
        headed = [("", line("", title)), *(headed[1:] if headed and not headed[0][1].label else headed)]
    return Group(*_parts(headed))


def print_table(table: Table | Group) -> None:
    """Print a table to standard output; a pipe has 120 columns."""
    console = Console()
    (console if console.is_terminal else Console(width=120)).print(table)


def _headed_facts(result: Any, heading: str = "", inner: bool = False) -> Iterator[HeadedFact]:
    """Yield the facts that a table shows, with their headings; results within a result have no lines."""
    for fact in facts(result):
        if fact.text is not None or _is_plain(fact.value):
            shown = fact.value if fact.text is None else fact.text
            tells = isinstance(shown, int | float) or (isinstance(shown, str) and shown)
            if tells and (fact.label or (fact.text and not inner)):
                yield heading, fact
        elif isinstance(fact.value, list | tuple) and not isinstance(fact.value, Facts):
            if fact.label and fact.value:
                yield heading, fact
        else:
            yield from _headed_facts(fact.value, fact.label or heading, inner=True)


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, dict | str | int | float | Enum | np.ndarray)


def _parts(headed: Iterable[HeadedFact]) -> Iterator[Table | Text]:
    """Yield lines and tables, in their order."""
    for kind, group in groupby(headed, key=lambda each: _kind(each[1])):
        if kind == "line":
            yield from (Text(fact.words, style=fact.style or "italic") for _, fact in group)
        elif kind == "rows":
            yield from (_rows([tuple(facts(row)) for row in fact.value]) for _, fact in group)
        else:
            yield _facts_table(sorted(group, key=lambda each: each[1].label == WARNING))


def _kind(fact: Fact) -> str:
    """Return the form of a fact: a line of its own, a table of rows, or a row."""
    if not fact.label:
        return "line"
    return "rows" if fact.text is None and isinstance(fact.value, list | tuple) else "row"


def _facts_table(headed: Iterable[HeadedFact]) -> Table:
    """Return a table of facts, one a row, under their headings."""
    made = Table(show_header=False, box=None)
    made.add_column(style="bold", no_wrap=True)
    made.add_column(no_wrap=True)
    made.add_column()
    before = ""
    for heading, fact in headed:
        made.add_row("" if heading == before else heading, fact.label, _text(fact))
        before = heading
    return made


def _rows(rows: list[tuple[Fact, ...]]) -> Table:
    """Return a table of results of one kind, one a row, with numbers aligned right."""
    made = Table(box=None, pad_edge=False)
    shown = [[fact for fact in row if fact.label] for row in rows]
    for k, column in enumerate(zip(*shown, strict=True)):
        is_number = any(isinstance(fact.value, int | float) for fact in column)
        is_short = is_number or k == 0
        made.add_column(column[0].label, justify="right" if is_number else "left", no_wrap=is_short)
    for row in shown:
        made.add_row(*map(_text, row))
    return made


def _text(fact: Fact) -> Text:
    return Text(fact.words, style=fact.style)  # none of its brackets taken for markup
