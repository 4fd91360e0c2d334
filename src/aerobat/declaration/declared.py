"""The decorator for value classes, frozen and checked by pydantic; conversion from and to tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from functools import wraps
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from pydantic import Field, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic_core import CoreSchema, core_schema

from aerobat.arrays import Array
from aerobat.declaration.field_types import CONFIG, in_degrees, in_radians, plain
from aerobat.declaration.sentences import (
    FieldError,
    UnknownKey,
    first_complaint,
    one_of,
    shown,
    unknown_key,
    with_article,
)
from aerobat.declaration.values import by_value, is_default
from aerobat.errors import SpecError

PAPER_THRUST = ("eps", "ε")  # prefixes of the paper's names for minimum thrusts
T = TypeVar("T")


def from_table(cls: type[T], table: Mapping[str, Any]) -> T:
    """Return the value of the declared class `cls` from a table, whose keys are fields and shorthands.

    Raises FieldError, one sentence that names the field, when the table does not fit.
    """
    if not isinstance(table, Mapping):
        raise FieldError("", f"must be a table, got {shown(table)}")
    declaration: Any = cls
    known = [*(field.name for field in dataclasses.fields(declaration)), *getattr(cls, "SHORTHANDS", ())]
    for key in table:
        if key not in known:
            raise _unknown(str(key), known)
    values = dict(table)
    if hasattr(cls, "expand"):
        values = declaration.expand(values)
    for name in _angles(cls):
        values = in_radians(values, name)
    value = cls.__new__(cls)
    declaration.__checked_init__(value, values)
    return value


def _angles(cls: Any) -> list[str]:
    """Return the fields that have a shorthand in degrees."""
    fields = {field.name for field in dataclasses.fields(cls)}
    names = (key.removesuffix("_deg") for key in getattr(cls, "SHORTHANDS", ()) if key.endswith("_deg"))
    return [name for name in names if name in fields]


def _unknown(key: str, known: Sequence[str]) -> UnknownKey:
    """Return the error about an unknown key; for the paper's ε it suggests the corresponding fields."""
    thrusts = [name for name in known if name.startswith("min_") and name.endswith("thrust")]
    if thrusts and key.lower().startswith(PAPER_THRUST):
        return UnknownKey(key, f"is not a known key; the paper's ε is {one_of(thrusts)} here")
    return unknown_key(key, known)


def to_table(value: Any) -> dict[str, Any]:
    """Return the table from which `from_table` makes exactly this value, without fields at their defaults.

    Raises SpecError for a value that files cannot hold.
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
    if hasattr(value, "abbreviate"):
        table = value.abbreviate(table)
    for name in _angles(type(value)):
        if isinstance(table.get(name), float):
            table = in_degrees(table, name)
    return kind | table


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _components(value)
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if isinstance(value, Enum):
        return value.value
    return to_table(value) if dataclasses.is_dataclass(value) else value


def _components(array: Array) -> Any:
    """Return lists of numbers; with free components, a table of the given ones."""
    if not np.isnan(array).any():
        return array.tolist()
    return {axis: x for axis, x in zip("xyz", array.tolist(), strict=True) if not np.isnan(x)}


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def declared(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass with fields that pydantic checks.

    Called from Python or read by `from_table`, it raises SpecError, one sentence that names the field.
    A float must be a finite number, and neither text nor bool; lists become tuples, arrays are read-only.
    `__post_init__` checks relations between fields and raises FieldError. Equality and hash compare contents.

    In files a key may stand for fields: `SHORTHANDS` then gives each such key its meaning. The key NAME_deg
    beside a field NAME holds that angle in degrees. The class method `expand(table)` replaces other
    shorthands by fields on reading, and the method `abbreviate(table)` does the reverse on writing.
    """
    plain_class: Any = cls  # checked as a plain class, even if a field of its base takes tables
    plain_class.__get_pydantic_core_schema__ = classmethod(lambda _, source, handler: handler(source))
    made: Any = pydantic_dataclass(frozen=True, eq=False, config=CONFIG)(cls)
    in_order = sorted(made.__dataclass_fields__.items(), key=lambda item: item[1].kw_only is True)
    made.__dataclass_fields__ = dict(in_order)  # keyword-only fields of a base come last
    made.__get_pydantic_core_schema__ = classmethod(_field_schema)
    made.__checked_init__ = _checked(made.__init__)
    made.__init__ = _named_init(made)
    return by_value(made)


def _checked(init: Callable[..., None]) -> Callable[..., None]:
    """Return an initializer that raises FieldError in place of pydantic's error."""

    def checked_init(self: Any, values: Mapping[str, Any]) -> None:
        try:
            init(self, **{name: plain(value) for name, value in values.items()})
        except ValidationError as error:
            raise first_complaint(error) from None

    return checked_init


def _named_init(cls: Any) -> Callable[..., None]:
    """Return the initializer for Python callers, with errors that begin with the class name."""
    names = tuple(field.name for field in dataclasses.fields(cls))

    @wraps(cls.__init__)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        try:
            if len(args) > len(names):
                raise FieldError("", f"takes {len(names)} values, got {len(args)}")
            for name in kwargs:
                if name not in names:
                    raise unknown_key(name, names)
                if name in names[: len(args)]:
                    raise FieldError(name, "is given twice; give it once")
            cls.__checked_init__(self, dict(zip(names, args, strict=False)) | kwargs)
        except FieldError as error:
            raise SpecError(str(error.inside(cls.__name__))) from None

    return __init__


def _field_schema(cls: Any, source: Any, handler: Any) -> CoreSchema:
    """Return the schema of fields of the class `cls`: an instance, or a table to make one from."""

    def read(value: Any) -> Any:
        if isinstance(value, Mapping):
            return from_table(cls, value)
        if not isinstance(value, cls):
            one = with_article(cls.__name__)
            raise FieldError("", f"must be {one}, in a file a table, got {shown(value)}")
        return value

    return core_schema.no_info_plain_validator_function(read)
