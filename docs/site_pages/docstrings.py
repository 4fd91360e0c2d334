"""Docstrings, written as plain text with code in backticks, as Sphinx reads them; fields of classes below."""

import dataclasses
import re
from itertools import accumulate
from typing import Any

from make_files_page import comments
from sphinx.application import Sphinx

CODE = re.compile(r"(`[^`]*`)")
DESCRIPTION = re.compile(r"description='([^']*)'")
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
    told = comments(cls)
    lines = []
    for field in dataclasses.fields(cls):
        if not field.name.startswith("_"):
            unit, meaning = told.get(field.name, ("", ""))
            text = " ".join(filter(None, (f"[{unit}]" if unit else "", meaning)))
            lines.append(f":param {field.name}: {escaped(text)}")
    return lines


def readable_types(app: Sphinx, what: str, name: str, value: Any, *signature: Any) -> None:
    """Say types that carry a check by what the check asks: a positive number, three numbers."""
    kept = app.env.current_document.autodoc_annotations.get(name, {})
    for parameter, text in kept.items():
        kept[parameter] = without_checks(text)


def without_checks(text: str) -> str:
    """A type's text with each Annotated[...] replaced by its description, or by the type that it checks."""
    start = text.find("Annotated[")
    if start < 0:
        return text
    inside = text.index("[", start) + 1
    depths = accumulate((character == "[") - (character == "]") for character in text[inside:])
    end = inside + next(k for k, depth in enumerate(depths) if depth < 0)
    checks = DESCRIPTION.findall(text[inside:end])
    plain = checks[-1] if checks else text[inside:end].partition(", ")[0]
    before = text[:start].removesuffix("~typing.").removesuffix("typing.").removesuffix("~")
    return before + plain + without_checks(text[end + 1 :])
