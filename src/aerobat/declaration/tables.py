"""Declared values as tables of plain numbers, text and lists, as TOML and JSON hold them, and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration.sentences import FieldError, UnknownKey, one_of, shown, unknown_key
from aerobat.declaration.values import is_default
from aerobat.errors import SpecError

PAPER_THRUST = ("eps", "ε")  # begins names of least specific thrusts, as the paper has them

T = TypeVar("T")


def from_table(cls: type[T], table: Mapping[str, Any]) -> T:
    """The value of the declared class `cls` that a table describes, whose keys are its fields and shorthands.

    Raises FieldError, one sentence that names the field from here on, when the table does not fit.
    """
    if not isinstance(table, Mapping):
        raise FieldError("", f"must be a table, got {shown(table)}")
    declaration: Any = cls
    known = [*(field.name for field in dataclasses.fields(declaration)), *getattr(cls, "SHORTHANDS", ())]
    for key in table:
        if key not in known:
            raise _unknown(str(key), known)
    values = dict(table)
    value = cls.__new__(cls)
    declaration.__checked_init__(value, declaration.expand(values) if hasattr(cls, "expand") else values)
    return value


def _unknown(key: str, known: Sequence[str]) -> UnknownKey:
    """The error about a key that no field has; the paper's ε is told by its names here."""
    thrusts = [name for name in known if name.startswith("min_") and name.endswith("thrust")]
    if thrusts and key.lower().startswith(PAPER_THRUST):
        return UnknownKey(key, f"is not a known key; the paper's ε is {one_of(thrusts)} here")
    return unknown_key(key, known)


def to_table(value: Any) -> dict[str, Any]:
    """The table from which `from_table` makes exactly this value; fields at their defaults are left out.

    Raises SpecError for a value that no file can hold.
    """
    if not hasattr(value, "__checked_init__"):
        raise SpecError(f"{type(value).__name__} has no place in a file: it is not declared")
    table = {
        field.name: _plain(getattr(value, field.name))
        for field in dataclasses.fields(value)
        if not is_default(value, field)
    }
    kind = {"kind": value.kind} if hasattr(value, "kind") else {}
    if kind and "kind" not in vars(type(value)):
        raise SpecError(f"{type(value).__name__} has no place in a file: it is not registered")
    return kind | (value.abbreviate(table) if hasattr(value, "abbreviate") else table)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _components(value)
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Enum):
        return value.value
    return to_table(value) if dataclasses.is_dataclass(value) else value


def _components(array: Array) -> Any:
    """Lists of numbers; a table of the components that are given where some are left free."""
    if not np.isnan(array).any():
        return array.tolist()
    return {axis: x for axis, x in zip("xyz", array.tolist(), strict=True) if not np.isnan(x)}
