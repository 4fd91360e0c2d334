"""Arrays in nested tuples and dataclasses, such as those of set-points and scores."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


def map_arrays(function: Callable[..., Any], *values: T) -> T:
    """Return the first value with its arrays replaced by `function` of those of all values.

    The values are arrays, or tuples and dataclasses of one structure, however deeply nested.
    """
    made: Any = values[0]
    if isinstance(made, np.ndarray):
        made = function(*values)
    elif isinstance(made, tuple):
        made = tuple(map_arrays(function, *parts) for parts in zip(*values, strict=True))
    elif hasattr(made, "__dataclass_fields__"):
        fields_of_all = {field.name: [getattr(each, field.name) for each in values] for field in fields(made)}
        made = replace(made, **{name: map_arrays(function, *own) for name, own in fields_of_all.items()})
    return made  # type: ignore[no-any-return]


def rows_of(value: T, rows: slice | NDArray[np.intp]) -> T:
    """Return the value with some rows of its arrays."""
    return map_arrays(itemgetter(rows), value)


def joined(parts: Sequence[T]) -> T:
    """Return consecutive parts, for instance scores of flights, as one, with their arrays concatenated."""
    return map_arrays(lambda *arrays: np.concatenate(arrays), *parts)
