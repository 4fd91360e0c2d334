"""Values as notebooks show them, by what `aerobat.reporting.notebooks` makes of them.

A value knows that it can be shown, not how: that room is named here and imported when a notebook asks.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, TypeVar

T = TypeVar("T")

_REPORTER = "aerobat.reporting.notebooks"


def in_notebooks(cls: type[T]) -> type[T]:
    """Give a class a table for notebooks and, where there is one of its values, a picture."""
    made: Any = cls
    made._repr_html_ = _repr_html_
    made._repr_png_ = _repr_png_
    return cls


def _repr_html_(self: Any) -> str:
    """HTML of the value: a table, and its picture."""
    html: str = import_module(_REPORTER).html(self)
    return html


def _repr_png_(self: Any) -> bytes | None:
    """The picture as PNG; None where there is none."""
    png: bytes | None = import_module(_REPORTER).png(self)
    return png
