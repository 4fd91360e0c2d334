"""Types of fields, declared once: the accepted values, and the resulting values."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from math import degrees, hypot, inf, isfinite, nan, radians, tau
from types import ModuleType
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, ConfigDict, Field, GetCoreSchemaHandler, PlainSerializer, PlainValidator
from pydantic_core import CoreSchema, core_schema

from aerobat.arrays import AXES, Array, by_labels, text_labels
from aerobat.declaration.sentences import FieldError, shown, unknown_key, within_field
from aerobat.errors import SpecError

_ROUND_OFF = 1e-12  # [-] smaller components of a unit vector are round-off and become zero
_UNIT = 1e-15  # [-] round-off of the norm of a unit vector
_CONTROL = {*map(chr, range(32)), "\x7f"}  # control characters, which no path needs and no terminal shows
_MAX_MAGNITUDE = 1e15  # in SI units; its inverse is the smallest magnitude; powers of larger numbers overflow
_TWO_TURNS = 2.0 * tau * (1.0 + _ROUND_OFF)  # [rad] largest angle: more is hardly in radians
CONFIG = ConfigDict(  # how pydantic checks values by these types
    strict=True,  # text and bool are not numbers
    allow_inf_nan=False,
    arbitrary_types_allowed=True,
    validate_default=True,
)


def plain(value: Any) -> Any:
    """Return a list as a tuple, and a NumPy scalar as Python's."""
    if isinstance(value, list):
        return tuple(value)
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        return value.item()
    return value


