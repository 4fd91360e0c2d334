"""Results in notebooks: the tables of a terminal as HTML, below their figures."""

from __future__ import annotations

from base64 import b64encode
from functools import lru_cache
from io import StringIO
from typing import Any

from rich.console import Console

from aerobat.errors import SpecError
from aerobat.reporting.facts import picture
from aerobat.reporting.page import png as png_of
from aerobat.reporting.tables import table


def html(value: Any) -> str:
    """Return the HTML of a result: its facts, under its picture if it has one."""
    console = Console(record=True, file=StringIO(), width=120, force_jupyter=False)
    console.print(table(value))
    pre = '<pre style="line-height: 1.3; overflow-x: auto">{code}</pre>'
    text = console.export_html(inline_styles=True, code_format=pre)
    found = png(value)
    if found is None:
        return text
    encoded = b64encode(found).decode()
    return f'<img style="max-width: 100%" src="data:image/png;base64,{encoded}">{text}'


def png(value: Any) -> bytes | None:
    """Return the picture of a result as PNG; None if it has none, or its vehicle is not known."""
    try:
        hash(value)
    except TypeError:
        return _drawn(value)
    return _drawn_once(value)


def _drawn(value: Any) -> bytes | None:
    try:
        figure = picture(value)
    except SpecError:  # a plan without a vehicle, a flight of one that is no preset
        return None
    return None if figure is None else png_of(figure)


_drawn_once = lru_cache(maxsize=8)(_drawn)  # notebooks request each picture twice
