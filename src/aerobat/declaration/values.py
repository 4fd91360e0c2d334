"""Decorators for value classes: comparison, hash, copy and pickle by content, and one line of text."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from enum import Enum
from importlib import import_module
from typing import Any, TypeVar, dataclass_transform

import numpy as np

_REPORTER = "aerobat.reporting.notebooks"
T = TypeVar("T")

_NAN = "nan"  # stands for NaN, which is not equal to itself
_FEW = 9  # entries; a longer list is shown by its length
_known_names: dict[type[Any], tuple[str, ...]] = {}  # names of fields, by class


def in_notebooks(cls: type[T]) -> type[T]:
    """Let a class be represented by its text and, in notebooks, by a table and any picture of its values."""
    made: Any = short(cls)
    made._repr_html_ = _repr_html_
    made._repr_png_ = _repr_png_
    return cls


def _repr_html_(self: Any) -> str:
    """Return the value as HTML: a table and its picture."""
    html: str = import_module(_REPORTER).html(self)
    return html


def _repr_png_(self: Any) -> bytes | None:
    """Return the picture as PNG; None where there is none."""
    png: bytes | None = import_module(_REPORTER).png(self)
    return png


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(dataclasses.field,))
def by_value(cls: type[T]) -> type[T]:
    """Make a class a frozen dataclass with equality, hash, pickling and a line of text by its content.

    Arrays are compared by shape and numbers; NaN equals NaN. A class with a text or a representation of its
    own keeps it. A class that is a dataclass already, by `declared`, stays as it is.
    """
    if "__dataclass_fields__" not in vars(cls):
        cls = dataclasses.dataclass(frozen=True, eq=False)(cls)
    made: Any = cls
    made.__eq__ = _equal
    made.__hash__ = _hash
    made.__reduce__ = _reduce
    if made.__str__ is object.__str__:
        made.__str__ = _text
    return cls


def short(cls: type[T]) -> type[T]:
    """Let a class be represented by its text, where a full representation would fill pages."""
    made: Any = cls
    made.__repr__ = _representation
    return cls


def _representation(self: Any) -> str:
    name, text = type(self).__name__, str(self)
    return text if text.startswith(f"{name}(") else f"<{name}: {text}>"


def _names(cls: type[Any]) -> tuple[str, ...]:
    known = _known_names.get(cls)
    if known is None:
        known = _known_names[cls] = tuple(field.name for field in dataclasses.fields(cls))
    return known


def _comparable(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        is_float = value.dtype.kind == "f"
        return value.shape, (value + 0.0 if is_float else value).tobytes()  # no negative zeros
    if isinstance(value, tuple):
        return tuple(map(_comparable, value))
    if isinstance(value, Mapping):
        return tuple((key, _comparable(value[key])) for key in sorted(value))
    return _NAN if isinstance(value, float) and value != value else value


def _equal(self: Any, other: object) -> Any:
    if type(self) is not type(other):
        return NotImplemented
    if self is other or hash(self) != hash(other):
        return self is other
    pairs = ((getattr(self, name), getattr(other, name)) for name in _names(type(self)))
    return all(mine is its or _comparable(mine) == _comparable(its) for mine, its in pairs)


def _hash(self: Any) -> int:
    """Return the content's hash, cached if all arrays are read-only: vehicles and paths are cache keys."""
    known: int | None = self.__dict__.get("_hash")
    if known is None:
        parts = [getattr(self, name) for name in _names(type(self))]
        known = hash((type(self).__qualname__, tuple(map(_comparable, parts))))
        if not any(isinstance(part, np.ndarray) and part.flags.writeable for part in parts):
            object.__setattr__(self, "_hash", known)
    return known


def _reduce(self: Any) -> tuple[Any, ...]:
    """Return the pickle of the fields, which are checked again on loading, so that arrays stay read-only."""
    values = {name: getattr(self, name) for name in _names(type(self))}
    plain = {name: dict(value) if isinstance(value, Mapping) else value for name, value in values.items()}
    return _loaded, (type(self), plain)


def _loaded(cls: type[Any], values: dict[str, Any]) -> Any:
    return cls(**values)


def _text(self: Any) -> str:
    """Return the class name with the fields that are not at their defaults."""
    shown = (
        f"{field.name}={_short(getattr(self, field.name))}"
        for field in dataclasses.fields(self)
        if not is_default(self, field)
    )
    return f"{type(self).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.size > _FEW:
            return f"array of {' x '.join(map(str, value.shape))}"
        return _short(tuple(value.tolist())) if value.ndim else f"{value:g}"
    if isinstance(value, tuple | list | Mapping):
        if len(value) > _FEW:
            return f"{len(value)} entries"
        if isinstance(value, Mapping):
            return f"({', '.join(f'{key}={_short(each)}' for key, each in value.items())})"
        return f"({', '.join(map(_short, value))})"
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value) if dataclasses.is_dataclass(value) else repr(value)


def is_default(value: Any, field: dataclasses.Field[Any]) -> bool:
    """Return True where a field of a value has its default."""
    if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
        return False
    default = field.default if field.default_factory is dataclasses.MISSING else field.default_factory()
    current = getattr(value, field.name)
    if isinstance(current, np.ndarray) and default is not None:
        usual = np.asarray(default)
        usual = usual if usual.size != 1 else np.broadcast_to(usual, current.shape)
        return np.array_equal(current, usual, equal_nan=True)
    return bool(current is default if default is None else current == default)
