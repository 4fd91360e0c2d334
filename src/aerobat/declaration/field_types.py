"""The types of fields, declared once: what each takes, and what stands in the value afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from math import isinf, nan, radians
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field, PlainValidator

from aerobat.arrays import Array, frozen
from aerobat.declaration.sentences import FieldError, shown, unknown_key, within_field

AXES = ("x", "y", "z")
_ROUND_OFF = 1e-12  # [-] components of a unit vector that are zero but for it


def unit(direction: ArrayLike) -> Array:
    """`direction` (3,) scaled to length one, read-only. Raises FieldError when it is zero.

    A unit vector comes back as it is, bit by bit; of any other, components that are only round-off become
    zero, since they would couple axes that have nothing to do with each other.
    """
    vector = _direction(direction)
    length = float(np.linalg.norm(vector))
    if abs(length - 1.0) <= 4.0 * np.finfo(float).eps and (np.abs(vector[vector != 0.0]) >= _ROUND_OFF).all():
        return vector
    scaled = vector / length
    return frozen(np.where(np.abs(scaled) < _ROUND_OFF, 0.0, scaled), "unit vector")


def array(value: Any, *shape: int) -> Array:
    """A read-only array of exactly this shape, of numbers that may be infinite. Raises FieldError."""
    numbers = _numbers(value, "")
    try:
        made = np.array(numbers, dtype=np.float64) + 0.0  # no negative zeros: equal values have equal bytes
    except ValueError:  # ragged
        made = np.empty(0)
    if made.shape != shape:
        wanted = " x ".join(map(str, shape)) + " numbers"
        raise FieldError("", f"must be {wanted}, got {_extent(value)}")
    made.flags.writeable = False
    return made


def deg2rad(degrees: Any, name: str) -> float:
    """An angle [rad] that a file gives in degrees under `name`. Raises FieldError unless it is finite."""
    with within_field(name):
        angle = _numbers(degrees, "")
        if not isinstance(angle, float) or isinf(angle):
            raise FieldError("", f"must be a finite number, got {shown(degrees)}")
    return radians(angle)


def _numbers(value: Any, place: str) -> Any:
    """Nested lists of floats from lists or arrays. Raises FieldError for the first entry that is none."""
    if hasattr(value, "__array__"):
        value = np.asarray(value).tolist()
    if isinstance(value, list | tuple):
        return [_numbers(each, f"{place}[{i}]") for i, each in enumerate(value)]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FieldError(place, f"must be a number, got {shown(value)}")
    if value != value:
        raise FieldError(place, "must be a finite number, got nan")
    try:
        return float(value)
    except OverflowError:
        raise FieldError(place, "must be a finite number, got a huge one") from None


def _extent(value: Any) -> str:
    size = np.shape(value) if hasattr(value, "__array__") else None
    return f"an array of the shape {size}" if size else shown(value)


def finite(value: Any, *shape: int) -> Array:
    """A read-only array of exactly this shape, of finite numbers. Raises FieldError."""
    made = array(value, *shape)
    if not np.isfinite(made).all():
        raise FieldError("", "must be finite numbers; it contains an infinity")
    return made


def _vector(value: Any) -> Array:
    return finite(value, 3)


def _direction(value: Any) -> Array:
    vector = _vector(value)
    if np.linalg.norm(vector) < 1e-9:
        raise FieldError("", "must be a direction, not the zero vector")
    return vector


def _partial(value: Any) -> Array:
    """Three numbers, or a table of those that are given; NaN stands for a free one."""
    given = value
    if isinstance(value, Mapping):
        for key in value:
            if key not in AXES:
                raise unknown_key(str(key), AXES)
        given = [value.get(axis, nan) for axis in AXES]
    elif hasattr(value, "__array__"):
        given = np.asarray(value).tolist()
    if not isinstance(given, list | tuple) or len(given) != 3:
        raise FieldError("", f"must be three numbers or a table of some of x, y, z, got {shown(value)}")
    places = [f".{axis}" if isinstance(value, Mapping) else f"[{i}]" for i, axis in enumerate(AXES)]
    free = [isinstance(x, float) and x != x for x in given]
    numbers = [
        0.0 if f else _numbers(x, p.removeprefix(".")) for x, f, p in zip(given, free, places, strict=True)
    ]
    vector = np.where(free, nan, finite(numbers, 3))
    vector.flags.writeable = False
    return vector


def _corner(value: Any) -> Array:
    return array(value, 3)


def _per_axis(value: Any) -> Array:
    one = isinstance(value, int | float) or (hasattr(value, "__array__") and np.ndim(value) == 0)
    bounds = array([value] * 3 if one else value, 3)
    if not (bounds > 0.0).all():
        raise FieldError("", f"must be positive, one number or one per axis, got {shown(value)}")
    return bounds


def _not_nan(value: float) -> float:
    if value != value:
        raise FieldError("", "must be a number, got nan")
    return value


def _one_line(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise FieldError("", f"must be one line of text, got {shown(text)}")
    return text


Positive = Annotated[float, Field(gt=0, description="positive number")]
NonNegative = Annotated[float, Field(ge=0, description="number ≥ 0")]
Fraction = Annotated[float, Field(gt=0, lt=1, description="number between 0 and 1")]
Number = Annotated[
    float,
    Field(allow_inf_nan=True),
    AfterValidator(_not_nan),
    Field(description="number, `inf` and `-inf` too"),
]
Label = Annotated[str, AfterValidator(_one_line), Field(description="one line of text")]
Vector3 = Annotated[Array, PlainValidator(_vector), Field(description="three numbers")]
Direction = Annotated[Array, PlainValidator(_direction), Field(description="three numbers, not all zero")]
UnitVector = Annotated[Array, PlainValidator(unit), Field(description="three numbers, scaled to length one")]
PartialVector = Annotated[
    Array, PlainValidator(_partial), Field(description="three numbers, or a table of some of `x`, `y`, `z`")
]
Corner = Annotated[Array, PlainValidator(_corner), Field(description="three numbers, `inf` and `-inf` too")]
PerAxis = Annotated[
    Array | float,
    PlainValidator(_per_axis),
    Field(description="positive number, or three of them, one per axis"),
]
