"""Docstrings, written as plain text with code in backticks, as Sphinx reads them; fields of classes below."""

import dataclasses
import re
from typing import Any

from make_files_page import comments
from sphinx.application import Sphinx

CODE = re.compile(r"(`[^`]*`)")
SPECIAL = re.compile(r"([\\*|]|_(?=\W|$))")


def as_restructured_text(
    app: Sphinx, what: str, name: str, value: Any, options: Any, lines: list[str]
) -> None:
    """Escape what means something to Sphinx and nothing to whoever wrote it; tell a class's fields."""
    lines[:] = [escaped(line) for line in lines]
    if what == "class" and dataclasses.is_dataclass(value):
        lines += ["", *fields(value)]


def escaped(line: str) -> str:
    """A line with its special characters escaped, but for those within backticks."""
    parts = CODE.split(line)
    return "".join(part if k % 2 else SPECIAL.sub(r"\\\1", part) for k, part in enumerate(parts))


def fields(cls: Any) -> list[str]:
    """A class's fields as its parameters, with the comments beside them in its source."""
    told = {}
    for base in reversed(cls.__mro__):
        if dataclasses.is_dataclass(base):
            told.update(comments(base))
    lines = []
    for field in dataclasses.fields(cls):
        if not field.name.startswith("_"):
            unit, meaning = told.get(field.name, ("", ""))
            text = " ".join(filter(None, (f"[{unit}]" if unit else "", meaning)))
            lines.append(f":param {field.name}: {escaped(text)}")
    return lines