def in_radians(table: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the table with an angle's shorthand in degrees replaced. Raises SpecError if both are given."""
    shorthand = f"{name}_deg"
    if shorthand not in table:
        return table
    if name in table:
        raise SpecError(f"{name} and {shorthand} are both given; give one of them")
    table[name] = radians(number(table.pop(shorthand), shorthand))
    return table


def in_degrees(table: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the table with an angle in degrees, if the conversion is exact."""
    angle = table.get(name, 0.0)
    for angle_deg in (round(degrees(angle), 9), degrees(angle)):
        if name in table and radians(angle_deg) == angle:
            del table[name]
            return {f"{name}_deg": angle_deg} | table
    return table


def unit(direction: ArrayLike) -> Array:
    """Return `direction` (3,) scaled to length one, read-only. Raises FieldError when it is zero.

    A unit vector is returned unchanged, bit by bit. For other vectors, components that are only round-off
    become zero, since they would couple unrelated axes.
    """
    vector = _direction(direction)
    components = vector.tolist()
    norm = hypot(*components)
    if abs(norm - 1.0) <= _UNIT and not any(0.0 < abs(x) < _ROUND_OFF for x in components):
        return vector
    return finite([x / norm if abs(x / norm) >= _ROUND_OFF else 0.0 for x in components], 3)


def array(value: Any, *shape: int) -> Array:
    """Return a read-only array of exactly this shape; numbers may be infinite. Raises FieldError."""
    return _shaped(value, shape, infinite=True)


def finite(value: Any, *shape: int) -> Array:
    """Return a read-only array of exactly this shape, of finite numbers. Raises FieldError."""
    return _shaped(value, shape, infinite=False)


def _shaped(value: Any, shape: tuple[int, ...], infinite: bool) -> Array:
    holds_numbers = isinstance(value, int | float | list | tuple) or hasattr(value, "__array__")
    numbers = _numbers(value, "", infinite) if holds_numbers else []
    try:
        made = np.array(numbers, dtype=np.float64)
    except ValueError:  # nested lists of unequal lengths
        made = np.empty(0)
    if made.shape != shape:
        if isinstance(numbers, list) and shape[:1] == (len(numbers),):
            for i, each in enumerate(numbers):
                with within_field(f"[{i}]"):
                    _shaped(each, shape[1:], infinite)
        wanted = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
        raise FieldError("", f"must be {wanted}, got {shown(value)}")
    made.flags.writeable = False
    return made


def number(value: Any, name: str) -> float:
    """Return a finite number that a file gives under `name`. Raises FieldError for anything else."""
    with within_field(name):
        made = _numbers(value, "", infinite=False)
        if not isinstance(made, float):
            raise FieldError("", f"must be a number, got {shown(value)}")
        return _bounded(made)


def positive(value: Any, name: str) -> float:
    """Return a positive number that a file gives under `name`. Raises FieldError for anything else."""
    made = number(value, name)
    if made <= 0.0:
        raise FieldError(name, f"must be positive, got {made:g}")
    return made


def _numbers(value: Any, place: str, infinite: bool) -> Any:
    """Return nested lists of floats from lists or arrays. Raises FieldError for the first invalid entry."""
    if isinstance(value, float) and (isfinite(value) or (infinite and value == value)):
        return float(value) + 0.0  # no negative zeros: equal values have equal bytes
    if hasattr(value, "__array__"):
        return _numbers(_listed(value, place), place, infinite)
    if isinstance(value, list | tuple):
        return [_numbers(each, f"{place}[{i}]", infinite) for i, each in enumerate(value)]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FieldError(place, f"must be a number, got {shown(value)}")
    if isinstance(value, float) or abs(value) > sys.float_info.max:
        raise FieldError(place, f"must be a finite number, got {shown(value)}")
    return float(value)


def _listed(value: Any, place: str) -> Any:
    """Return an array as lists, its components by their labels. Raises FieldError for other labels."""
    try:
        return np.asarray(by_labels(value)).tolist()
    except SpecError as error:
        raise FieldError(place, str(error)) from None


def _vector(value: Any) -> Array:
    return _small(finite(value, 3))


def _small(vector: Array) -> Array:
    """Return the vector. Raises FieldError where a finite component exceeds _MAX_MAGNITUDE."""
    for i, x in enumerate(vector.tolist()):
        _bounded(x, f"[{i}]")
    return vector


def _bounded(value: float, place: str = "") -> float:
    if _MAX_MAGNITUDE < abs(value) < inf:
        raise FieldError(place, f"must be from {-_MAX_MAGNITUDE:g} to {_MAX_MAGNITUDE:g}, got {value:g}")
    return value


def _direction(value: Any) -> Array:
    vector = _vector(value)
    if hypot(*vector.tolist()) < 1e-9:
        raise FieldError("", "must be a direction, not the zero vector")
    return vector


def _partial(value: Any) -> Array:
    """Return three numbers, from themselves or a table of some of them; NaN stands for a free component."""
    labels = text_labels(value)
    if labels and set(labels) <= set(AXES):
        value = dict(zip(labels, np.asarray(value).tolist(), strict=True))
    given = value
    if isinstance(value, Mapping):
        for key in value:
            if key not in AXES:
                raise unknown_key(str(key), AXES)
        given = [value.get(axis, nan) for axis in AXES]
    elif hasattr(value, "__array__"):
        given = _listed(value, "")
    if not isinstance(given, list | tuple) or len(given) != 3:
        raise FieldError("", f"must be three numbers or a table of some of x, y, z, got {shown(value)}")
    places = AXES if isinstance(value, Mapping) else ("[0]", "[1]", "[2]")
    free = [isinstance(x, float) and x != x for x in given]
    numbers = [
        0.0 if left_free else _numbers(x, place, infinite=False)
        for x, place, left_free in zip(given, places, free, strict=True)
    ]
    vector = np.where(free, nan, _vector(numbers))
    vector.flags.writeable = False
    return vector


def _series(value: Any) -> Array:
    return array(value, len(value) if hasattr(value, "__len__") else 0)


def _corner(value: Any) -> Array:
    return _small(array(value, 3))


def _per_axis(value: Any) -> Array:
    one = isinstance(value, int | float) or (hasattr(value, "__array__") and np.ndim(value) == 0)
    bounds = array([value] * 3 if one else value, 3)
    if not (bounds > 0.0).all():
        raise FieldError("", f"must be positive, one number or one per axis, got {shown(value)}")
    for bound in bounds.tolist():
        _reasonable(bound)
    return bounds


def _reasonable(value: float) -> float:
    if 0.0 < value < inf and not 1.0 / _MAX_MAGNITUDE <= value <= _MAX_MAGNITUDE:
        raise FieldError(
            "", f"must be from {1.0 / _MAX_MAGNITUDE:g} to {_MAX_MAGNITUDE:g}, got {value:g}; check its unit"
        )
    return value


def _not_nan(value: float) -> float:
    if value != value:
        raise FieldError("", "must be a number, got nan")
    return value


def _radians(angle: float) -> float:
    if abs(angle) > _TWO_TURNS:
        raise FieldError(
            "",
            f"must be an angle in radians, from -4π to 4π, got {angle:g}; "
            f"{angle:g}° is {radians(angle):.4g} rad",
        )
    return angle


def _path(value: Any) -> Any:
    text = os.fspath(value) if isinstance(value, str | os.PathLike) else None
    if not isinstance(text, str) or _CONTROL & set(text):
        raise FieldError("", f"must be a path, got {shown(value)}")
    try:
        os.fsencode(text)
    except UnicodeError:
        raise FieldError("", f"must be a path that can be written, got {shown(value)}") from None
    return value


class _Instance:
    """Marks a type whose values must be instances of that class; their fields are not checked."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return a schema for instances; modules and classes are rejected even if they fit a protocol."""

        def instance(value: Any) -> Any:
            if isinstance(value, type | ModuleType) or not isinstance(value, source):
                raise FieldError("", f"must be of the type {source.__name__}, got {shown(value)}")
            return value

        return core_schema.no_info_plain_validator_function(instance)


def _one_line(text: str) -> str:
    if not text.strip() or not text.isprintable():
        raise FieldError("", f"must be one line of text, got {shown(text)}")
    return text


_REASONABLE = AfterValidator(_reasonable)
Positive = Annotated[float, Field(gt=0), _REASONABLE, Field(description="positive number")]
Gravity = Annotated[float, Field(gt=0, le=1e9, description="positive number")]
NonNegative = Annotated[float, Field(ge=0, le=_MAX_MAGNITUDE, description="number ≥ 0")]
Fraction = Annotated[float, Field(gt=0, lt=1, description="number between 0 and 1")]
Limit = Annotated[
    float,
    Field(gt=0, allow_inf_nan=True),
    _REASONABLE,
    Field(description="positive number, `inf` for no limit"),
]
Count = Annotated[int, Field(ge=1, description="whole number, 1 or more")]
Repeats = Annotated[int, Field(ge=1, le=1000, description="whole number from 1 to 1000")]  # in one problem
Seed = Annotated[int, Field(ge=0, description="whole number, 0 or more")]
AS_IT_IS = _Instance()  # Annotated[BodyState, AS_IT_IS]: an instance of a class without declared fields
Finite = Annotated[float, AfterValidator(lambda number: _bounded(number)), Field(description="number")]
Number = Annotated[
    float,
    Field(allow_inf_nan=True),
    AfterValidator(_not_nan),
    AfterValidator(lambda number: _bounded(number)),
    Field(description="number, `inf` and `-inf` too"),
]
Angle = Annotated[float, AfterValidator(_radians), Field(description="number of radians, from −4π to 4π")]
TiltLimit = Annotated[
    float,
    Field(gt=0, allow_inf_nan=True),
    AfterValidator(lambda angle: angle if angle == inf else _radians(angle)),
    Field(description="number of radians to 4π, `inf` for no limit"),
]
Derivative = Annotated[int, Field(ge=0, le=5, description="whole number from 0, the position, to 5, crackle")]
PathName = Annotated[str | os.PathLike[str], PlainValidator(_path), Field(description="path")]
Label = Annotated[str, AfterValidator(_one_line), Field(description="one line of text")]
Vector3 = Annotated[Array, PlainValidator(_vector), Field(description="three numbers")]
VectorLike = Annotated[ArrayLike, PlainValidator(_vector), Field(description="three numbers")]
Direction = Annotated[Array, PlainValidator(_direction), Field(description="three numbers, not all zero")]
UnitVector = Annotated[Array, PlainValidator(unit), Field(description="three numbers, scaled to length one")]
PartialVector = Annotated[
    Array, PlainValidator(_partial), Field(description="three numbers, or a table of some of `x`, `y`, `z`")
]
Corner = Annotated[Array, PlainValidator(_corner), Field(description="three numbers, `inf` and `-inf` too")]
Series = Annotated[
    Array,
    PlainValidator(_series),
    PlainSerializer(lambda numbers: numbers.tolist(), return_type=list[float]),
    Field(description="numbers, `inf` and `-inf` too"),
]
PerAxis = Annotated[
    Array | float,
    PlainValidator(_per_axis),
    Field(description="positive number, or three of them, one per axis"),
]
