"""The decorator that makes a class a value: frozen, checked by pydantic, compared by content."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, TypeVar, dataclass_transform

import numpy as np
from pydantic import ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic_core import CoreSchema, core_schema

from aerobat.declaration.sentences import FieldError, first_complaint, shown, unknown_key
from aerobat.declaration.tables import from_table
from aerobat.declaration.values import by_value
from aerobat.errors import SpecError

T = TypeVar("T")

CONFIG = ConfigDict(
    strict=True,  # text, true and false are not numbers
    allow_inf_nan=False,
    arbitrary_types_allowed=True,
    validate_default=True,
)


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field, Field))
def declared(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass whose fields pydantic checks, whoever gives them.

    Called from Python or read by `from_table`, it raises SpecError, one sentence that names the field.
    A float is a finite number, and neither text nor bool; lists become tuples, arrays are read-only. What
    must hold between fields is for `__post_init__` to say, by FieldError. Equality and hash go by content.

    In files a key may stand for fields: `SHORTHANDS` then gives each such key its meaning, the class method
    `expand(table)` replaces them by fields on reading, and the method `abbreviate(table)` does the reverse on
    writing.
    """
    plain_class: Any = cls  # checked by its fields even where a field of its base takes tables
    plain_class.__get_pydantic_core_schema__ = classmethod(lambda _, source, handler: handler(source))
    made: Any = pydantic_dataclass(frozen=True, eq=False, config=CONFIG)(cls)
    in_order = sorted(made.__dataclass_fields__.items(), key=lambda item: item[1].kw_only is True)
    made.__dataclass_fields__ = dict(in_order)  # those of a base that are given by name come last
    made.__get_pydantic_core_schema__ = classmethod(_field_schema)
    made.__checked_init__ = _checked(made.__init__)
    made.__init__ = _named_init(made)
    return by_value(made)


def _checked(init: Callable[..., None]) -> Callable[..., None]:
    """The initializer that raises FieldError instead of pydantic's error."""

    def checked_init(self: Any, values: Mapping[str, Any]) -> None:
        try:
            init(self, **{name: plain(value) for name, value in values.items()})
        except ValidationError as error:
            raise first_complaint(error) from None

    return checked_init


def _named_init(cls: Any) -> Callable[..., None]:
    """The initializer for Python's callers, whose errors begin with the class."""
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


def plain(value: Any) -> Any:
    """A list as a tuple, a NumPy scalar as Python's."""
    if isinstance(value, list):
        return tuple(value)
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return value.item()
    return value


def _field_schema(cls: Any, source: Any, handler: Any) -> CoreSchema:
    """Where a field is of the class `cls`, it takes an instance, or a table to make one of."""

    def read(value: Any) -> Any:
        if isinstance(value, Mapping):
            return from_table(cls, value)
        if not isinstance(value, cls):
            raise FieldError("", f"must be a {cls.__name__}, in a file a table, got {shown(value)}")
        return value

    return core_schema.no_info_plain_validator_function(read)
